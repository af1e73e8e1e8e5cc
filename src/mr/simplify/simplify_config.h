#pragma once

#include <string>
#include <vector>

#include "mr/core/range.h"

namespace mr::simplify {

/// Decimation of a node's surface.
struct SimplifyConfig {
  double ratio = 1;    ///< triangles kept, (0, 1]
  double error_m = 0;  ///< largest error of a collapse; 0: no limit. Without `ratio` the only limit

  static constexpr Range kRatio{0, 1, true}, kError_m{0, 1};
  /// The invalid fields, one line each; empty: valid.
  std::vector<std::string> problems() const {
    return out_of_range({{"ratio", ratio, kRatio}, {"error_m", error_m, kError_m}});
  }
  friend bool operator==(const SimplifyConfig&, const SimplifyConfig&) = default;
};

}  // namespace mr::simplify
