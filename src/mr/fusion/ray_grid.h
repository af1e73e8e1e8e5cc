#pragma once

#include <vector>

#include "mr/core/camera.h"
#include "mr/core/image.h"
#include "mr/core/packet.h"

namespace mr::fusion {

/// The angles between the rays of neighbouring pixels: all that the depth filters need to know of
/// the camera. For a pinhole, those at the picture's centre.
struct RaySpacing {
  RaySpacing(int width, int height);   ///< a pinhole with a field of half a radian
  explicit RaySpacing(const Camera&);  ///< must pass Camera::problems

  int width = 0, height = 0;
  bool around = false;              ///< panorama: the last column is next to the first
  bool rows_touch = true;           ///< beams of neighbouring rows overlap; false for a LiDAR
  std::vector<int> turn;            ///< [H] columns by which a row lags behind (LiDAR)
  std::vector<float> across_rad;    ///< [H] angle from one pixel to the next
  std::vector<float> altitude_rad;  ///< [H] of the row, downwards

  /// The angle from row y to y + 1; 0: one of them does not exist.
  float down_rad(int y) const;
};

/// A depth picture as inverse depth, 1/m, in which every plane is an affine function of the pixel
/// and noise is nearly uniform. A LiDAR's rows are shifted so that columns align. The margin around
/// the picture holds invalid pixels or, in a panorama, those from beyond the seam.
class RayGrid {
 public:
  static constexpr int kMargin = 8;  ///< pixels

  RayGrid(int width, int height, bool around);

  int width() const { return width_; }
  int height() const { return height_; }
  bool around() const { return around_; }

  /// Pixel 0 of a row; rows and columns from -kMargin on can be read. 0: invalid.
  float* row(int y) { return data_.data() + offset(y); }
  const float* row(int y) const { return data_.data() + offset(y); }
  /// Updates a row's margins; to be called after the row was written.
  void wrap(int y);

 private:
  std::size_t offset(int y) const {
    return static_cast<std::size_t>(y + kMargin) * (width_ + 2 * kMargin) + kMargin;
  }

  int width_, height_;
  bool around_;
  std::vector<float> data_;
};

/// Converts depth. Values that are not between a micrometre and a thousand kilometres are invalid.
RayGrid to_grid(const ImageDepth& depth, const RaySpacing& rays);

/// Converts back to depth. `before`, which may be null: the original depth, which is copied where
/// it and the grid agree, so that unchanged pixels keep their exact bytes.
ImageDepth to_depth(const RayGrid& grid, const RaySpacing& rays, const ImageDepth* before);

/// Standard deviation of inverse depth: sigma(z) / z².
struct InverseSigma {
  explicit InverseSigma(const Precision& p)
      : base(static_cast<float>(p.base_m)), per(static_cast<float>(p.per_m2) + kLeast) {}
  float operator()(float w) const { return base * w * w + per; }

  static constexpr float kLeast = 1e-9f;  ///< never 0

  float base, per;
};

}  // namespace mr::fusion
