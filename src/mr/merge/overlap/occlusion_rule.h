#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "mr/kit/part.h"
#include "mr/merge/overlap/overlap.h"

namespace mr::merge {

/// The paper's overlap removal (3.2) by occlusion: of layers that are the same surface, the one
/// nearest to the camera stays and those that it occludes are removed. Rays from every depth camera
/// through its pixels (LiDAR and equirectangular: through the faces of a cube, see camera_rays())
/// are intersected with the front faces of all triangles. Hits of different parts that have similar
/// normals and lie within twice the sensors' precision (plus calibration and decimation error) are
/// one surface, of which the nearest hit wins on that ray. A triangle is removed as a whole if it
/// lost on more than half of the rays that hit it; nothing is cut, and triangles without hits stay.
/// Cameras whose frustum contains only one part are skipped. `config.overlap`: `rays` casts rays at
/// the meshes (Embree; the reference), `raster` rasterizes layered depth images (A-buffer); both
/// give the same result. Returns for each part [T], 1: remove. Parallel; deterministic.
std::vector<std::vector<std::uint8_t>> farther_triangles(std::span<const kit::Part> parts,
                                                         const OverlapConfig& config);

/// A triangle hit by a ray (numbered through all parts), and whether it lost there.
struct RayVerdict {
  std::uint32_t triangle = 0;
  bool lost = false;

  friend bool operator==(const RayVerdict&, const RayVerdict&) = default;
};

/// The votes of all rays of one camera, or of one face of its cube.
struct RayVerdicts {
  int width = 0, height = 0;
  std::vector<std::uint32_t> first;  ///< [width · height + 1] pixel → its first verdict
  std::vector<RayVerdict> verdicts;  ///< pixel by pixel, by triangle

  std::span<const RayVerdict> at(std::size_t pixel) const {
    return {verdicts.data() + first[pixel], verdicts.data() + first[pixel + 1]};
  }
};

/// The votes behind farther_triangles(), ray by ray, to compare the two implementations: one
/// element for every camera (or face) that was used, in order.
std::vector<RayVerdicts> ray_verdicts(std::span<const kit::Part> parts,
                                      const OverlapConfig& config);

}  // namespace mr::merge
