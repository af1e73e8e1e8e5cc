#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "mr/core/camera.h"
#include "mr/core/mesh.h"
#include "mr/core/packet.h"
#include "mr/core/pose.h"
#include "mr/merge/overlap/measured.h"

namespace mr::merge {

/// A region of a part: triangles that lie in triangles of the part.
struct Region {
  const Mesh& mesh;
  std::span<const std::uint32_t> parent;  ///< [T] triangle of the part
};

/// An ID buffer: the nearest triangle of a part's region in every pixel of one of the part's
/// cameras.
class PartView {
 public:
  /// Rasterizes the triangles that face `camera`, an undistorted pinhole at the pose of `source`,
  /// and that this source measured. Surface up to `margin_px` outside its picture is included, as
  /// poses and labels may be slightly off. `feather_m`: how far from a border meetings count less.
  /// `measured`, of the part, and the region must outlive the view.
  PartView(const kit::Part& part, const Measured& measured, const Region& region,
           std::uint32_t source, const Camera& camera, const Pose& T_world_camera, int margin_px,
           double feather_m);

  /// Whether the region has surface at a point of another part, to a pixel: a triangle with a
  /// similar normal and, along the normal, within twice the sensors' precision (paper 3.2) plus
  /// both parts' slack.
  bool has(const SurfacePoint& point, float slack_m) const;
  /// The same, but its border is exact: at most `aside_m` from the point. A pixel is long on a
  /// surface that is seen at a flat angle.
  bool reaches(const SurfacePoint& point, float slack_m, float aside_m) const;

  /// Where the surface lies, if the region has any at a point.
  struct Meeting {
    float along_m = 0;  ///< from the point along its normal
    float weight = 0;   ///< inverse variance; falls towards borders, and the largest distance
  };
  Meeting meeting(const SurfacePoint& point, float slack_m) const;  ///< weight 0: none
  /// The weight of the part itself at one of its points; 0: the camera sees something else there.
  float own_weight(const SurfacePoint& point) const;

 private:
  /// A point as the camera sees it.
  struct Seen {
    int x = 0, y = 0;  ///< pixel, from left_ and top_
    float z = 0;       ///< depth; 0: outside the picture
    Vec3f ray;         ///< from the camera to it
  };

  Seen seen(const SurfacePoint& point) const;
  std::uint32_t triangle(int x, int y) const;
  int inner(const Seen& at) const;
  float weight(const Seen& at, std::uint32_t triangle) const;
  float range_m(std::uint32_t triangle, const Seen& seen, const SurfacePoint& point,
                float slack_m) const;
  bool is_alike(std::uint32_t triangle, const Seen& seen, const SurfacePoint& point, float slack_m,
                float times) const;
  Vec3f nearest_on(std::uint32_t triangle, const SurfacePoint& point) const;
  void find_inner(const std::vector<float>& inv_z);
  void widen();

  const Measured* measured_;
  Region region_;
  int left_ = 0, top_ = 0, width_ = 0, height_ = 0;  ///< of what is drawn, in the picture
  Vec3f origin_, right_, down_,
      forward_;  ///< rows of the projection: pixel = right · p / forward · p
  float focal_px_ = 0;
  Precision precision_;
  float feather_m_;
  std::vector<std::uint32_t> triangle_;  ///< [width · height] of the region; kit::kNoTriangle: none
  std::vector<std::uint8_t> inner_;  ///< [width · height] pixels to the next border, or kMostInner
};

}  // namespace mr::merge
