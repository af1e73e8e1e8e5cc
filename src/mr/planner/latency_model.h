#pragma once

#include <span>

#include "mr/planner/coverage.h"
#include "mr/planner/cube_box.h"
#include "mr/planner/planner.h"

/// What mergers have to do, and how long that takes.
namespace mr::planner {

/// What a merger has to do, in triangles.
struct MergeLoad {
  double in = 0, shared = 0, out = 0;
};

/// Of a merger whose inputs have merged these sensors each. Where several sensors see a spot, one
/// of them stays. With `region`: of a merger that owns it.
MergeLoad load_of(const Coverage& coverage, std::span<const SensorSet> inputs,
                  const CubeBox* region = nullptr);

/// Puts in what a merger's load means. `group`: the sensors below it.
void set_load(PlannedMerger& merger, const MergeLoad& load, const SensorSet& group,
              const Coverage& coverage);

/// Adds up the layers: each is as slow as its slowest merger and link.
void add_latencies(Plan& plan, const Coverage& coverage, const PlanConfig& config);

/// The shortest deadline of the scene's mergers: that of a merger of sensors.
double first_deadline_ms(const Scene& scene);

/// A merger waits as long as its inputs do, and for the slowest of them.
double deadline_above_ms(std::span<const PlannedMerger* const> inputs);

}  // namespace mr::planner
