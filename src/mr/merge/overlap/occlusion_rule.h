#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "mr/kit/part.h"
#include "mr/merge/overlap/overlap.h"

namespace mr::merge {

/// The paper's overlap removal (3.2), by occlusion: of surfaces that are one, the nearest to the
/// camera stays, and what it occludes goes. Rays go from every depth camera through its pixels (of
/// a LiDAR or an equirectangular camera through the faces of a cube, see camera_rays()) and meet
/// the fronts of all triangles; hits of different parts that face the camera alike and lie within
/// twice the sensors' precision (plus calibration and decimation error) are one surface, of which
/// the nearest hit wins on that ray. A triangle goes as a whole, when it lost on more than half of
/// the rays that hit it; nothing is cut, and what no ray hits stays. Only cameras whose frustum
/// holds several parts are looked through. `config.overlap` says how hits are found: `rays` casts
/// them at the meshes (Embree; the reference), `raster` draws layered depth images; both decide
/// alike. Returns, for each part, 1 for every triangle that goes. Parallel; deterministic.
std::vector<std::vector<std::uint8_t>> farther_triangles(std::span<const kit::Part> parts,
                                                         const OverlapConfig& config);

/// A triangle that a ray met, counted through all parts, and what became of it there.
struct RayVerdict {
  std::uint32_t triangle = 0;
  bool lost = false;

  friend bool operator==(const RayVerdict&, const RayVerdict&) = default;
};

/// What the rays of one camera, or of one face of its cube, decided.
struct RayVerdicts {
  int width = 0, height = 0;
  std::vector<std::uint32_t> first;  ///< [width · height + 1] pixel → its first verdict
  std::vector<RayVerdict> verdicts;  ///< pixel by pixel, by triangle

  std::span<const RayVerdict> at(std::size_t pixel) const {
    return {verdicts.data() + first[pixel], verdicts.data() + first[pixel + 1]};
  }
};

/// The decisions behind farther_triangles(), ray by ray, for comparing the ways to find hits: one
/// element for every camera (or face) that was looked through, in order.
std::vector<RayVerdicts> ray_verdicts(std::span<const kit::Part> parts,
                                      const OverlapConfig& config);

}  // namespace mr::merge
