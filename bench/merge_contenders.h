#pragma once

#include <span>

#include "merge_case.h"
#include "mr/merge/overlap/overlap.h"
#include "race.h"

namespace mr::bench {

/// Parts in memory to one surface, as MergeNode does it up to there. Laps: overlap, zipper,
/// islands.
Mesh merge_parts(std::span<const kit::Part> parts, const merge::OverlapConfig& config,
                 StageClock& clock);

/// What MergeNode gives to overlap removal.
merge::OverlapConfig overlap_config(const MergeCase& input);

/// merge_parts() with some of a case's parts, which must outlive it.
Contender merge_ours(const std::string& name, std::span<const kit::Part> parts,
                     const merge::OverlapConfig& config, int threads);

/// What the paper looked at and rejected (3.2): all vertices of a cell of twice the voxel's size
/// become one, their mean; triangles that lose a corner, and doubled ones, go. One thread.
Mesh cluster_vertices(std::span<const kit::Part> parts, double cell_m);
Contender merge_clustering(const MergeCase& input);

}  // namespace mr::bench
