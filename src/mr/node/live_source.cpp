#include "mr/node/live_source.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <mutex>

#include "mr/node/node_clock.h"

namespace mr::node {

LiveSource::LiveSource(std::unique_ptr<FrameSource> source, double fps)
    : source_(std::move(source)), fps_(fps) {
  if (!source_->endless()) {
    start_ = wall_time();
    return;
  }
  next_ = index_at(wall_time());
  source_->skip(next_);
}

TimePoint LiveSource::time_of(std::uint64_t index) const {
  return start_ + Duration(std::llround(static_cast<double>(index) * 1e9 / fps_));
}

std::uint64_t LiveSource::index_at(TimePoint now) const {
  const auto since = static_cast<double>((now - start_).count());
  return static_cast<std::uint64_t>(std::max(0.0, std::floor(since * fps_ / 1e9)));
}

void LiveSource::skip_to(std::uint64_t index, const Watch& watch) {
  constexpr std::uint64_t kMostWatched = 16;
  skipped_ += index - next_;
  std::uint64_t watched = watch ? std::min(index - next_, kMostWatched) : 0;
  source_->skip(index - next_ - watched);
  next_ = index;
  for (; watched > 0; --watched) {
    auto frame = source_->next();
    if (!frame) continue;  // that one was lost
    if (!*frame || !watch(**std::move(frame))) return source_->skip(watched - 1);
  }
}

Result<std::optional<Frame>> LiveSource::newest(const std::stop_token& stop, const Watch& watch) {
  // The clock was set back: go on from there.
  if (const Duration ahead = time_of(next_) - wall_time(); ahead > std::chrono::seconds(1))
    start_ -= ahead;
  if (!wait_until(stop, time_of(next_))) return std::optional<Frame>();
  if (const std::uint64_t now = index_at(wall_time()); now > next_) skip_to(now, watch);
  if (const std::uint64_t now = index_at(wall_time()); now > next_)
    skip_to(now, {});  // it took time
  ++next_;
  auto frame = source_->next();
  if (frame && *frame && start_ != TimePoint{}) {
    (*frame)->exposure_start += start_.time_since_epoch();
    (*frame)->exposure_end += start_.time_since_epoch();
  }
  return frame;
}

bool wait_until(const std::stop_token& stop, TimePoint time) {
  std::mutex mutex;
  std::condition_variable_any never;
  std::unique_lock lock(mutex);
  const auto wait = std::max(time - wall_time(), Duration::zero());
  never.wait_for(lock, stop, wait, [] { return false; });
  return !stop.stop_requested();
}

}  // namespace mr::node
