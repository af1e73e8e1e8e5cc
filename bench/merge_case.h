#pragma once

#include <memory>
#include <string>
#include <vector>

#include "mr/core/mesh.h"
#include "mr/kit/part.h"
#include "mr/scene/scene.h"
#include "stage.h"

namespace mr::bench {

/// What the root of a tree gets when nothing else merges, and how the tree may be.
struct MergeCase {
  std::string name;
  std::vector<kit::Part> parts;     ///< one per sensor; those of one group are neighbours
  std::vector<std::size_t> groups;  ///< how many each of several mergers gets, in order
  Mesh truth;                       ///< empty: not known; what the parts show is compared with
  double voxel_m = 0.01;
  MergeConfig config;
  bool of_scale = false;  ///< of the scale experiment: one merger against a tree of them
};

/// room_bench at 10 %, rooms of 20 sensors, and one room with up to 400; 10,000 triangles a sensor.
std::vector<CaseInfo> merge_cases();

/// A case by name. What a rig has rendered is kept in its cache.
Result<MergeCase> load_merge_case(const std::string& name);

/// The first frame of a scene's sensors, decimated as the scene says.
Result<MergeCase> load_merge_scene(const std::filesystem::path& scene_file);

/// The four sensors of room_bench with about so many triangles each; 0: with all.
Result<std::vector<kit::Part>> load_room_bench(std::size_t triangles);
/// 10 % of what marching cubes gives.
inline constexpr std::size_t kTrianglesOfABench = 68'700;
/// Why they cannot be loaded here; empty: they can.
std::string no_room_bench();

/// Megabytes of all positions and triangles.
double megabytes(const std::vector<kit::Part>& parts);

}  // namespace mr::bench
