#pragma once

#include <cstdint>
#include <functional>

#include "mr/core/frame.h"

namespace mr::node {

/// Tells the time: the machine's, or a virtual one. Any thread.
using Clock = std::function<TimePoint()>;

/// What a running node stamps its packets with. The default is that of lockstep runs, where the
/// same input must give the same bytes.
struct NodeClock {
  std::uint32_t epoch = 0;  ///< another one after every start
  Clock now;                ///< for time marks; none: no marks

  /// The clock of a node that starts now.
  static NodeClock live();
};

/// The machine's time.
TimePoint wall_time();

}  // namespace mr::node
