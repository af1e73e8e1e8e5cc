#include "mr/node/node_clock.h"

#include <chrono>

namespace mr::node {

TimePoint wall_time() {
  return std::chrono::time_point_cast<Duration>(std::chrono::system_clock::now());
}

NodeClock NodeClock::live() {
  // In units of 10 ms, so that a node that is restarted at once gets another epoch; the values
  // repeat after 497 days.
  const auto ticks = wall_time().time_since_epoch() / std::chrono::milliseconds(10);
  return {static_cast<std::uint32_t>(ticks), wall_time};
}

}  // namespace mr::node
