#include "mr/node/cube_merger.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>

#include "mr/merge/merge_surfaces.h"
#include "mr/merge/overlap/quality_grid.h"
#include "mr/node/chunk_grid.h"
#include "support/meshes.h"
#include "support/rays.h"

namespace mr {
namespace {

constexpr double kVoxel_m = 0.01, kChunk_m = 0.64;

/// A wall of 12 m by 2 m at z = 2, in chunks, as one sensor sees it.
DecodedScene wall(std::uint32_t sensor, float z, int cells, unsigned seed) {
  const Mesh mesh = test::grid({-6, 1, z}, {12, 0, 0}, {0, -2, 0}, 6 * cells, cells, 0.001f, seed);
  DecodedScene out;
  SourceInfo source =
      test::source(sensor, look_at({sensor == 0 ? -3.0 : 3.0, 0, -4}, {0, 0, 2}, {0, -1, 0}));
  out.sources = {source};
  for (auto& [cube, piece] : node::split_by_cube(mesh, kChunk_m))
    out.chunks.push_back(
        std::make_shared<const Chunk>(Chunk{{{cube, SensorId{sensor}}, 0, 1}, 0.001f, piece}));
  return out;
}

/// The same with a dent of some millimetres in one chunk.
DecodedScene dented(DecodedScene scene, Vec3f at) {
  for (auto& chunk : scene.chunks) {
    if (chunk->key.id.cube != node::cube_of(vec_cast<double>(at), kChunk_m)) continue;
    Chunk changed = *chunk;
    ++changed.key.version;
    for (Vec3f& p : changed.mesh.positions) p.z += 0.004f * std::max(0.0f, 1 - 8 * length(p - at));
    chunk = std::make_shared<const Chunk>(std::move(changed));
  }
  return scene;
}

struct Merger {
  Mesh run(const std::vector<DecodedScene>& scenes) {
    const auto correct = [&](std::vector<kit::Part>& parts) {
      for (kit::Part& part : parts)
        for (Vec3f& p : part.mesh.positions) p.z += corrected_m * p.x;
    };
    std::vector<kit::Part> parts = node::parts_of(scenes);
    correct(parts);
    return cubes.run(scenes, parts, correct, [&](const std::vector<kit::Part>& some, bool all) {
      all_calls += all, some_calls += !all;
      return merge::merge_surfaces(
          some, merge::surfaces_config({.voxel_m = kVoxel_m, .is_piece = !all}), &memory);
    });
  }
  node::CubeMerger cubes{kChunk_m, 48 * kVoxel_m};
  merge::QualityMemory memory;
  float corrected_m = 0;  ///< per metre to the right
  int all_calls = 0, some_calls = 0;
};

std::vector<std::array<Vec3f, 3>> triangles_of(const Mesh& mesh) {
  std::vector<std::array<Vec3f, 3>> out;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    out.push_back({mesh.corner(t, 0), mesh.corner(t, 1), mesh.corner(t, 2)});
    auto& corners = out.back();  // not ranges::rotate: clang 14 cannot read g++ 12's views
    std::rotate(corners.begin(), std::ranges::min_element(corners), corners.end());
  }
  std::ranges::sort(out);
  return out;
}

TEST(CubeMerger, MergesOnlyAroundWhatChanged) {
  const std::vector<DecodedScene> before = {wall(0, 2, 40, 1), wall(1, 2.003f, 37, 2)};
  const std::vector<DecodedScene> after = {dented(before[0], {-4.1f, 0.2f, 2}), before[1]};
  for (const float corrected_m : {0.0f, 0.005f}) {
    Merger merger, other;
    merger.corrected_m = other.corrected_m = corrected_m;
    merger.run(before);
    const Mesh mended = merger.run(after);
    EXPECT_EQ(merger.all_calls, 1);
    EXPECT_EQ(merger.some_calls, 1);
    EXPECT_GT(merger.cubes.cubes(), 50u);
    EXPECT_LT(merger.cubes.merged_cubes(), merger.cubes.cubes() / 3);
    EXPECT_GT(merger.cubes.merged_cubes(), 0u);

    const Mesh whole = other.run(after);  // who sees it for the first time merges all
    EXPECT_EQ(triangles_of(mended), triangles_of(whole));
  }
}

TEST(CubeMerger, NothingNewIsNotMergedAgain) {
  const std::vector<DecodedScene> scenes = {wall(0, 2, 40, 1), wall(1, 2.003f, 37, 2)};
  Merger merger;
  const Mesh first = merger.run(scenes), second = merger.run(scenes);
  EXPECT_EQ(merger.cubes.merged_cubes(), 0u);
  EXPECT_EQ(triangles_of(first), triangles_of(second));
}

TEST(CubeMerger, WhatIsNewInHalfOfTheSceneOrFromAnotherPlaceIsMergedWhole) {
  std::vector<DecodedScene> scenes = {wall(0, 2, 40, 1), wall(1, 2.003f, 37, 2)};
  Merger merger;
  merger.run(scenes);
  scenes[0] = wall(0, 2, 40, 3);  // every chunk
  merger.run(scenes);
  EXPECT_EQ(merger.all_calls, 2);
  scenes[1].sources[0].T_world_depth.translation.x += 0.001;  // the sensor moved
  merger.run(scenes);
  EXPECT_EQ(merger.all_calls, 3);
  scenes.pop_back();
  merger.run(scenes);
  EXPECT_EQ(merger.all_calls, 4);
  merger.cubes.forget();
  merger.run(scenes);
  EXPECT_EQ(merger.all_calls, 5);
}

TEST(PartOf, ViewsThatAnInputNamesAreDropped) {
  Chunk chunk;
  chunk.mesh = test::grid({0, 0, 1}, {1, 0, 0}, {0, 1, 0}, 4, 4);
  set_view(chunk.mesh, ViewId{3});
  DecodedScene scene;
  scene.sources.resize(2);
  scene.chunks = {std::make_shared<const Chunk>(chunk)};
  const kit::Part part = node::part_of(scene, [](Vec3i) { return true; });
  EXPECT_EQ(part.mesh.triangles.size(), chunk.mesh.triangles.size());
  EXPECT_TRUE(part.mesh.views.empty());
}

}  // namespace
}  // namespace mr
