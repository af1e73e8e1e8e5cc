#pragma once

#include <span>

#include "mr/core/mesh.h"

namespace mr::merge {

struct ZipperConfig {
  double max_gap_m = 0.025;  ///< borders farther apart are not joined; 0: none are
  double edge_m = 0.025;     ///< border edges near another part are cut to about this length first
};

/// What suits a reconstruction of this resolution. The paper's radius, "the square root of the
/// resolution", depends on the unit of length; ours is two and a half voxels: wider strips are
/// right less often than not (docs/merging.md).
inline ZipperConfig zipper_config(double voxel_m) { return {2.5 * voxel_m, 2.5 * voxel_m}; }

/// Joins parts without overlap into one surface (paper 3.2, after Turk & Levoy 1994). Borders that
/// lie within `max_gap_m` and face alike are found by nearest-neighbour search and the strip
/// between them is triangulated, shortest connections first, as an advancing front: every new
/// triangle grows from a border edge to a vertex on the opposite border, into the gap and never
/// over existing surface, and no edge gets a third triangle. Small remaining loops are closed. No
/// vertex moves. Views are kept; strips take those beside them. Deterministic.
Mesh zip(std::span<const Mesh> parts, const ZipperConfig& config);

}  // namespace mr::merge
