#include "mr/sensor/azure_kinect/captures.h"

#include <algorithm>
#include <utility>

namespace mr::sensor {
namespace {

constexpr std::size_t kMostWaiting = 64;  // of one track, while the other has none

}  // namespace

KinectCaptures::KinectCaptures(KinectRecording recording) : recording_(std::move(recording)) {
  recording_.leave_out(KinectTrack::infrared);
  recording_.leave_out(KinectTrack::imu);
}

Status KinectCaptures::seek(TimePoint at) {
  color_.clear(), depth_.clear();
  newest_.reset(), error_.reset();
  ended_ = false;
  return recording_.seek(at);
}

/// The time at which a block counts for grouping.
TimePoint KinectCaptures::shifted(KinectTrack track, TimePoint at) const {
  const Duration delay = header().depth_delay;
  if (track == KinectTrack::color) return delay > Duration{} ? at + delay : at;
  return delay < Duration{} ? at - delay : at;
}

/// Reads until both tracks have a block, or the one that has none can have none of this capture:
/// blocks lie in the file by time, but for a few milliseconds.
Status KinectCaptures::read_ahead() {
  const bool wants_color = header().color.has_value(), wants_depth = header().depth.has_value();
  while (!ended_) {
    const bool lacks = (wants_color && color_.empty()) || (wants_depth && depth_.empty());
    if (!lacks) return {};
    const Queue& waiting = color_.empty() ? depth_ : color_;
    const KinectTrack track = color_.empty() ? KinectTrack::depth : KinectTrack::color;
    if (!waiting.empty() && (waiting.size() > kMostWaiting ||
                             *newest_ > shifted(track, waiting.front().at) + 2 * header().period))
      return {};
    auto block = recording_.next();
    if (!block || !*block) ended_ = true;
    if (!block) return block.error();
    if (!*block) return {};
    const TimePoint at = shifted((*block)->track, (*block)->at);
    newest_ = newest_ ? std::max(*newest_, at) : at;
    Queue& queue = (*block)->track == KinectTrack::color ? color_ : depth_;
    queue.push_back(**std::move(block));
  }
  return {};
}

Result<std::optional<KinectCapture>> KinectCaptures::next() {
  if (const Status read = read_ahead(); !read) error_ = read.error();
  KinectCapture out;
  const auto take = [](Queue& from, std::optional<KinectBlock>& to) {
    to = std::move(from.front());
    from.pop_front();
  };
  if (color_.empty() && depth_.empty()) {
    if (error_) return *std::exchange(error_, std::nullopt);
    return std::optional<KinectCapture>();
  }
  if (color_.empty() || depth_.empty()) {
    if (color_.empty())
      take(depth_, out.depth);
    else
      take(color_, out.color);
    return std::optional(std::move(out));
  }
  const TimePoint color = shifted(KinectTrack::color, color_.front().at);
  const TimePoint depth = shifted(KinectTrack::depth, depth_.front().at);
  const Duration half = header().period / 2;
  if (color < depth + half) take(color_, out.color);
  if (depth < color + half) take(depth_, out.depth);
  return std::optional(std::move(out));
}

}  // namespace mr::sensor
