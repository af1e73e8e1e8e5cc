#pragma once

#include <span>
#include <vector>

#include "mr/core/mesh.h"
#include "mr/core/scene.h"
#include "mr/merge/part.h"

namespace mr::merge {

struct OverlapConfig {
  MergeConfig::Owner owner = MergeConfig::Owner::coherent;
  MergeConfig::Overlap overlap = MergeConfig::Overlap::raster;  ///< how hits are found
  double voxel_m = 0.01;  ///< triangles on the border of an overlap are cut to about this scale
  double calibration_error_m = 0.005;
  double island_area_m2 = 0.002;  ///< smaller pieces that would be left over are given up
};

/// Overlap removal (paper 3.2). Rays go from every depth camera through its pixels (from a LiDAR
/// evenly into its field) and meet all parts; hits of different parts that face the camera alike
/// and lie within twice the sensors' precision (plus calibration and decimation error) are one
/// surface, and all but one of its triangles go:
///   owner paper     the farther ones from that camera
///   owner coherent  those whose own sensor measured the spot less precisely: sigma(z) / cos(angle)
/// Overlap is decided between parts, never inside one. Triangles that lie in an overlap only partly
/// are cut until the border is about two voxels fine; what is left keeps its vertices. Where
/// everything would go, the best stays: removal makes no holes, only narrow gaps that zip() closes.
/// Returns what stays of each part, in order, without views. Parallel; deterministic.
std::vector<Mesh> remove_overlap(std::span<const Part> parts, const OverlapConfig& config);

}  // namespace mr::merge
