#pragma once

#include <cstdint>
#include <functional>
#include <optional>

#include "mr/core/frame.h"

namespace mr::node {

/// What a running node stamps its packets with. The default is that of lockstep runs, where the
/// same input must give the same bytes.
struct NodeClock {
  std::uint32_t epoch = 0;         ///< another one after every start
  std::function<TimePoint()> now;  ///< for time marks; none: no marks

  /// The clock of a node that starts now.
  static NodeClock live();
};

/// The machine's time.
TimePoint wall_time();

/// Whether what was last done then may be done again; clocks may be set back.
inline bool is_time(const std::optional<TimePoint>& last, Duration every, TimePoint now) {
  return !last || now - *last >= every || now < *last;
}

}  // namespace mr::node
