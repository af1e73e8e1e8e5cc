#pragma once

#include <optional>
#include <string>
#include <vector>

#include "mr/core/range.h"
#include "mr/core/vec.h"

namespace mr {

inline constexpr Range kCorner_m{-1e5, 1e5};  ///< of a box in the world, each coordinate

/// What is impossible in a box, a line each; none where there is no box.
inline std::vector<std::string> box_problems(const std::optional<Box3d>& box) {
  if (!box) return {};
  for (int axis = 0; axis < 3; ++axis) {
    const double low = box->low[axis], high = box->high[axis];
    if (!kCorner_m.contains(low) || !kCorner_m.contains(high)) return {to_string(kCorner_m)};
    if (low >= high) return {"is empty: its first corner must be below its second on every axis"};
  }
  return {};
}

struct MergerConfig {
  std::string id;
  std::vector<std::string> inputs;  ///< ids of sensors or mergers
  double deadline_ms = 50;          ///< waits this long for the slowest input
  double budget_ms = 0;  ///< merging should take no longer: what only improves the surface is then
                         ///< left out; 0: no limit
  /// Spatial split: the merger owns the surface in here, and takes no other. Its inputs may feed
  /// other mergers with a region, too.
  std::optional<Box3d> region{};

  static constexpr Range kDeadline_ms{0, 60'000, true}, kBudget_ms{0, 60'000};
  /// The invalid fields, one line each; empty: valid.
  std::vector<std::string> problems() const {
    std::vector<std::string> out = out_of_range(
        {{"deadline_ms", deadline_ms, kDeadline_ms}, {"budget_ms", budget_ms, kBudget_ms}});
    if (inputs.empty()) out.push_back("inputs must name a sensor or merger");
    append(out, prefixed("region ", box_problems(region)));
    return out;
  }
  friend bool operator==(const MergerConfig&, const MergerConfig&) = default;
};

struct LinkConfig {
  std::string from, to;
  double limit_mbps = 0;  ///< 0: no limit is known

  static constexpr Range kLimit_mbps{0, 1e6, true};
  /// The invalid fields, one line each; empty: valid.
  std::vector<std::string> problems() const {
    if (limit_mbps == 0) return {};
    return out_of_range({{"limit_mbps", limit_mbps, kLimit_mbps}});
  }
  friend bool operator==(const LinkConfig&, const LinkConfig&) = default;
};

}  // namespace mr
