#pragma once

#include <optional>
#include <string>
#include <vector>

#include "mr/core/vec.h"

namespace mr {

struct MergerConfig {
  std::string id;
  std::vector<std::string> inputs;  ///< ids of sensors or mergers
  double deadline_ms = 50;          ///< waits this long for the slowest input
  double budget_ms = 0;  ///< merging should take no longer: what only improves the surface is then
                         ///< left out; 0: no limit
  /// Spatial split: the merger owns the surface in here, and takes no other. Its inputs may feed
  /// other mergers with a region, too.
  std::optional<Box3d> region{};
  friend bool operator==(const MergerConfig&, const MergerConfig&) = default;
};

struct LinkConfig {
  std::string from, to;
  double limit_mbps = 0;
  friend bool operator==(const LinkConfig&, const LinkConfig&) = default;
};

}  // namespace mr
