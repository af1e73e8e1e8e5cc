#pragma once

#include <span>
#include <vector>

#include "mr/core/mesh.h"
#include "mr/kit/part.h"
#include "mr/merge/merge_config.h"

namespace mr::merge {

struct OverlapConfig {
  MergeConfig::Owner owner = MergeConfig::Owner::coherent;
  MergeConfig::Overlap overlap = MergeConfig::Overlap::raster;  ///< how the paper's rays are cast
  double voxel_m = 0.01;
  double calibration_error_m = 0.005;
  bool is_piece = false;  ///< the parts are a piece of the scene: a QualityMemory learns nothing
};

class QualityMemory;  // quality_grid.h

/// Overlap removal (paper 3.2). Surfaces of different parts that face alike and lie within twice
/// the sensors' precision (plus calibration and decimation error) are one, and all but one go:
///   owner paper     the farther ones, on the rays of the depth cameras (occlusion_rule.h)
///   owner coherent  those measured less well; parts are cut at the border line, and what remains
///                   is moved to the mean of all of them (ownership.h)
/// Overlap is removed between parts, never within one. Returns the remaining mesh of each part, in
/// order; a triangle's view is the sensor that measured it.
/// `memory`: kept from frame to frame by callers that merge the same sensors again, so that noise
/// does not move coherent borders. Parallel; deterministic.
std::vector<Mesh> remove_overlap(std::span<const kit::Part> parts, const OverlapConfig& config,
                                 QualityMemory* memory = nullptr);

}  // namespace mr::merge
