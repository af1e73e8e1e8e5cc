#pragma once

namespace mr::simplify {

/// Decimation of a node's surface.
struct SimplifyConfig {
  double ratio = 1;    ///< triangles kept, (0, 1]
  double error_m = 0;  ///< largest error of a collapse; 0: no limit. Without `ratio` the only limit
  friend bool operator==(const SimplifyConfig&, const SimplifyConfig&) = default;
};

}  // namespace mr::simplify
