#include "mr/runtime/paced_frames.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>

namespace mr::runtime {

PacedFrames::PacedFrames(std::unique_ptr<FrameSource> source, double fps, node::Clock clock)
    : source_(std::move(source)), fps_(fps), clock_(std::move(clock)) {
  if (!source_->endless()) {
    start_ = clock_();
    return;
  }
  next_ = index_at(clock_());
  source_->skip(next_);
}

bool PacedFrames::is_ready(TimePoint now) {
  // The clock was set back: continue from the new time.
  const Duration ahead = time_of(next_) - now;
  if (ahead > std::max<Duration>(std::chrono::seconds(1), 2 * period())) start_ -= ahead;
  return now >= time_of(next_);
}

TimePoint PacedFrames::time_of(std::uint64_t index) const {
  return start_ + Duration(std::llround(static_cast<double>(index) * 1e9 / fps_));
}

std::uint64_t PacedFrames::index_at(TimePoint now) const {
  const auto since = static_cast<double>((now - start_).count());
  return static_cast<std::uint64_t>(std::max(0.0, std::floor(since * fps_ / 1e9)));
}

void PacedFrames::skip_to(std::uint64_t index, const Watch& watch) {
  constexpr std::uint64_t kMostWatched = 16;
  if (index <= next_) return;
  skipped_ += index - next_;
  std::uint64_t watched = watch ? std::min(index - next_, kMostWatched) : 0;
  source_->skip(index - next_ - watched);
  next_ = index;
  for (; watched > 0; --watched) {
    auto frame = source_->next();
    if (!frame) continue;  // this frame was lost
    if (!*frame || !watch(**std::move(frame))) return source_->skip(watched - 1);
  }
}

Result<std::optional<node::FrameInput::Captured>> PacedFrames::next(TimePoint now,
                                                                    const Watch& watch) {
  skip_to(index_at(now), watch);
  skip_to(index_at(clock_()), {});  // `watch` took time
  ++next_;
  auto frame = source_->next();
  if (!frame) return frame.error();
  if (!*frame) return std::optional<Captured>();
  if (start_ != TimePoint{}) {
    (*frame)->exposure_start += start_.time_since_epoch();
    (*frame)->exposure_end += start_.time_since_epoch();
  }
  return std::optional(Captured{**std::move(frame), clock_()});
}

}  // namespace mr::runtime
