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

/// How a tree divides the work.
enum class Split { sensors, space };

struct PlanConfig {
  int mergers = 2;               ///< below the root; 1: the root alone
  std::optional<Split> split{};  ///< nothing: chosen by latency
  double link_ms = 1;            ///< latency of a link, without transmission time
};

/// A merger with its expected figures.
struct PlannedMerger {
  MergerConfig config;
  int layer = 1;  ///< 1: its inputs are sensors
  double triangles_in = 0, triangles_out = 0;
  double triangles_shared = 0;  ///< of triangles_in: where inputs overlap
  double latency_ms = 0;        ///< decoding, merging, encoding; without labels and textures
  double memory_mb = 0;         ///< including pictures
};

/// A centralised system (paper 6.5): all depth in one voxel grid.
struct GridEstimate {
  double blocks = 0;           ///< of 8³ voxels, around surface only
  double memory_mb = 0;        ///< of these
  double dense_memory_mb = 0;  ///< of a dense grid over all observed space
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
  std::string why;  ///< the reason for the choice of split, one line
};

/// Proposes a tree. Either sensors with overlapping views share a merger, so that little surface is
/// sent twice, and mergers have balanced loads; or each merger owns a box of the chunk grid.
/// Chooses the tree with the lowest latency, but prefers one that splits space if the sensors are
/// crowded. Deterministic. invalid: cannot be done.
Result<Plan> make_plan(const Scene& scene, std::span<const SensorSample> samples,
                       const MergeCosts& costs, const PlanConfig& config);

}  // namespace mr::planner
