#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "mr/core/result.h"
#include "mr/planner/merge_costs.h"
#include "mr/planner/sensor_sample.h"
#include "mr/scene/scene.h"

namespace mr::planner {

/// How a tree shares out the work.
enum class Split { sensors, space };

struct PlanConfig {
  int mergers = 2;               ///< below the root; 1: the root alone
  std::optional<Split> split{};  ///< nothing: what suits the scene
  double link_ms = 1;            ///< from one machine to the next, without the time for the bytes
};

/// A merger, as it is expected to work.
struct PlannedMerger {
  MergerConfig config;
  int layer = 1;  ///< 1: its inputs are sensors
  double triangles_in = 0, triangles_out = 0;
  double triangles_shared = 0;  ///< of those in: where another input has surface, too
  double latency_ms = 0;        ///< decoding, merging, coding; no labels, no pictures
  double memory_mb = 0;         ///< pictures included
};

/// All depth in one voxel grid (paper 6.5: what a centralised system does).
struct GridEstimate {
  double blocks = 0;           ///< of 8³ voxels, around surface only
  double memory_mb = 0;        ///< of these
  double dense_memory_mb = 0;  ///< of all voxels of the space that is seen, as a dense grid has
  double reconstruct_ms = 0;   ///< 0: not known
};

struct Plan {
  Split split = Split::sensors;
  std::vector<PlannedMerger> mergers;  ///< children before parents, the root last
  int layers = 1;
  double latency_ms = 0;          ///< each layer's slowest merger and link, added up
  double links_ms = 0;            ///< of these: the links
  PlannedMerger central;          ///< one merger for all sensors
  double central_latency_ms = 0;  ///< with its slowest link
  GridEstimate one_grid;
  std::string why;  ///< one line: what the split was chosen by
};

/// Proposes a tree. Sensors that see the same share a merger, so that few triangles are sent up
/// twice, and mergers have about the same to do; or each merger owns a box of the chunk grid. Of
/// several trees the one with the lowest latency is taken; where the sensors crowd one place, one
/// that splits the space is preferred. Same input, same tree. invalid: cannot be done.
Result<Plan> make_plan(const Scene& scene, std::span<const SensorSample> samples,
                       const MergeCosts& costs, const PlanConfig& config);

}  // namespace mr::planner
