#pragma once

#include <cstdint>
#include <functional>

#include "mr/core/frame.h"

namespace mr::node {

/// A clock: the machine's or a virtual one. Any thread.
using Clock = std::function<TimePoint()>;

/// The epoch and clock with which a node stamps its packets. Default: lockstep runs, where the same
/// input must give the same bytes.
struct NodeClock {
  std::uint32_t epoch = 0;  ///< differs after every start of the node
  Clock now;                ///< for time marks; none: no marks

  /// The clock of a node that starts now.
  static NodeClock live();
};

/// The machine's time.
TimePoint wall_time();

}  // namespace mr::node
