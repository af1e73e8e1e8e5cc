#pragma once

#include <optional>
#include <vector>

#include <span>

#include "mr/core/frame.h"
#include "mr/core/image.h"
#include "mr/core/packet.h"
#include "mr/rate/dct_kernels.h"

namespace mr::rate {

/// DCT energy of a picture (paper 4, "Low Complexity Feature Extraction"): per block of w = h = 32
/// pixels the sum over i = 1..w, j = 1..h, (i, j) != (1, 1), of
///   exp((i j / (w h))² - 1) |DCT(i - 1, j - 1)|
/// with the orthonormal DCT-II, averaged over the whole blocks of the picture. `plane`: luma
/// 0..255, or depth in millimetres. 0 for a picture smaller than one block. In single precision;
/// the same on any number of threads and with any instruction set.
double dct_energy(const Image<float, 1>& plane);

/// BT.709 luma, 0..255.
Image<float, 1> luma_plane(const ImageRgb& picture);
/// Depth in millimetres. Invalid pixels are filled from their left neighbour (in the first column
/// from the row above; before the first valid pixel with its value), so that holes do not count as
/// texture. All 0 if nothing is valid.
Image<float, 1> depth_plane(const ImageDepth& depth);

/// The features of one picture, of its whole blocks. Unit: levels of luma 0..255, or millimetres.
struct PictureFeatures {
  double spatial = 0;             ///< DCT energy: texture, or the relief of depth
  double temporal = 0;            ///< DCT energy of the difference to the picture before: motion
  double spatial_deviation = 0;   ///< of the blocks' energies: standard deviation
  double temporal_deviation = 0;  ///< of the blocks' temporal energies: standard deviation
  /// `temporal` less that of the picture before: whether motion sets in or ends (Menon et al. 2022,
  /// "VCA: Video Complexity Analyzer").
  double temporal_gradient = 0;
  double pixel_deviation = 0;  ///< contrast: standard deviation of the pixels
};

/// The features of a sensor's frame (paper Fig. 9).
struct SceneFeatures {
  PictureFeatures color, depth;  ///< of luma; of depth without holes. 0 without such a picture
  /// 0..1: of the depth pixels that are valid in this frame and the one before, those whose depth
  /// changed by more than noise.
  double moving_pixels = 0;
  // Of the surface that is sent with the frame; FeatureExtractor leaves these at 0:
  double mask_coverage = 0;  ///< 0..1: of the depth pixels, those that it is reconstructed from
  double triangles = 0;      ///< before decimation
};

/// The features of one sensor's frame.
struct SensorFeatures {
  bool has_color = false;
  SceneFeatures features;
};

/// The features as a list, in a fixed order, as packets carry them.
std::vector<float> values_of(const SceneFeatures& features);
/// Untrusted values; nothing where they are not as many as there should be.
std::optional<SceneFeatures> features_of(std::span<const float> values);

/// Mean over the sensors; of colour, over those that have it. 0 where there are none.
SceneFeatures mean_features(std::span<const SensorFeatures> sensors);

/// Computes the features of one sensor's frames, each compared to the one before it. In the first
/// picture, and after a change of its size, `temporal` is 0; `temporal_gradient` in the first two.
/// Keeps the coefficients of the last frame: 4 bytes for each pixel of colour and 8 of depth. One
/// thread at a time; uses parallel_for.
class FeatureExtractor {
 public:
  /// `precision`: of the sensor's depth.
  explicit FeatureExtractor(const Precision& precision = {}) : precision_(precision) {}

  SceneFeatures extract(const Frame& frame);

 private:
  /// The DCT is linear: its coefficients of the picture before give those of the difference.
  struct History {
    int width = 0, height = 0;
    bool has_picture = false;
    std::vector<DctBlock> dct;       ///< of the picture before, row by row
    std::optional<double> temporal;  ///< of the picture before
  };

  template <typename Row>
  static PictureFeatures extract_picture(int width, int height, const Row& row, History& history);
  double moving_pixels(const ImageDepth& depth);

  Precision precision_;
  History color_, depth_;
  ImageDepth depth_before_;
};

}  // namespace mr::rate
