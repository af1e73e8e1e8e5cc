#include "mr/sensor/folders/timed_items.h"

#include <algorithm>
#include <optional>
#include <utility>

namespace mr::sensor {

Result<std::optional<RecordingReader::Capture>> TimedItems::peek() {
  if (next_ >= times_.size()) return std::optional<Capture>();
  return std::optional(Capture{times_[next_], next_});
}

Result<Frame> TimedItems::take() {
  const std::size_t item = next_++;  // a lost one is not asked for again
  auto frame = items_.read(item);
  if (!frame) return items_.lost(item, frame.error());
  frame->exposure_start = frame->exposure_end = times_[item];
  return frame;
}

Status TimedItems::seek(TimePoint time) {
  const auto after = std::ranges::upper_bound(times_, time);
  next_ = after == times_.begin() ? 0 : static_cast<std::size_t>(after - times_.begin()) - 1;
  return {};
}

}  // namespace mr::sensor
