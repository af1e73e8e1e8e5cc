// Invalid input from sensors, files and configurations: no crash, bounded memory, an empty mesh or
// a counted refusal.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>

#include "mr/fusion/fuse.h"
#include "mr/kit/topology.h"
#include "support/depth_pictures.h"

namespace mr {
namespace {

using fusion::DepthEdges;
using fusion::History;
using fusion::IntegrateReport;
using fusion::VolumeConfig;
using fusion::VoxelVolume;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInfinite = std::numeric_limits<float>::infinity();
constexpr History kHistories[] = {History::none, History::average};

VolumeConfig small_volume(double voxel_m = 0.02, double truncation_m = 0.08) {
  VolumeConfig config;
  config.voxel_m = voxel_m, config.truncation_m = truncation_m, config.chunk_m = 0.5;
  config.most_blocks = 20000;
  return config;
}

struct FuseOutcome {
  IntegrateReport report;
  Mesh mesh;
  std::size_t memory_bytes = 0, blocks = 0;
};

/// Whatever comes out must be a mesh.
void expect_sound(const Mesh& mesh) {
  std::size_t outside = 0, not_finite = 0, no_area = 0;
  for (const Vec3f p : mesh.positions) not_finite += !is_finite(p);
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    for (const std::uint32_t v : mesh.triangles[t]) outside += v >= mesh.positions.size();
    ASSERT_EQ(outside, 0u);
    no_area += !(length(mesh.area_normal(t)) > 0);
  }
  EXPECT_EQ(not_finite, 0u);
  EXPECT_EQ(no_area, 0u);
  EXPECT_EQ(kit::count_nonmanifold_edges(mesh), 0u);
}

/// Fuses a frame, twice where frames are averaged, and meshes it.
FuseOutcome fuse_once(const ImageDepth& depth, const Camera& camera, const Pose& pose = {},
                      VolumeConfig config = small_volume(), History history = History::none,
                      std::optional<Rect> region = {}) {
  config.history = history;
  VoxelVolume volume(config);
  FuseOutcome out;
  const fusion::DepthFrame frame{depth, camera, pose, region.value_or(test::whole(depth)),
                                 Precision{}};
  out.report = volume.integrate(frame);
  if (history != History::none) volume.integrate(frame);
  out.mesh = fusion::extract_surface(volume, DepthEdges::bridge);
  out.memory_bytes = volume.memory_bytes(), out.blocks = volume.order().size();
  expect_sound(out.mesh);
  EXPECT_LE(out.blocks, config.most_blocks);
  return out;
}

std::vector<Camera> cameras(int width, int height) {
  return {test::pinhole(width, height, std::max(width, height)), test::panorama(width, height),
          test::lidar(width, height, 20, 20)};
}

// --- depth

TEST(BadDepth, PicturesOfNothingGiveNothing) {
  for (const Camera& camera : cameras(40, 30))
    for (const History history : kHistories)
      for (const float bad : {0.0f, -0.0f, kNan, -kNan, kInfinite, -kInfinite, -1.0f, 1e9f, 1e5f,
                              std::numeric_limits<float>::max()}) {
        SCOPED_TRACE(bad);
        const FuseOutcome r =
            fuse_once(ImageDepth(40, 30, bad), camera, {}, small_volume(), history);
        EXPECT_TRUE(r.report.usable);
        EXPECT_TRUE(r.mesh.positions.empty());
        EXPECT_EQ(r.blocks, 0u);
        EXPECT_EQ(r.report.refused_pixels, bad == 0 ? 0u : 40u * 30u);
      }
}

TEST(BadDepth, IsCountedAndTheRestIsFused) {
  for (const Camera& camera : cameras(64, 48)) {
    ImageDepth depth(64, 48, 1.3f), holes = depth;
    std::size_t bad = 0;
    for (int y = 10; y < 14; ++y)
      for (int x = 20; x < 33; ++x) {
        *holes.at(x, y) = 0;
        *depth.at(x, y) = std::array{kNan, kInfinite, -kInfinite, -2.0f, 1e9f}[bad++ % 5];
      }
    const FuseOutcome with_bad = fuse_once(depth, camera), with_holes = fuse_once(holes, camera);
    EXPECT_EQ(with_bad.report.refused_pixels, bad);
    EXPECT_EQ(with_holes.report.refused_pixels, 0u);
    EXPECT_GT(with_bad.mesh.triangles.size(), 1000u);
    EXPECT_TRUE(with_bad.mesh == with_holes.mesh);
  }
}

TEST(BadDepth, SmallestAndLargestNumbers) {
  for (const Camera& camera : cameras(16, 12))
    for (const float depth : {1e-45f, 1e-30f, 1e-6f, 0.001f, 0.019f}) {
      SCOPED_TRACE(depth);
      EXPECT_TRUE(fuse_once(ImageDepth(16, 12, depth), camera).report.usable);
    }
  // One pixel 90 km away beside a wall.
  const Camera camera = test::pinhole(64, 48, 60);
  ImageDepth depth(64, 48, 1.3f);
  const FuseOutcome wall = fuse_once(depth, camera);
  *depth.at(30, 20) = 9e4f;
  for (const History history : kHistories) {
    const FuseOutcome r = fuse_once(depth, camera, test::tilted_pose(), small_volume(), history);
    EXPECT_EQ(r.report.refused_pixels, 0u);
    EXPECT_GT(r.mesh.triangles.size(), wall.mesh.triangles.size() / 2);
    EXPECT_LT(r.memory_bytes, 20u << 20);
  }
}

TEST(BadDepth, RandomBitsStayWithinTheirMemory) {
  test::Random random(11);
  ImageDepth bits(160, 120);
  for (float& d : bits.data) {
    const std::uint32_t word = random();
    std::memcpy(&d, &word, sizeof d);
  }
  const ImageDepth scattered = test::random_depth(160, 120, 0.1, 9e4, 12);
  for (const History history : kHistories)
    for (const ImageDepth& depth : {bits, scattered}) {
      VolumeConfig config = small_volume();
      config.most_blocks = 500;
      const FuseOutcome r =
          fuse_once(depth, test::pinhole(160, 120, 140), test::tilted_pose(), config, history);
      EXPECT_LE(r.blocks, 500u);
      EXPECT_GT(r.blocks, 100u);
      EXPECT_GT(r.report.left_out_blocks, 0u);
      EXPECT_LT(r.memory_bytes, 8u << 20);
    }
}

TEST(BadDepth, FarRangesStayWithinTheirMemory) {
  // What one pixel of a range picture covers 1 km away are millions of blocks.
  for (const double range_m : {30.0, 1000.0, 9e4})
    for (const Camera& camera : {test::panorama(1, 1), test::panorama(24, 12),
                                 test::lidar(24, 6, 15, 15), test::lidar(1, 1, 0, 0)}) {
      SCOPED_TRACE(range_m);
      VolumeConfig config = small_volume();
      config.most_blocks = 500;
      const FuseOutcome r =
          fuse_once(ImageDepth(camera.width, camera.height, static_cast<float>(range_m)), camera,
                    test::tilted_pose(), config);
      EXPECT_LE(r.blocks, 500u);
      EXPECT_LT(r.memory_bytes, 8u << 20);
    }
}

TEST(BadDepth, FarPixelsBesideNearOnes) {
  // The plane through such neighbours is nearly a ray, thousands of kilometres long.
  test::Random random(8);
  for (const Camera& camera : {test::panorama(70, 34), test::lidar(67, 17, 30, 30)})
    for (const History history : {History::none, History::average}) {
      ImageDepth depth = test::depth_picture(test::furnished_room(), camera, test::tilted_pose());
      for (int i = 0; i < 20; ++i) depth.data[random() % depth.data.size()] = 9e4f;
      VolumeConfig config = small_volume(0.05, 0.2);
      config.most_blocks = 600;
      const FuseOutcome r = fuse_once(depth, camera, test::tilted_pose(), config, history);
      EXPECT_GT(r.mesh.triangles.size(), 1000u);
      EXPECT_LT(r.memory_bytes, 32u << 20);
    }
}

// --- pictures and cameras

TEST(BadCamera, PicturesOfOnePixelOrRow) {
  for (const auto& [width, height] : {std::pair{1, 1}, {1, 40}, {40, 1}, {2, 2}, {17, 1}})
    for (const Camera& camera : cameras(width, height))
      for (const History history : kHistories) {
        SCOPED_TRACE(testing::Message()
                     << width << " x " << height << " model " << static_cast<int>(camera.model));
        const FuseOutcome r = fuse_once(ImageDepth(width, height, 0.7f), camera,
                                        test::tilted_pose(), small_volume(0.1, 0.4), history);
        EXPECT_TRUE(r.report.usable);
      }
}

TEST(BadCamera, ImpossibleIntrinsicsAreRefused) {
  const ImageDepth depth(32, 24, 1.0f);
  const auto refused = [&](auto change) {
    Camera camera = test::pinhole(32, 24, 30);
    change(camera);
    const FuseOutcome r = fuse_once(depth, camera);
    return !r.report.usable && r.mesh.empty();
  };
  for (const double bad : {0.0, -30.0, static_cast<double>(kNan), static_cast<double>(kInfinite),
                           1e30, 1e-30, -1e300}) {
    EXPECT_TRUE(refused([&](Camera& c) { c.fx = bad; })) << bad;
    EXPECT_TRUE(refused([&](Camera& c) { c.fy = bad; })) << bad;
  }
  for (const double bad : {-1e6, 1e6, static_cast<double>(kNan), static_cast<double>(-kInfinite)}) {
    EXPECT_TRUE(refused([&](Camera& c) { c.cx = bad; })) << bad;
    EXPECT_TRUE(refused([&](Camera& c) { c.cy = bad; })) << bad;
  }
  EXPECT_TRUE(refused([](Camera& c) { c.width = 0; }));
  EXPECT_TRUE(refused([](Camera& c) { c.height = -24; }));
  EXPECT_TRUE(refused([](Camera& c) { c.width = c.height = 2000000000; }));
}

TEST(BadCamera, OfAnotherSizeThanThePictureIsRefused) {
  // A picture larger than its camera's: what of its rows has no beam must not be looked up.
  const ImageDepth depth(64, 32, 1.0f);
  for (const Camera& camera : cameras(32, 16)) EXPECT_FALSE(fuse_once(depth, camera).report.usable);
}

TEST(BadCamera, WidestPicture) {
  Camera wide = test::pinhole(16384, 2, 16384);
  wide.fy = 100;
  for (const Camera& camera : {wide, test::panorama(16384, 2)}) {
    ImageDepth depth(16384, 2, 0.0f);
    for (int x = 0; x < 16384; ++x) *depth.at(x, 0) = *depth.at(x, 1) = 1.0f;
    EXPECT_TRUE(fuse_once(depth, camera, {}, small_volume(0.05, 0.2)).report.usable);
  }
  EXPECT_FALSE(fuse_once(ImageDepth(16385, 1, 1.0f), test::pinhole(16385, 1, 16385)).report.usable);
}

TEST(BadCamera, RegionsThatAreNoneAreRefused) {
  constexpr int kMax = std::numeric_limits<int>::max(), kMin = std::numeric_limits<int>::min();
  const ImageDepth depth(32, 24, 1.0f);
  for (const Camera& camera : cameras(32, 24))
    for (const Rect region :
         {Rect{0, 0, 0, 0}, Rect{4, 4, -3, 5}, Rect{-1, 0, 8, 8}, Rect{0, 0, 33, 24},
          Rect{0, 0, 32, 25}, Rect{32, 0, 1, 1}, Rect{kMax, kMax, 1, 1}, Rect{1, 1, kMax, kMax},
          Rect{kMin, kMin, kMax, kMax}}) {
      const FuseOutcome r = fuse_once(depth, camera, {}, small_volume(), History::average, region);
      EXPECT_FALSE(r.report.usable);
      EXPECT_TRUE(r.mesh.empty());
    }
  EXPECT_FALSE(fuse_once(ImageDepth(), test::pinhole(32, 24, 30)).report.usable);
}

TEST(BadCamera, BeamsThatMakeNoSense) {
  const ImageDepth depth(64, 8, 1.5f);
  const auto report_of = [&](auto change) {
    Camera camera = test::lidar(64, 8, 20, 20);
    change(camera);
    return fuse_once(depth, camera, test::tilted_pose(), small_volume(0.05, 0.2)).report;
  };
  EXPECT_FALSE(report_of([](Camera& c) { c.beam_altitude_rad.clear(); }).usable);
  EXPECT_FALSE(report_of([](Camera& c) { c.beam_azimuth_rad.resize(7); }).usable);
  EXPECT_TRUE(report_of([](Camera& c) {
                std::swap(c.beam_altitude_rad[1], c.beam_altitude_rad[6]);
              }).usable);
  EXPECT_TRUE(report_of([](Camera& c) { c.beam_altitude_rad.assign(8, 0.1); }).usable);
  EXPECT_TRUE(report_of([](Camera& c) {
                std::reverse(c.beam_altitude_rad.begin(), c.beam_altitude_rad.end());
              }).usable);
  // Used or refused: neither may crash.
  for (const double bad :
       {static_cast<double>(kNan), static_cast<double>(kInfinite), 1e30, -1e30, 3.0, -1.6}) {
    report_of([&](Camera& c) { c.beam_altitude_rad[3] = bad; });
    report_of([&](Camera& c) { c.beam_azimuth_rad[3] = bad; });
    report_of([&](Camera& c) { c.beam_altitude_rad.assign(8, bad); });
  }
}

// --- poses

TEST(BadPose, NotFiniteIsRefused) {
  const ImageDepth depth(32, 24, 1.0f);
  for (const Camera& camera : cameras(32, 24))
    for (const double bad :
         {static_cast<double>(kNan), static_cast<double>(kInfinite), 1e7, -1e300})
      for (int i = 0; i < 3; ++i) {
        Pose pose;
        pose.translation[i] = bad;
        EXPECT_FALSE(fuse_once(depth, camera, pose).report.usable) << bad;
        if (std::isfinite(bad)) continue;
        pose = {};
        pose.rotation(i, (i + 1) % 3) = bad;
        EXPECT_FALSE(fuse_once(depth, camera, pose).report.usable) << bad;
      }
}

TEST(BadPose, NoRotationAtAll) {
  // Nothing to be right about, only not to crash.
  const ImageDepth depth(32, 24, 1.0f);
  for (const Camera& camera : cameras(32, 24))
    for (const double scale : {0.0, 1e-30, 1e6, 1e30, 1e300}) {
      Pose pose = test::tilted_pose();
      for (double& m : pose.rotation.m) m *= scale;
      VolumeConfig config = small_volume();
      config.most_blocks = 500;
      fuse_once(depth, camera, pose, config);
    }
}

TEST(BadPose, AKilometreAwayIsTheSameSurface) {
  const Camera camera = test::pinhole(96, 72, 90);
  const ImageDepth depth = test::depth_picture(test::furnished_room(), camera, test::tilted_pose());
  for (const History history : kHistories) {
    const FuseOutcome near =
        fuse_once(depth, camera, test::tilted_pose(), small_volume(0.025, 0.1), history);
    Pose far = test::tilted_pose();
    const Vec3d away{1000, -1000, 500};  // whole small_volume and chunks
    far.translation = far.translation + away;
    const FuseOutcome moved = fuse_once(depth, camera, far, small_volume(0.025, 0.1), history);
    ASSERT_GT(near.mesh.triangles.size(), 2000u);
    // Floats are 6e-5 m apart there; triangles that lose their area by that are dropped.
    EXPECT_NEAR(surface_area_m2(moved.mesh) / surface_area_m2(near.mesh), 1, 2e-3);
    ASSERT_EQ(moved.mesh.positions.size(), near.mesh.positions.size());
    double worst = 0;
    for (std::size_t v = 0; v < near.mesh.positions.size(); ++v)
      worst = std::max(worst, length(vec_cast<double>(moved.mesh.positions[v]) - away -
                                     vec_cast<double>(near.mesh.positions[v])));
    EXPECT_LT(worst, 3e-4);
  }
}

TEST(BadPose, ThousandKilometresAwayIsTheLast) {
  const Camera camera = test::pinhole(32, 24, 30);
  const ImageDepth depth(32, 24, 1.0f);
  for (const double voxel_m : {0.002, 0.01, 0.05}) {
    const Pose pose{{}, {999e3, 0, 0}};
    EXPECT_TRUE(fuse_once(depth, camera, pose, small_volume(voxel_m, 4 * voxel_m)).report.usable);
  }
}

// --- configuration

TEST(BadConfig, FewBlocksAreFilledAndTheRestIsCounted) {
  const Camera camera = test::pinhole(64, 48, 60);
  const ImageDepth depth = test::depth_picture(test::furnished_room(), camera, test::tilted_pose());
  for (const History history : kHistories)
    for (const std::size_t most : {0, 1, 7, 64}) {
      VolumeConfig config = small_volume();
      config.most_blocks = most;
      const FuseOutcome r = fuse_once(depth, camera, test::tilted_pose(), config, history);
      EXPECT_LE(r.blocks, most);
      EXPECT_GT(r.report.left_out_blocks, 0u);
    }
}

TEST(BadConfig, VoxelsLargerThanTheScene) {
  const Camera camera = test::pinhole(64, 48, 60);
  const ImageDepth depth = test::depth_picture(test::furnished_room(), camera, test::tilted_pose());
  for (const History history : kHistories)
    for (const double voxel_m : {1.0, 10.0, 1000.0})
      fuse_once(depth, camera, test::tilted_pose(), small_volume(voxel_m, voxel_m), history);
}

TEST(BadConfig, TruncationFarLargerThanTheScene) {
  for (const Camera& camera : cameras(64, 48)) {
    const ImageDepth depth = test::random_depth(64, 48, 0.5, 3, 2);
    VolumeConfig config = small_volume(0.02, 30);
    config.most_blocks = 500;
    const FuseOutcome r = fuse_once(depth, camera, test::tilted_pose(), config);
    EXPECT_LT(r.memory_bytes, 8u << 20);
  }
}

TEST(BadConfig, BoundsThatHoldNothing) {
  const ImageDepth depth(32, 24, 1.0f);
  const double nan = kNan, infinite = kInfinite;
  for (const Camera& camera : cameras(32, 24)) {
    for (const Box3d bounds :
         {Box3d{}, Box3d{{1, 1, 1}, {-1, -1, -1}}, Box3d{{50, 50, 50}, {51, 51, 51}},
          Box3d{{nan, nan, nan}, {nan, nan, nan}}}) {
      VolumeConfig config = small_volume();
      config.bounds = bounds;
      EXPECT_TRUE(fuse_once(depth, camera, {}, config).mesh.empty());
    }
    VolumeConfig all = small_volume(), open = all;
    open.bounds = Box3d{{-infinite, -infinite, -infinite}, {infinite, infinite, infinite}};
    EXPECT_TRUE(fuse_once(depth, camera, {}, open).mesh == fuse_once(depth, camera, {}, all).mesh);
  }
}

TEST(BadConfig, ASensorThatClaimsToBePerfect) {
  const ImageDepth depth(32, 24, 1.0f);
  for (const Camera& camera : cameras(32, 24)) {
    VolumeConfig config = small_volume(0.05, 0.2);
    config.history = History::average;
    VoxelVolume volume(config);
    for (int i = 0; i < 3; ++i)
      volume.integrate({depth, camera, {}, test::whole(depth), Precision{0, 0}});
    const Mesh mesh = fusion::extract_surface(volume);
    expect_sound(mesh);
    EXPECT_FALSE(mesh.empty());
  }
}

}  // namespace
}  // namespace mr
