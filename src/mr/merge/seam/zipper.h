#pragma once

#include <span>

#include "mr/core/mesh.h"

namespace mr::merge {

struct ZipperConfig {
  double max_gap_m = 0.025;  ///< wider gaps stay open; 0: all do
  double edge_m = 0.025;  ///< border edges near another part are split to about this length first
};

/// The config for a voxel size. The paper's radius, "the square root of the resolution", depends on
/// the unit of length; ours is two and a half voxels, as most strips across wider gaps are wrong
/// (docs/merging.md).
inline ZipperConfig zipper_config(double voxel_m) { return {2.5 * voxel_m, 2.5 * voxel_m}; }

/// Zippers parts without overlap into one surface (paper 3.2, after Turk and Levoy 1994). Borders
/// within `max_gap_m` with similar normals are found by nearest-neighbour search. The strip between
/// them is triangulated by an advancing front, shortest connections first: each new triangle
/// connects a border edge with a vertex of the opposite border, lies in the gap and not over
/// existing surface, and gives no edge a third triangle. Small remaining loops are closed. No
/// vertex moves. Triangles keep their views; new ones take those of their neighbours.
/// Deterministic.
Mesh zip(std::span<const Mesh> parts, const ZipperConfig& config);

}  // namespace mr::merge
