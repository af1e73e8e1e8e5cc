#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "mr/core/mesh.h"

namespace mr::kit {

/// Where a ray meets a mesh.
struct RayHit {
  float distance = 0;      ///< in units of the direction's length
  std::uint32_t mesh = 0;  ///< place in the list that the RayScene was built from
  std::uint32_t triangle = 0;
};

/// Several meshes to cast rays at (Embree). Built and cast inside the caller's arena.
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

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace mr::kit
