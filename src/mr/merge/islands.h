#pragma once

#include "mr/core/mesh.h"

namespace mr::merge {

/// Removes connected components smaller than `min_area_m2` (paper 3.2: floating remains of overlap
/// removal and of noisy depth). Views are kept.
Mesh remove_islands(const Mesh& mesh, double min_area_m2);

/// The paper's threshold, "double the reconstruction resolution", compares an area with a length.
/// Our reading: a component must be worth a square of twice the resolution times five, 20 cm² at 1
/// cm voxels; smaller ones are never furniture and nearly always noise.
double island_area_m2(double voxel_m);

}  // namespace mr::merge
