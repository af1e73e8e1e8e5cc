#pragma once

#include <memory>
#include <string>
#include <vector>

#include "mr/core/mesh.h"
#include "mr/kit/part.h"
#include "mr/scene/scene.h"
#include "stage.h"

namespace mr::bench {

/// The inputs of a flat merger, and a grouping of them for a tree of mergers.
struct MergeCase {
  std::string name;
  std::vector<kit::Part> parts;     ///< one per sensor; those of one group are neighbours
  std::vector<std::size_t> groups;  ///< number of parts of each merger, in order
  Mesh truth;                       ///< empty: not known; the parts' surface is used instead
  double voxel_m = 0.01;
  MergeConfig config;
  bool of_scale = false;  ///< of the scale experiment: one merger against a tree of them
};

/// room_bench at 10 %, rooms of 20 sensors, and one room with up to 400; 10,000 triangles a sensor.
std::vector<CaseInfo> merge_cases();

/// A case by name. A rig's rendered pictures are cached.
Result<MergeCase> load_merge_case(const std::string& name);

/// The first frame of a scene's sensors, decimated by the scene's settings.
Result<MergeCase> load_merge_scene(const std::filesystem::path& scene_file);

/// The four sensors of room_bench with about this many triangles each; 0: all.
Result<std::vector<kit::Part>> load_room_bench(std::size_t triangles);
/// 10 % of the triangles of marching cubes.
inline constexpr std::size_t kTrianglesOfABench = 68'700;
/// The reason why room_bench cannot be loaded here; empty: it can.
std::string no_room_bench();

/// Megabytes of all positions and triangles.
double megabytes(const std::vector<kit::Part>& parts);

}  // namespace mr::bench
