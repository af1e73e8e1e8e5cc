#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "mr/core/camera.h"
#include "mr/core/pose.h"
#include "mr/merge/overlap/measured.h"

namespace mr::merge {

/// The nearest surface of a part, as one of its sources' cameras sees it: the triangle in every
/// pixel.
class PartView {
 public:
  /// Draws the triangles that `source` (place in the part's sources) measured, as far as they face
  /// the camera. `camera`: an undistorted pinhole at the source's place; surface up to `margin_px`
  /// outside of its picture counts as well, as poses and labels may be a little off. `measured`
  /// must outlive the view.
  PartView(const kit::Part& part, const Measured& measured, std::uint32_t source,
           const Camera& camera, const Pose& T_world_camera, int margin_px);

  /// The part's triangle at a spot of another part, if it has surface there: it faces alike and
  /// lies within twice the sensors' precision (paper 3.2) and both parts' slack, along the normal.
  std::optional<std::uint32_t> at(const SurfacePoint& spot, float slack_m) const;

 private:
  void widen();

  const Measured* measured_;
  int width_ = 0, height_ = 0;
  Vec3f origin_, right_, down_,
      forward_;  ///< rows of the projection: pixel = right · p / forward · p
  Precision precision_;
  std::vector<std::uint32_t> triangle_;  ///< [width · height], kit::kNoTriangle: none
};

}  // namespace mr::merge
