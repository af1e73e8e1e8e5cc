#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "mr/merge/overlap.h"
#include "mr/merge/part.h"

namespace mr::merge {

/// The paper's overlap removal (3.2): rays go from every depth camera through its pixels; hits of
/// different parts that face the camera alike and lie within twice the sensors' precision (plus
/// calibration and decimation error) are one surface, of which the nearest hit wins on that ray. A
/// triangle goes when it lost on the majority of the rays that hit it. Only cameras whose frustum
/// holds several parts are looked through. `config.overlap` says how hits are found: `rays` casts
/// them at the meshes (Embree; the reference), `raster` draws layered depth images; both decide
/// alike. Returns, for each part, 1 for every triangle that goes. Parallel; deterministic.
std::vector<std::vector<std::uint8_t>> farther_triangles(std::span<const Part> parts,
                                                         const OverlapConfig& config);

}  // namespace mr::merge
