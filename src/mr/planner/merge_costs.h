#pragma once

#include "mr/scene/scene.h"

namespace mr::planner {

/// What merging costs on a machine, per triangle; with the threads of the arena that it was
/// measured in.
struct MergeCosts {
  double decode_ns = 0;     ///< of an input
  double merge_ns = 0;      ///< of an input: overlap removal, islands, zipper
  double overlap_ns = 0;    ///< more, of an input where another one has surface, too
  double code_ns = 0;       ///< of the output
  double memory_bytes = 0;  ///< of an input, at the peak
  double coded_bytes = 0;   ///< of the output, on the wire
};

/// Measures by merging and coding four synthetic walls, apart and side by side, of about as many
/// triangles as a sensor sends (at most 20,000); takes about a second.
MergeCosts measure_merge_costs(const Scene& scene, double triangles = 10'000);

}  // namespace mr::planner
