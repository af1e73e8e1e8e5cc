#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "mr/core/camera.h"
#include "mr/core/pose.h"
#include "mr/merge/overlap/measured.h"

namespace mr::merge {

/// An ID buffer: the nearest triangle of a part in every pixel of one of its sources' cameras.
class PartView {
 public:
  /// Rasterizes the front-facing triangles that `source` (index into the part's sources) measured.
  /// `camera`: an undistorted pinhole at the source's pose. Surface up to `margin_px` outside its
  /// picture is included, as poses and labels may be slightly off. `measured` must outlive the
  /// view.
  PartView(const kit::Part& part, const Measured& measured, std::uint32_t source,
           const Camera& camera, const Pose& T_world_camera, int margin_px);

  /// The part's triangle at a point of another part, if it has surface there: one with a similar
  /// normal and, along the normal, within twice the sensors' precision (paper 3.2) plus both parts'
  /// slack.
  std::optional<std::uint32_t> at(const SurfacePoint& point, float slack_m) const;

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
