#pragma once

#include <vector>

#include "mr/core/image.h"

namespace mr::rate {

inline constexpr int kFeatureBlock = 32;  ///< pixels a side

/// DCT energy of a picture (paper 4, "Low Complexity Feature Extraction"): per block of w = h = 32
/// pixels the sum over i = 1..w, j = 1..h, (i, j) != (1, 1), of
///   exp((i j / (w h))² - 1) |DCT(i - 1, j - 1)|
/// with the orthonormal DCT-II, averaged over the whole blocks of the picture. `plane`: luma
/// 0..255, or depth in millimetres. 0 for a picture smaller than one block.
double dct_energy(const Image<float, 1>& plane);

/// The same of the difference of two pictures of one size: how much moves.
double temporal_dct_energy(const Image<float, 1>& before, const Image<float, 1>& now);

/// BT.709 luma, 0..255.
Image<float, 1> luma_plane(const ImageRgb& picture);
/// Depth in millimetres; invalid pixels take the value of their left neighbour (of the row above at
/// a row's begin), so that holes do not count as texture.
Image<float, 1> depth_plane(const ImageDepth& depth);

/// What describes one sensor's frame (paper Fig. 9).
struct SceneFeatures {
  double color_spatial = 0, color_temporal = 0, depth_spatial = 0, depth_temporal = 0;
};

}  // namespace mr::rate
