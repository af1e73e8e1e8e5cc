#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "mr/merge/overlap/occlusion_rule.h"
#include "mr/merge/overlap/overlap.h"
#include "mr/merge/overlap/ray_grids.h"

/// Shared by both implementations of the paper's rule: when two hits are one surface, and which one
/// loses.
namespace mr::merge {

/// The attributes of a triangle that decide a vote.
struct TriangleSurface {
  Vec3f normal;       ///< unit, smoothed over the neighbours
  float sigma_m = 0;  ///< precision of the sensor that measured it
  float slack_m = 0;  ///< error of calibration and decimation
  std::uint32_t part = 0;
};

/// All triangles of all parts in one numbering.
struct TriangleTable {
  std::span<const kit::Part> parts;
  std::vector<std::uint32_t> first;     ///< [parts + 1] part → its first triangle
  std::vector<TriangleSurface> facing;  ///< [T]
  float reach_m = 0;                    ///< upper bound of the distance between hits on one surface
};

TriangleTable triangle_table(std::span<const kit::Part> parts, const OverlapConfig& config);

/// Numbers of hits and lost votes, by triangle ([T]).
struct RayVotes {
  std::vector<std::uint32_t> hits, lost;
};

/// An intersection of a ray with a triangle's front face.
struct RayIntersection {
  float depth_m = 0;           ///< along the camera's z axis
  std::uint32_t triangle = 0;  ///< in the TriangleTable
  bool lost = false;
};

/// Only this many nearest intersections of a ray are compared; farther ones never lose. Only meshes
/// of slivers reach the limit.
inline constexpr std::size_t kMostIntersections = 128;

/// Whether the farther of two intersections is the same surface as the nearer one, but of another
/// part. `ray`: direction per metre of depth; `stretch2`: its squared length. Branchless, as the
/// outcome is unpredictable for noisy surfaces.
inline bool same_surface(const TriangleSurface& near, const TriangleSurface& far, float deeper_m,
                         Vec3f ray, float stretch2) {
  constexpr float kSameFacing = 0.5f;  // within 60 degrees: a thin board's back is another surface
  const float range = 2 * std::max(near.sigma_m, far.sigma_m) + near.slack_m + far.slack_m;
  return (near.part != far.part) & (dot(near.normal, far.normal) >= kSameFacing) &
         (deeper_m * std::abs(dot(near.normal, ray)) <= range) &
         (deeper_m * deeper_m * stretch2 <= 16 * range * range);
}

/// Votes on a ray's intersections, nearest first: each one that has not lost beats the first
/// intersection of every other part that is the same surface.
inline void decide(std::span<RayIntersection> all, const TriangleTable& field, Vec3f ray) {
  const float stretch2 = dot(ray, ray), reach2 = field.reach_m * field.reach_m;
  const std::size_t count = std::min(all.size(), kMostIntersections);
  std::array<std::uint32_t, kMostIntersections> parts;
  for (std::size_t i = 0; i + 1 < count; ++i) {
    if (all[i].lost) continue;
    const TriangleSurface& owner = field.facing[all[i].triangle];
    std::size_t taken = 0;
    for (std::size_t k = i + 1; k < count; ++k) {
      const float deeper = all[k].depth_m - all[i].depth_m;
      if (deeper * deeper * stretch2 > reach2) break;
      if (all[k].lost) continue;
      const TriangleSurface& other = field.facing[all[k].triangle];
      if (!same_surface(owner, other, deeper, ray, stretch2)) continue;
      if (std::find(parts.begin(), parts.begin() + taken, other.part) != parts.begin() + taken)
        continue;
      parts[taken++] = other.part;
      all[k].lost = true;
    }
  }
}

/// Directions and origin of one camera's rays, the same for both implementations.
struct RayPencil {
  Vec3f origin;               ///< world frame
  Vec3f corner, right, down;  ///< through pixel (0, 0), and from pixel to pixel

  explicit RayPencil(const RayGrid& grid)
      : origin(vec_cast<float>(grid.T_world_camera.translation)),
        corner(vec_cast<float>(grid.T_world_camera.rotation * unproject(grid.camera, {0, 0}))),
        right(vec_cast<float>(grid.T_world_camera.rotation.column(0) / grid.camera.fx)),
        down(vec_cast<float>(grid.T_world_camera.rotation.column(1) / grid.camera.fy)) {}
  Vec3f row(int y) const { return corner + down * static_cast<float>(y); }
  /// The direction through pixel (x, y) per metre of depth.
  Vec3f at(int x, int y) const { return row(y) + right * static_cast<float>(x); }
};

}  // namespace mr::merge
