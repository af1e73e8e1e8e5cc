#include "mr/runtime/live_frames.h"

#include <chrono>
#include <utility>

#include "mr/core/assert.h"

namespace mr::runtime {
namespace {

std::size_t bytes_of(const Frame& frame) {
  return frame.depth.data.size() * sizeof(float) + frame.color.data.size();
}

}  // namespace

LiveFrames::LiveFrames(std::unique_ptr<FrameSource> source, node::Clock clock,
                       std::size_t kept_bytes)
    : source_(std::move(source)), clock_(std::move(clock)), kept_bytes_(kept_bytes) {
  MR_ASSERT(source_->is_live());
  reader_ = std::jthread([this](const std::stop_token& stop) { read(stop); });
}

void LiveFrames::wake_by(std::function<void()> wake) {
  const std::lock_guard lock(mutex_);
  wake_ = std::move(wake);
}

void LiveFrames::read(const std::stop_token& stop) {
  // A source that fails at once, again and again, must not take a core.
  constexpr auto kPause = std::chrono::milliseconds(10);
  bool goes_on = true;
  while (goes_on && !stop.stop_requested()) {
    auto frame = source_->next();
    const bool failed = !frame.ok();
    goes_on = keep(std::move(frame));
    std::unique_lock lock(mutex_);
    const auto wake = wake_;
    if (failed) failed_.wait_for(lock, stop, kPause, [] { return false; });
    lock.unlock();
    if (wake) wake();
  }
}

/// False: nothing will follow.
bool LiveFrames::keep(Result<std::optional<Frame>> frame) {
  const std::lock_guard lock(mutex_);
  if (!frame) {
    errors_.push_back(frame.error());
    if (errors_.size() > kKept) errors_.pop_front();
    return true;
  }
  ended_ = !*frame;
  if (!ended_) keep_newest(**std::move(frame));
  return !ended_;
}

void LiveFrames::keep_newest(Frame frame) {
  bytes_ += bytes_of(frame);
  frames_.push_back({std::move(frame), clock_()});
  while (frames_.size() > 1 && (frames_.size() > kKept + 1 || bytes_ > kept_bytes_)) {
    bytes_ -= bytes_of(frames_.front().frame);
    frames_.pop_front();
    ++skipped_;
  }
}

bool LiveFrames::is_ready(TimePoint) {
  const std::lock_guard lock(mutex_);
  return ended_ || !frames_.empty() || !errors_.empty();
}

Result<std::optional<node::FrameInput::Captured>> LiveFrames::next(TimePoint, const Watch& watch) {
  std::deque<Captured> older;
  std::optional<Captured> newest;
  {
    const std::lock_guard lock(mutex_);
    if (!errors_.empty()) {
      Error oldest = std::move(errors_.front());
      errors_.pop_front();
      return oldest;
    }
    if (frames_.empty()) {
      if (ended_) return std::optional<Captured>();
      return Error{Error::Cause::empty, "no frame is waiting"};
    }
    newest = std::move(frames_.back());
    frames_.pop_back();
    skipped_ += frames_.size();
    older.swap(frames_);
    bytes_ = 0;
  }
  for (Captured& captured : older)
    if (!watch || !watch(std::move(captured.frame))) break;
  return newest;
}

std::uint64_t LiveFrames::skipped() const {
  const std::lock_guard lock(mutex_);
  return skipped_;
}

}  // namespace mr::runtime
