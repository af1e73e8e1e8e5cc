#pragma once

#include "mr/core/frame.h"
#include "mr/core/image.h"

namespace mr::rate {

inline constexpr int kFeatureBlock = 32;  ///< pixels a side

/// DCT energy of a picture (paper 4, "Low Complexity Feature Extraction"): per block of w = h = 32
/// pixels the sum over i = 1..w, j = 1..h, (i, j) != (1, 1), of
///   exp((i j / (w h))² - 1) |DCT(i - 1, j - 1)|
/// with the orthonormal DCT-II, averaged over the whole blocks of the picture. `plane`: luma
/// 0..255, or depth in millimetres. 0 for a picture smaller than one block. The same on any number
/// of threads.
double dct_energy(const Image<float, 1>& plane);

/// The DCT energy of the difference of two pictures of one size: a measure of motion.
double temporal_dct_energy(const Image<float, 1>& before, const Image<float, 1>& now);

/// BT.709 luma, 0..255.
Image<float, 1> luma_plane(const ImageRgb& picture);
/// Depth in millimetres. Invalid pixels are filled from their left neighbour (in the first column
/// from the row above; before the first valid pixel with its value), so that holes do not count as
/// texture. All 0 if nothing is valid.
Image<float, 1> depth_plane(const ImageDepth& depth);

/// The planes of a frame from which features are computed; the colour plane is empty without
/// colour.
struct FeaturePlanes {
  Image<float, 1> color, depth;
};
FeaturePlanes feature_planes(const Frame& frame);

/// The features of one sensor's frame (paper Fig. 9).
struct SceneFeatures {
  double color_spatial = 0, color_temporal = 0, depth_spatial = 0, depth_temporal = 0;
};

/// The features of a frame, given the previous one; 0 for the colour of a sensor without colour.
SceneFeatures scene_features(const FeaturePlanes& before, const FeaturePlanes& now);

}  // namespace mr::rate
