#pragma once

namespace mr::simplify {

/// How far a node's surface is decimated.
struct SimplifyConfig {
  double ratio = 1;    ///< triangles kept, (0, 1]
  double error_m = 0;  ///< no collapse costs more; 0: any. Alone, it decides alone
  friend bool operator==(const SimplifyConfig&, const SimplifyConfig&) = default;
};

}  // namespace mr::simplify
