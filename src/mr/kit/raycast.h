#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "mr/core/mesh.h"

namespace mr::kit {

/// The intersection of a ray with a mesh.
struct RayHit {
  float distance = 0;      ///< in units of the direction's length
  std::uint32_t mesh = 0;  ///< place in the list that the RayScene was built from
  std::uint32_t triangle = 0;
};

/// The point of a surface that lies nearest to another point.
struct NearestPoint {
  Vec3d point;
  double distance_m = 0;
  std::uint32_t mesh = 0;  ///< place in the list that the RayScene was built from
  std::uint32_t triangle = 0;
};

/// The nearest point of triangle abc, borders included; of a degenerate one, of its longest side.
Vec3d nearest_on_triangle(Vec3d p, Vec3d a, Vec3d b, Vec3d c);

/// The nearest point of the line from a to b, ends included.
Vec3d nearest_on_segment(Vec3d p, Vec3d a, Vec3d b);

/// A bounding volume hierarchy over several meshes for ray casting (Embree). Built and used inside
/// the caller's arena.
class RayScene {
 public:
  /// The meshes are copied into Embree; empty ones are allowed and keep their place.
  explicit RayScene(std::span<const Mesh* const> meshes);
  ~RayScene();
  RayScene(RayScene&&) noexcept;
  RayScene& operator=(RayScene&&) noexcept;

  /// Every hit between `near` and `far`, sorted by distance, then mesh, then triangle; both sides
  /// of a triangle count. `hits` is cleared first. Thread-safe.
  void all_hits(Vec3f origin, Vec3f direction, float near, float far,
                std::vector<RayHit>& hits) const;

  /// The nearest hit. Thread-safe.
  std::optional<RayHit> first_hit(Vec3f origin, Vec3f direction, float near, float far) const;

  /// The nearest point of any mesh, at most `within_m` away; exact: computed in doubles, of equally
  /// near triangles the first mesh's lowest. Nothing for a point that is not finite. Thread-safe.
  std::optional<NearestPoint> nearest(
      Vec3f from, float within_m = std::numeric_limits<float>::infinity()) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace mr::kit
