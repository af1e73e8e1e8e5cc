#pragma once

#include <chrono>
#include <cstddef>
#include <optional>

#include "mr/simplify/parallel_sweep.h"

namespace mr::simplify {

/// Stopping criteria; the first one met counts.
struct StopCriteria {
  std::size_t triangles = 0;
  float error_m = kNever;
  std::optional<std::chrono::steady_clock::time_point> deadline{};
};

/// Collapses the cheapest vertices until the goal is met. Instead of a priority queue, works in
/// rounds: from a histogram of costs each round chooses a limit below which no more vertices lie
/// than have to go, and collapses those in one parallel sweep. So the error is uniform over the
/// mesh, whatever the threads. `spare` and `number` are scratch memory.
void reduce(const StopCriteria& goal, ParallelSweep& sweep, WorkingMesh& mesh, WorkingMesh& spare,
            std::vector<std::uint32_t>& number);

/// Moves interior vertices to the minimum of their quadrics.
void relax(ParallelSweep& sweep, WorkingMesh& mesh);

}  // namespace mr::simplify
