#pragma once

#include <chrono>
#include <cstddef>
#include <optional>

#include "mr/simplify/parallel_sweep.h"

namespace mr::simplify {

/// When to stop.
struct StopCriteria {
  std::size_t triangles = 0;
  float error_m = kNever;
  std::optional<std::chrono::steady_clock::time_point> deadline{};
};

/// Collapses what costs least until the goal is met, in rounds: each has a limit, chosen so that no
/// more vertices lie below it than have to go, and takes them in one sweep. So the whole mesh errs
/// alike, whoever works where. `spare` and `number` are room to work in.
void reduce(const StopCriteria& goal, ParallelSweep& sweep, WorkingMesh& mesh, WorkingMesh& spare,
            std::vector<std::uint32_t>& number);

/// Moves inner vertices to where their error is least.
void relax(ParallelSweep& sweep, WorkingMesh& mesh);

}  // namespace mr::simplify
