#include "mr/kit/device_clock.h"

#include <algorithm>
#include <cmath>

namespace mr::kit {

TimePoint DeviceClock::system_time(Duration device, TimePoint arrived) {
  const Sample sample{device, arrived.time_since_epoch() - device};
  if (!last_ || device < *last_ || has_jumped(sample)) begin_anew(sample);
  while (!least_.empty() && least_.back().offset >= sample.offset) least_.pop_back();
  least_.push_back(sample);
  while (least_.front().device < device - kWindow) least_.pop_front();
  follow(device);
  last_ = device;
  return TimePoint(device + offset_);
}

void DeviceClock::begin_anew(const Sample& sample) {
  least_.clear();
  late_since_.reset();
  last_ = began_ = sample.device;
  offset_ = sample.offset;
}

/// Whether one of the clocks was set. A late arrival may be a stall, so it has to last.
bool DeviceClock::has_jumped(const Sample& sample) {
  if (sample.offset < offset_ - kJump) return true;
  if (sample.offset <= offset_ + kJump) {
    late_since_.reset();
    return false;
  }
  if (!late_since_) late_since_ = sample.device;
  return sample.device - *late_since_ >= kLate;
}

void DeviceClock::follow(Duration device) {
  const Duration to_least = least_.front().offset - offset_;
  const Duration most(std::llround(static_cast<double>((device - *last_).count()) * kSlew));
  offset_ += device - began_ < kLearning ? to_least : std::clamp(to_least, -most, most);
}

}  // namespace mr::kit
