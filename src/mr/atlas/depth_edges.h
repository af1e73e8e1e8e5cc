#pragma once

#include <vector>

#include "mr/core/image.h"

namespace mr::atlas {

/// Distances from the depth edges (occlusion boundaries) of a depth picture, at a quarter of its
/// resolution: two-pass chamfer distance transform (Borgefors 1986).
class DepthEdges {
 public:
  /// `depth`: metres, 0: nothing, which is beyond everything. `pixel`: width of a pixel at 1 m.
  DepthEdges(const ImageDepth& depth, float pixel);

  /// Pixels from a pixel of the depth picture to the next depth edge, at most kFar_px; smooth
  /// (bilinear).
  float distance_px(float x, float y) const;

  static constexpr float kFar_px = 24;

 private:
  static constexpr int kCell_px = 4;

  int columns_, rows_;
  std::vector<float> distance_px_;  ///< [rows * columns]
};

}  // namespace mr::atlas
