#pragma once

#include <vector>

#include "mr/core/camera.h"
#include "mr/core/image.h"
#include "mr/core/packet.h"

namespace mr::fusion {

/// How far apart the rays of neighbouring pixels are; all that the clean-up of a depth picture asks
/// of its camera. An angle of a pinhole is that at the picture's centre.
struct RaySpacing {
  RaySpacing(int width, int height);   ///< of an ordinary picture, half a radian wide
  explicit RaySpacing(const Camera&);  ///< usable (Camera::problems)

  int width = 0, height = 0;
  bool around = false;              ///< the last column is the first one's neighbour
  bool rows_touch = true;           ///< beams of neighbouring rows share light; not so a LiDAR's
  std::vector<int> turn;            ///< [H] columns by which a row lags behind (LiDAR)
  std::vector<float> across_rad;    ///< [H] from one pixel to the next
  std::vector<float> altitude_rad;  ///< [H] of the row, downwards

  /// From row y to y + 1; 0 where one of them is none.
  float down_rad(int y) const;
};

/// A depth picture as inverse depth, 1/m, in which every plane is affine, however grazing, and
/// noise is nearly the same everywhere. Rows are turned so that columns line up. Around the picture
/// is a margin: of invalid pixels, or of what follows beyond the seam.
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
  /// After a row was written: brings its margins up to date.
  void wrap(int y);

 private:
  std::size_t offset(int y) const {
    return static_cast<std::size_t>(y + kMargin) * (width_ + 2 * kMargin) + kMargin;
  }

  int width_, height_;
  bool around_;
  std::vector<float> data_;
};

/// Depth that is no number between a micrometre and a thousand kilometres counts as invalid.
RayGrid to_grid(const ImageDepth& depth, const RaySpacing& rays);

/// Back to depth. `before`, which may be null: the depth that is copied where it and the grid hold
/// a surface, so that what no step touched keeps its bytes.
ImageDepth to_depth(const RayGrid& grid, const RaySpacing& rays, const ImageDepth* before);

/// Spread of inverse depth: sigma(z) / z².
struct InverseSigma {
  explicit InverseSigma(const Precision& p)
      : base(static_cast<float>(p.base_m)), per(static_cast<float>(p.per_m2) + kLeast) {}
  float operator()(float w) const { return base * w * w + per; }

  static constexpr float kLeast = 1e-9f;  ///< never 0

  float base, per;
};

}  // namespace mr::fusion
