#pragma once

#include <span>

#include "mr/planner/coverage.h"
#include "mr/planner/cube_box.h"
#include "mr/planner/planner.h"

/// Model of the mergers' load and latency.
namespace mr::planner {

/// A merger's load, in triangles.
struct MergeLoad {
  double in = 0, shared = 0, out = 0;
};

/// The load of a merger, given the set of sensors merged by each input. Surface seen by several
/// sensors is kept once. With `region`: of a merger that owns this region.
MergeLoad load_of(const Coverage& coverage, std::span<const SensorSet> inputs,
                  const CubeBox* region = nullptr);

/// Sets a planned merger's figures from its load. `group`: the sensors below it.
void set_load(PlannedMerger& merger, const MergeLoad& load, const SensorSet& group,
              const Coverage& coverage);

/// Sums latencies over the layers: the slowest merger and link of each.
void add_latencies(Plan& plan, const Coverage& coverage, const PlanConfig& config);

/// The shortest deadline of the scene's mergers: that of a merger of sensors.
double first_deadline_ms(const Scene& scene);

/// A merger waits as long as its inputs do, and for the slowest of them.
double deadline_above_ms(std::span<const PlannedMerger* const> inputs);

}  // namespace mr::planner
