// The same bytes with every instruction set, on any number of threads and on every machine.
#include "mr/core/simd.h"

#include <gtest/gtest.h>

#include <bit>
#include <limits>
#include <optional>

#include "mr/core/parallel.h"
#include "mr/fusion/fuse.h"
#include "support/depth_pictures.h"

namespace mr {
namespace {

using fusion::DepthEdges;
using fusion::History;
using fusion::IntegrateReport;
using fusion::VolumeConfig;
using fusion::VoxelVolume;

struct View {
  Camera camera;
  Pose pose;
  ImageDepth depth;
};

/// The room from three places, one after another, with noise and a hole.
std::vector<View> views(const Camera& camera) {
  std::vector<View> out;
  std::uint64_t seed = 1;
  for (const Vec3d eye : {Vec3d{0.13, -0.21, 0.07}, {-0.3, 0.1, -0.2}, {-0.31, 0.1, -0.2}}) {
    const Pose pose = test::tilted_pose(eye);
    ImageDepth depth =
        test::with_noise(test::depth_picture(test::furnished_room(), camera, pose), 0.003, seed++);
    for (int x = 3; x < 9; ++x) *depth.at(x, camera.height / 2) = 0;
    out.push_back({camera, pose, std::move(depth)});
  }
  return out;
}

struct TargetOutcome {
  Mesh mesh;
  std::vector<fusion::SurfacePiece> pieces;
};

TargetOutcome fuse_views(const std::vector<View>& views, History history,
                         DepthEdges edges = DepthEdges::cut, bool slanted = false) {
  VolumeConfig config;
  config.voxel_m = views[0].camera.model == CameraModel::pinhole ? 0.05 : 0.13;
  config.truncation_m = 4 * config.voxel_m, config.chunk_m = 0.5;
  config.history = history, config.most_blocks = 1500;
  VoxelVolume volume(config);
  for (const View& v : views)
    volume.integrate({v.depth, v.camera, v.pose, test::whole(v.depth), Precision{}, slanted});
  fusion::Surface surface;
  fusion::MarchingCubes(edges).run(volume, surface);
  return {std::move(surface.mesh), surface.pieces};
}

/// FNV-1a of vertices and triangles.
std::uint64_t hash_of(const Mesh& mesh) {
  std::uint64_t hash = 0xCBF29CE484222325ull;
  const auto add = [&](std::uint32_t word) {
    for (int i = 0; i < 4; ++i) hash = (hash ^ (word >> 8 * i & 0xFF)) * 0x100000001B3ull;
  };
  for (const Vec3f p : mesh.positions)
    for (int axis = 0; axis < 3; ++axis) add(std::bit_cast<std::uint32_t>(p[axis]));
  for (const Triangle& t : mesh.triangles)
    for (const std::uint32_t v : t) add(v);
  return hash;
}

std::uint64_t hash_of(const ImageDepth& depth) {
  std::uint64_t hash = 0xCBF29CE484222325ull;
  for (const float d : depth.data)
    for (int i = 0; i < 4; ++i)
      hash = (hash ^ (std::bit_cast<std::uint32_t>(d) >> 8 * i & 0xFF)) * 0x100000001B3ull;
  return hash;
}

/// Back to the best target, whatever a test fails at.
struct RestoreSimd {
  ~RestoreSimd() { set_simd_target(""); }
};

class EverySimdTarget : public ::testing::TestWithParam<const char*> {
 protected:
  Camera camera() const {
    const std::string name = GetParam();
    if (name == "pinhole") return test::pinhole(71, 53, 60);
    if (name == "panorama") return test::panorama(70, 34);
    return test::lidar(67, 17, 30, 30);
  }
};

TEST_P(EverySimdTarget, GivesTheSameBytesOnAnyNumberOfThreads) {
  const RestoreSimd restore;
  const std::vector<View> all = views(camera());
  for (const History history : {History::none, History::average}) {
    ASSERT_TRUE(set_simd_target(""));
    const TargetOutcome expected = fuse_views(all, history);
    ASSERT_GT(expected.mesh.triangles.size(), 1000u);
    for (const std::string& target : simd_targets())
      for (const int threads : {1, 2, 8}) {
        if (threads == 8 && target != simd_targets()[0]) continue;
        ASSERT_TRUE(set_simd_target(target));
        ASSERT_EQ(simd_target(), target);
        TargetOutcome result;
        Arena(threads).run([&] { result = fuse_views(all, history); });
        EXPECT_TRUE(result.mesh == expected.mesh) << target << ", " << threads << " threads";
        EXPECT_EQ(result.pieces.size(), expected.pieces.size());
      }
  }
}

TEST_P(EverySimdTarget, TakesRefusedPixelsAlike) {
  // What is no depth may compare differently, but must not.
  const RestoreSimd restore;
  std::vector<View> one{views(camera())[0]};
  const float nan = std::numeric_limits<float>::quiet_NaN(),
              infinite = std::numeric_limits<float>::infinity();
  test::Random random(8);
  for (const float bad : {nan, -nan, infinite, -infinite, -1.0f, 1e9f, 1e-42f, -0.0f, 9e4f})
    for (int i = 0; i < 20; ++i) one[0].depth.data[random() % one[0].depth.data.size()] = bad;
  std::optional<Mesh> expected;
  for (const std::string& target : simd_targets()) {
    ASSERT_TRUE(set_simd_target(target));
    const Mesh mesh = fuse_views(one, History::average, DepthEdges::bridge).mesh;
    if (!expected) expected = mesh;
    EXPECT_TRUE(mesh == *expected) << target;
  }
}

TEST(Simd, SlantedPixelsGiveTheSameBytes) {
  const RestoreSimd restore;
  const std::vector<View> all = views(test::pinhole(71, 53, 60));
  for (const History history : {History::none, History::average}) {
    ASSERT_TRUE(set_simd_target(""));
    const Mesh expected = fuse_views(all, history, DepthEdges::cut, true).mesh;
    EXPECT_FALSE(expected == fuse_views(all, history).mesh);
    for (const std::string& target : simd_targets()) {
      ASSERT_TRUE(set_simd_target(target));
      EXPECT_TRUE(fuse_views(all, history, DepthEdges::cut, true).mesh == expected) << target;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(, EverySimdTarget, ::testing::Values("pinhole", "panorama", "lidar"),
                         [](const auto& each) { return std::string(each.param); });

TEST(Golden, ThePinholesSurfaceIsTheSameOnEveryMachine) {
  // Panoramas and LiDARs take sines and cosines from the C library, which may differ.
  const std::vector<View> all = views(test::pinhole(71, 53, 60));
  EXPECT_EQ(hash_of(all[0].depth), 18304241832893145315u);
  EXPECT_EQ(hash_of(fuse_views({all[0]}, History::none).mesh), 5586656198061701454u);
  EXPECT_EQ(hash_of(fuse_views(all, History::average).mesh), 16510993536880927537u);
}

}  // namespace
}  // namespace mr
