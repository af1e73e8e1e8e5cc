#include "mr/fusion/fuse.h"

#include <gtest/gtest.h>

#include <random>

#include "mr/core/parallel.h"
#include "mr/fusion/marching_cubes.h"
#include "mr/fusion/smooth_depth.h"
#include "mr/kit/topology.h"
#include "support/meshes.h"
#include "support/rays.h"

namespace mr {
namespace {

using fusion::VolumeConfig;

fusion::FusionConfig decomposition(fusion::Decomposition d, int m = 3, int n = 2) {
  fusion::FusionConfig f;
  f.decomposition = d, f.patches_x = m, f.patches_y = n;
  return f;
}

/// Rotated against the voxel grid, as a real camera is.
Pose tilted() { return look_at({0.13, -0.21, 0.07}, {0.5, 0.3, 2}, {0.1, -1, 0}); }

Mesh fuse_frame(const fusion::DepthFrame& frame, VolumeConfig volume = {}) {
  volume.history = fusion::History::none;
  return fusion::FrameFuser(volume).fuse(frame).mesh;
}

Mesh fuse(const Mesh& scene, const Pose& pose, const fusion::FusionConfig& f = {},
          const VolumeConfig& volume = {}) {
  const ImageDepth depth = test::render_depth(scene, test::small_camera(), pose);
  Mesh all;
  for (const Rect& patch : fusion::patches(depth.width, depth.height, f))
    append(all, fuse_frame({depth, test::small_camera(), pose, patch, {}}, volume));
  return all;
}

template <typename Predicate>
double area_where(const Mesh& mesh, Predicate&& chosen) {
  double twice = 0;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    if (chosen(t)) twice += length(mesh.area_normal(t));
  return twice / 2;
}

Mesh wall() { return test::grid({-4, 4, 2.5f}, {8, 0, 0.7f}, {0, -8, 0.4f}, 1, 1); }

TEST(Fusion, WallLiesWhereItIsAndFacesTheCamera) {
  const Mesh mesh = fuse(wall(), tilted());
  ASSERT_GT(mesh.triangles.size(), 20000u);
  const Mesh truth = wall();
  const Vec3f n = normalized(truth.area_normal(0));
  double sum = 0;
  for (const Vec3f p : mesh.positions) sum += std::pow(dot(n, p - truth.positions[0]), 2);
  EXPECT_LT(std::sqrt(sum / static_cast<double>(mesh.positions.size())),
            0.0025);  // pixels are 2 cm apart there
  const Vec3f eye = vec_cast<float>(tilted().translation);
  EXPECT_LT(area_where(mesh,
                       [&](std::size_t t) {
                         return dot(mesh.area_normal(t), mesh.centroid(t) - eye) > 0;
                       }),
            2e-3 * surface_area_m2(mesh));
}

TEST(Fusion, SphereIsRoundAndManifold) {
  const Mesh mesh = fuse(test::sphere({0.4f, 0.3f, 1.6f}, 0.4f, 100), tilted());
  ASSERT_GT(mesh.triangles.size(), 5000u);
  EXPECT_EQ(kit::count_nonmanifold_edges(mesh), 0u);
  double worst = 0;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const Vec3f outward = mesh.centroid(t) - Vec3f{0.4f, 0.3f, 1.6f};
    worst = std::max<double>(worst, std::abs(length(outward) - 0.4f));
  }
  EXPECT_LT(
      area_where(mesh,
                 [&](std::size_t t) {
                   return dot(mesh.area_normal(t), mesh.centroid(t) - Vec3f{0.4f, 0.3f, 1.6f}) < 0;
                 }),
      1e-3 * surface_area_m2(mesh));
  EXPECT_LT(worst, 0.015);
}

TEST(Fusion, NoBridgeAcrossADepthDiscontinuity) {
  Mesh scene = wall();
  append(scene, test::box({0.1f, 0, 1.0f}, {0.5f, 0.4f, 1.1f}));
  const Mesh mesh = fuse(scene, tilted());
  const Vec3f n = normalized(wall().area_normal(0));
  int between = 0;
  for (const Vec3f p : mesh.positions) {
    const float from_wall = std::abs(dot(n, p - wall().positions[0]));
    const bool at_box =
        p.x > 0.07f && p.x < 0.53f && p.y > -0.03f && p.y < 0.43f && p.z > 0.97f && p.z < 1.13f;
    between += from_wall > 0.03f && !at_box;
  }
  EXPECT_LE(between, 5);
}

TEST(Fusion, ThinBoardKeepsItsTwoSidesApart) {
  // 3 cm thick, seen from both sides in turn: each side one sheet, in its place.
  const Mesh board = test::box({-0.3f, -0.3f, 1.5f}, {0.3f, 0.3f, 1.53f});
  const Mesh front = fuse(board, look_at({0.05, 0.02, 0}, {0, 0, 1.5}, {0.02, -1, 0}));
  const Mesh back = fuse(board, look_at({0.05, 0.02, 3}, {0, 0, 1.5}, {0.02, -1, 0}));
  for (const Vec3f p : front.positions) EXPECT_NEAR(p.z, 1.5f, 0.012f);
  for (const Vec3f p : back.positions) EXPECT_NEAR(p.z, 1.53f, 0.012f);
}

TEST(Fusion, SecondFrameIsAveragedIn) {
  fusion::VoxelVolume volume({});
  const Camera camera = test::small_camera();
  for (const float z : {1.50f, 1.52f})
    volume.integrate({ImageDepth(camera.width, camera.height, z),
                      camera,
                      Pose{},
                      {0, 0, camera.width, camera.height},
                      {}});
  const Mesh mesh = fusion::extract_surface(volume);
  ASSERT_FALSE(mesh.empty());
  for (const Vec3f p : mesh.positions) EXPECT_NEAR(p.z, 1.51f, 0.002f);
}

TEST(Fusion, SameBytesOnAnyNumberOfThreads) {
  Mesh scene = wall();
  append(scene, test::sphere({0.4f, 0.3f, 1.4f}, 0.3f, 40));
  for (const fusion::Decomposition d :
       {fusion::Decomposition::chunks, fusion::Decomposition::patches}) {
    std::vector<Mesh> results;
    for (const int threads : {1, 2, 8}) {
      Arena arena(threads);
      arena.run([&] { results.push_back(fuse(scene, tilted(), decomposition(d))); });
    }
    EXPECT_EQ(results[0], results[1]);
    EXPECT_EQ(results[0], results[2]);
  }
}

TEST(Fusion, PatchesAreIndependentAndCoverNearlyEverything) {
  const Mesh whole = fuse(wall(), tilted());
  const ImageDepth depth = test::render_depth(wall(), test::small_camera(), tilted());
  const auto patches =
      fusion::patches(depth.width, depth.height, decomposition(fusion::Decomposition::patches));
  ASSERT_EQ(patches.size(), 6u);
  double area = 0;
  for (const Rect& patch : patches) {
    const Mesh mesh = fuse_frame({depth, test::small_camera(), tilted(), patch, {}});
    EXPECT_FALSE(mesh.empty());
    area += surface_area_m2(mesh);
  }
  EXPECT_LT(area, surface_area_m2(whole));
  EXPECT_GT(area, 0.93 * surface_area_m2(whole));
}

TEST(Fusion, SurfaceOutsideTheVolumeIsDropped) {
  VolumeConfig volume;
  volume.bounds = Box3d{{-10, -10, -10}, {0.2, 10, 10}};
  const Mesh mesh = fuse(wall(), tilted(), {}, volume);
  ASSERT_FALSE(mesh.empty());
  for (const Vec3f p : mesh.positions) EXPECT_LT(p.x, 0.2f + 0.03f);  // a pixel and a voxel
}

TEST(Fusion, SmoothingTakesNoiseNotEdges) {
  const Camera camera = test::small_camera();
  ImageDepth depth(camera.width, camera.height);
  std::mt19937 random(7);
  const Precision precision{0.002, 0.0};
  const auto truth = [](int x) { return x < 80 ? 1.0f : 1.5f; };
  for (int y = 0; y < depth.height; ++y)
    for (int x = 0; x < depth.width; ++x)
      *depth.at(x, y) =
          y == 3 ? 0 : truth(x) + 0.004f * (static_cast<float>(random()) / 2147483648.0f - 1.0f);
  const ImageDepth smooth = fusion::smooth_depth(depth, precision);
  double before = 0, after = 0;
  for (int y = 0; y < depth.height; ++y)
    for (int x = 0; x < depth.width; ++x) {
      if (y == 3) {
        EXPECT_EQ(*smooth.at(x, y), 0);
        continue;
      }
      EXPECT_NEAR(*smooth.at(x, y), truth(x), 0.004f);
      before += std::pow(*depth.at(x, y) - truth(x), 2),
          after += std::pow(*smooth.at(x, y) - truth(x), 2);
    }
  EXPECT_LT(after, before / 4);
}

TEST(Fusion, NoDepthNoSurface) {
  const Camera camera = test::small_camera();
  const ImageDepth nothing(camera.width, camera.height);
  const Rect all{0, 0, camera.width, camera.height};
  EXPECT_TRUE(fuse_frame({nothing, camera, Pose{}, all, {}}).empty());
}

}  // namespace
}  // namespace mr
