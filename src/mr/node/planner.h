#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "mr/core/image.h"
#include "mr/core/pose.h"
#include "mr/core/result.h"
#include "mr/core/vec.h"
#include "mr/scene/scene.h"

namespace mr::node {

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

/// What is known about a sensor before the scene runs.
struct Sight {
  double triangles = 10'000;   ///< that it sends each frame
  double area_m2 = 0;          ///< of its surface; 0: follows from the triangles
  double reconstruct_ms = 0;   ///< of its depth, on this machine; 0: not known
  std::vector<Vec3f> surface;  ///< points of it; where it was not looked at: its frustum counts
  ImageDepth depth;            ///< its undistorted picture; empty: not looked at
  std::optional<Pose> T_world_depth;  ///< when the picture was taken
};

struct LookConfig {
  int most_sensors = 32;  ///< of scenes with more sensors, only kSamples are looked at
  static constexpr int kSamples = 8;
  std::function<void(std::size_t done, std::size_t of)> progress{};
  std::function<void(const std::string&)> notice{};  ///< one line each
};

/// One frame of each sensor, reconstructed as its node would. In a scene of too many sensors only
/// some are looked at: all get the mean of their triangles, and their frusta count. A sensor whose
/// frame cannot be had keeps the default. The scene must be prepared (prepare_scene).
std::vector<Sight> look_at_sensors(const Scene& scene, const std::filesystem::path& rig_cache,
                                   const LookConfig& config);

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
struct OneGrid {
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
  OneGrid one_grid;
  std::string why;  ///< one line: what the split was chosen by
};

/// Proposes a tree. Sensors that see the same share a merger, so that few triangles are sent up
/// twice, and mergers have about the same to do; or each merger owns a box of the chunk grid. Of
/// several trees the one with the lowest latency is taken; where the sensors crowd one place, one
/// that splits the space is preferred. Same input, same tree. invalid: cannot be done.
Result<Plan> make_plan(const Scene& scene, std::span<const Sight> sights, const MergeCosts& costs,
                       const PlanConfig& config);

/// The `mergers` block of a scene file.
std::string mergers_block(const Plan& plan);

/// A scene file's text with another `mergers` block, at the end where it had none.
std::string with_mergers(std::string_view scene_text, const std::string& block);

}  // namespace mr::node
