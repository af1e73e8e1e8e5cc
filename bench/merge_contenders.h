#pragma once

#include <span>

#include "merge_case.h"
#include "mr/merge/overlap/overlap.h"
#include "race.h"

namespace mr::bench {

/// Merges parts into one surface, as MergeNode does. Laps: overlap, zipper, islands.
Mesh merge_parts(std::span<const kit::Part> parts, const merge::OverlapConfig& config,
                 StageClock& clock);

/// The configuration that MergeNode passes to overlap removal.
merge::OverlapConfig overlap_config(const MergeCase& input);

/// merge_parts() with some of a case's parts, which must outlive it.
Contender merge_ours(const std::string& name, std::span<const kit::Part> parts,
                     const merge::OverlapConfig& config, int threads);

/// Vertex clustering, which the paper (3.2) considered and rejected: all vertices in a cell of
/// twice the voxel size are replaced by their mean; degenerate and duplicate triangles are removed.
/// One thread.
Mesh cluster_vertices(std::span<const kit::Part> parts, double cell_m);
Contender merge_clustering(const MergeCase& input);

}  // namespace mr::bench
