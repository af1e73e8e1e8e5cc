#include "mr/merge/overlap/occlusion_rule.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>
#include <limits>
#include <random>
#include <string>

#include "mr/core/parallel.h"
#include "mr/kit/image_io.h"
#include "support/meshes.h"
#include "support/rays.h"
#include "support/shared_data.h"
#include "walls.h"

namespace mr {
namespace {

using test::part;
using test::wall;

using Overlap = merge::MergeConfig::Overlap;
using Flags = std::vector<std::vector<std::uint8_t>>;

merge::OverlapConfig by(Overlap how) {
  return {.owner = merge::MergeConfig::Owner::paper, .overlap = how};
}
constexpr Overlap kWays[] = {Overlap::raster, Overlap::rays};

/// A noisy wall, a ball before it and a floor that passes beneath the cameras, seen three times.
std::vector<kit::Part> room() {
  std::vector<kit::Part> out;
  const Vec3d sensors[] = {{-0.5, 0, 0}, {0.5, -0.1, 0.1}, {0, 0.2, -0.3}};
  for (unsigned i = 0; i < 3; ++i) {
    Mesh mesh = wall(-1.2f, 1.3f, 0.002f * static_cast<float>(i), 37 + 3 * static_cast<int>(i),
                     0.004f, i + 1);
    append(mesh, test::sphere({0.1f, 0.003f * static_cast<float>(i), 1.4f}, 0.3f,
                              19 + 2 * static_cast<int>(i)));
    append(mesh, test::grid({-1, 0.6f, -1}, {2, 0, 0}, {0, 0.1f, 4}, 5 + static_cast<int>(i), 9,
                            0.003f, i + 7));
    out.push_back(part(std::move(mesh), i, sensors[i]));
  }
  return out;
}

std::size_t gone(const Flags& flags) {
  std::size_t sum = 0;
  for (const auto& of_part : flags) sum += std::ranges::count(of_part, 1);
  return sum;
}

struct Comparison {
  std::size_t rays = 0, met = 0, same = 0, lost = 0;
};

/// Both ways' decisions, ray by ray.
Comparison compare(const std::vector<kit::Part>& parts) {
  const auto drawn = merge::ray_verdicts(parts, by(Overlap::raster));
  const auto cast = merge::ray_verdicts(parts, by(Overlap::rays));
  EXPECT_EQ(drawn.size(), cast.size());
  Comparison out;
  for (std::size_t i = 0; i < std::min(drawn.size(), cast.size()); ++i)
    for (std::size_t p = 0; p + 1 < drawn[i].first.size(); ++p) {
      ++out.rays;
      out.met += !cast[i].at(p).empty();
      out.same += std::ranges::equal(drawn[i].at(p), cast[i].at(p));
      for (const merge::RayVerdict& v : cast[i].at(p)) out.lost += v.lost;
    }
  return out;
}

TEST(OcclusionRule, DrawnAndCastRaysDecideAlike) {
  const auto found = compare(room());
  EXPECT_EQ(found.rays, 3u * 160 * 144);
  EXPECT_GT(found.met, found.rays / 2);
  EXPECT_GT(found.lost, found.rays / 2);
  EXPECT_GE(static_cast<double>(found.same), 0.999 * static_cast<double>(found.rays));
}

/// A recorded depth picture as a sheet of triangles, one corner to every three pixels a side, torn
/// where the depth jumps. Corners lie beside the rays, where Embree finds one of them.
Mesh sheet_of(const kit::ImageDepth16& counts, const SourceInfo& source) {
  constexpr int kStep = 3;
  const int width = counts.width / kStep, height = counts.height / kStep;
  Mesh mesh;
  std::vector<double> depths;
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      const double depth = *counts.at(x * kStep, y * kStep) * 0.001;
      depths.push_back(depth < 10 ? depth : 0);  // 65535: beyond the sensor's range
      const Vec3d ray = unproject(source.depth_camera, {x * kStep + 0.37, y * kStep + 0.61});
      mesh.positions.push_back(vec_cast<float>(source.T_world_depth * (ray * depth)));
    }
  const auto add = [&](int a, int b, int c) {
    const auto [low, high] = std::minmax({depths[a], depths[b], depths[c]});
    if (low > 0 && high - low < 0.05)
      mesh.triangles.push_back({static_cast<std::uint32_t>(a), static_cast<std::uint32_t>(b),
                                static_cast<std::uint32_t>(c)});
  };
  for (int y = 0; y + 1 < height; ++y)
    for (int x = 0; x + 1 < width; ++x) {
      const int at = y * width + x;
      add(at, at + width, at + width + 1), add(at, at + width + 1, at + 1);
    }
  return mesh;
}

TEST(OcclusionRule, DrawnAndCastRaysOfRecordingsDecideAlike) {
  const auto folder = test::shared_data() / "room_bench";
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << "no " << folder << " (set MR_DATA)";
  std::vector<kit::Part> parts;
  for (unsigned i = 0; i < 4; ++i) {
    const auto counts = kit::read_depth16(folder / ("depth_" + std::to_string(i) + ".png"));
    ASSERT_TRUE(counts) << counts.error().message;
    std::ifstream file(folder / ("pose_" + std::to_string(i) + ".txt"));
    std::array<double, 16> matrix{};
    for (double& value : matrix) file >> value;
    const auto pose = pose_from_matrix(matrix);
    ASSERT_TRUE(pose) << pose.error().message;
    SourceInfo source = test::source(i, *pose);
    source.depth_camera.width = 640, source.depth_camera.height = 576;
    source.depth_camera.fx = source.depth_camera.fy = 504;
    source.depth_camera.cx = 320, source.depth_camera.cy = 288;
    parts.push_back({sheet_of(*counts, source), 0.002f, {source}});
    EXPECT_GT(parts.back().mesh.triangles.size(), 30'000u);
  }
  const auto found = compare(parts);
  EXPECT_EQ(found.rays, 4u * 640 * 576);
  EXPECT_GT(found.lost, found.rays / 5);
  EXPECT_GE(static_cast<double>(found.same), 0.999 * static_cast<double>(found.rays));
}

TEST(OcclusionRule, DrawnAndCastRaysOfALidarDecideAlike) {
  auto parts = room();
  Camera lidar;
  lidar.model = CameraModel::lidar;
  lidar.width = 512, lidar.height = 32;
  for (int i = 0; i < lidar.height; ++i) {
    lidar.beam_altitude_rad.push_back(0.4 - 0.025 * i);
    lidar.beam_azimuth_rad.push_back(0);
  }
  parts[1].sources[0].depth_camera = lidar;
  parts[2].sources[0].depth_camera = Camera{};
  parts[2].sources[0].depth_camera.model = CameraModel::equirectangular;
  parts[2].sources[0].depth_camera.width = 512, parts[2].sources[0].depth_camera.height = 256;
  const auto found = compare(parts);
  EXPECT_GT(found.rays, 3u * 160 * 144);
  EXPECT_GT(found.lost, 10'000u);
  EXPECT_GE(static_cast<double>(found.same), 0.999 * static_cast<double>(found.rays));
}

TEST(OcclusionRule, TheFartherSheetGoes) {
  // Both sensors see the same sheet in front; the other is 8 mm behind it.
  const std::vector<kit::Part> parts{part(wall(-1, 1, 0.008f), 0, {-0.2, 0, 0}),
                                     part(wall(-1, 1, 0), 1, {0.2, 0, 0})};
  for (const Overlap how : kWays) {
    const Flags flags = merge::farther_triangles(parts, by(how));
    ASSERT_EQ(flags.size(), 2u);
    ASSERT_EQ(flags[0].size(), parts[0].mesh.triangles.size());
    EXPECT_GT(std::ranges::count(flags[0], 1), 40 * 40 * 2 * 95 / 100);
    EXPECT_EQ(std::ranges::count(flags[1], 1), 0);
  }
}

TEST(OcclusionRule, WhatIsTooFarBehindOrFacesAwayStays) {
  const std::vector<kit::Part> apart{part(wall(-1, 1, 0.1f), 0, {-0.2, 0, 0}),
                                     part(wall(-1, 1, 0), 1, {0.2, 0, 0})};
  // A thin board: the second camera sees its other side.
  const std::vector<kit::Part> board{
      part(wall(-1, 1, 0), 0, {0, 0, 0}),
      part(test::grid({-1, -1, 2.005f}, {2, 0, 0}, {0, 2, 0}, 40, 40), 1, {0, 0, 4}, {0, 0, 2})};
  for (const Overlap how : kWays) {
    EXPECT_EQ(gone(merge::farther_triangles(apart, by(how))), 0u);
    EXPECT_EQ(gone(merge::farther_triangles(board, by(how))), 0u);
  }
}

TEST(OcclusionRule, OfIdenticalPartsTheFirstStays) {
  // Their equal depths are put in the order of the parts.
  const std::vector<kit::Part> parts{part(wall(-1, 1, 0), 0, {0, 0, 0}),
                                     part(wall(-1, 1, 0), 1, {0, 0, 0})};
  const Flags flags = merge::farther_triangles(parts, by(Overlap::raster));
  EXPECT_EQ(std::ranges::count(flags[0], 1), 0);
  EXPECT_GT(std::ranges::count(flags[1], 1), 40 * 40 * 2 * 95 / 100);
  EXPECT_EQ(merge::farther_triangles(parts, by(Overlap::rays)), flags);
}

TEST(OcclusionRule, EveryRayThroughAGridMeetsOneTriangle) {
  // Every inner edge and corner of the grid lies on pixel centres.
  auto source = test::source(0, look_at({0, 0, 0}, {0, 0, 2}, {0, -1, 0}));
  source.depth_camera.width = 96, source.depth_camera.height = 64;
  source.depth_camera.fx = source.depth_camera.fy = 64;
  source.depth_camera.cx = 48, source.depth_camera.cy = 32;
  const Mesh sheet = test::grid({-0.5f, 0.5f, 2}, {1, 0, 0}, {0, -1, 0}, 4, 4);
  const Mesh behind = test::grid({-0.75f, 0.75f, 3}, {1.5f, 0, 0}, {0, -1.5f, 0}, 4, 4);
  const std::vector<kit::Part> parts{{sheet, 0.001f, {source}}, {behind, 0.001f, {source}}};
  const auto rays = merge::ray_verdicts(parts, by(Overlap::raster));
  ASSERT_EQ(rays.size(), 2u);
  std::size_t met = 0;
  for (std::size_t p = 0; p < 96 * 64; ++p) {
    const auto on_ray = rays[0].at(p);
    ASSERT_TRUE(on_ray.empty() || on_ray.size() == 2) << p;
    if (on_ray.empty()) continue;
    ++met;
    EXPECT_LT(on_ray[0].triangle, sheet.triangles.size());
    EXPECT_GE(on_ray[1].triangle, sheet.triangles.size());
  }
  EXPECT_EQ(met, 32u * 32);
}

TEST(OcclusionRule, EveryRayThroughABowlMeetsOneTriangle) {
  // Edges in all directions, triangles of all sizes, also across the near plane and far outside.
  std::mt19937 random(3);
  Mesh bowl;
  constexpr int kRing = 17;
  bowl.positions.push_back({0.01f, 0.02f, 2});
  for (const float radius : {0.2f, 1.0f, 9.0f})
    for (int i = 0; i < kRing; ++i) {
      const float turn =
          6.2831853f * (static_cast<float>(i) + 0.4f * static_cast<float>(random() % 1000) / 1000) /
          kRing;
      bowl.positions.push_back({radius * std::cos(turn), radius * std::sin(turn),
                                2 - 0.3f * radius});  // the last ring lies behind the eye
    }
  const auto at = [](int ring, int i) {
    return static_cast<std::uint32_t>(1 + ring * kRing + i % kRing);
  };
  for (int i = 0; i < kRing; ++i) {
    bowl.triangles.push_back({0, at(0, i + 1), at(0, i)});
    for (int ring = 0; ring < 2; ++ring) {
      bowl.triangles.push_back({at(ring, i), at(ring, i + 1), at(ring + 1, i)});
      bowl.triangles.push_back({at(ring, i + 1), at(ring + 1, i + 1), at(ring + 1, i)});
    }
  }
  // So that there are two parts; no edge of it goes through a pixel, where Embree finds both sides.
  const Mesh far = test::grid({-41.37f, 40.11f, 20}, {80, 0, 0}, {0, -81, 0}, 3, 3);
  const std::vector<kit::Part> parts{part(bowl, 0, {0, 0, 0}), part(far, 1, {0, 0, 0})};
  for (const Overlap how : kWays) {
    const auto rays = merge::ray_verdicts(parts, by(how));
    ASSERT_EQ(rays.size(), 2u);
    for (std::size_t p = 0; p < 160 * 144; ++p) EXPECT_EQ(rays[0].at(p).size(), 2u) << p;
  }
}

TEST(OcclusionRule, SameFlagsOnAnyNumberOfThreads) {
  const auto parts = room();
  for (const Overlap how : kWays) {
    Flags expected;
    for (const int threads : {1, 2, 3, 8}) {
      Arena arena(threads);
      Flags flags;
      arena.run([&] { flags = merge::farther_triangles(parts, by(how)); });
      if (threads == 1) expected = flags;
      EXPECT_GT(gone(flags), 1000u);
      EXPECT_EQ(flags, expected) << threads;
    }
  }
}

TEST(OcclusionRule, NothingGoesWithoutASecondPart) {
  const Mesh sheet = wall(-1, 1, 0);
  const std::vector<kit::Part> one{part(sheet, 0, {0, 0, 0})};
  const std::vector<kit::Part> beside_empty{part(sheet, 0, {0, 0, 0}), part({}, 1, {0, 0, 0})};
  const std::vector<kit::Part> far_apart{
      part(sheet, 0, {0, 0, 0}),
      part(test::grid({99, 1, 2}, {2, 0, 0}, {0, -2, 0}, 9, 9), 1, {100, 0, 0}, {100, 0, 2})};
  for (const Overlap how : kWays) {
    EXPECT_TRUE(merge::farther_triangles({}, by(how)).empty());
    for (const auto& parts : {one, beside_empty, far_apart}) {
      const Flags flags = merge::farther_triangles(parts, by(how));
      ASSERT_EQ(flags.size(), parts.size());
      EXPECT_EQ(flags[0], std::vector<std::uint8_t>(sheet.triangles.size(), 0));
      EXPECT_EQ(gone(flags), 0u);
    }
    EXPECT_TRUE(merge::ray_verdicts(far_apart, by(how)).empty());  // no camera sees both
  }
}

TEST(OcclusionRule, BadTrianglesAreNoSurface) {
  auto parts = room();
  const Flags expected = merge::farther_triangles(parts, by(Overlap::raster));
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  constexpr float kInf = std::numeric_limits<float>::infinity();
  for (kit::Part& p : parts) {
    const auto first = static_cast<std::uint32_t>(p.mesh.positions.size());
    for (const Vec3f bad : {Vec3f{kNan, 0, 2}, Vec3f{0, kInf, 2}, Vec3f{0, 0, -kInf},
                            Vec3f{1e30f, 0, 2}, Vec3f{0.1f, 0.1f, 2}})
      p.mesh.positions.push_back(bad);
    p.mesh.triangles.push_back({first, first + 4, 0});
    p.mesh.triangles.push_back({first + 1, 1, first + 4});
    p.mesh.triangles.push_back({2, first + 2, first + 4});
    p.mesh.triangles.push_back({first + 4, first + 4, first + 4});
  }
  const Flags flags = merge::farther_triangles(parts, by(Overlap::raster));
  for (std::size_t i = 0; i < parts.size(); ++i)
    EXPECT_TRUE(std::equal(expected[i].begin(), expected[i].end(), flags[i].begin()));
}

TEST(OcclusionRule, ManySliversOnOneRayAreNoTrouble) {
  // 20,000 needles of one part through the middle pixels, one behind the other, before a wall.
  Mesh slivers;
  for (int i = 0; i < 20'000; ++i) {
    const auto first = static_cast<std::uint32_t>(slivers.positions.size());
    const float z = 1.99f - 1e-7f * static_cast<float>(i % 10'000);
    slivers.positions.push_back({0.013f, 0.5f, z});
    slivers.positions.push_back({0.0131f, -0.5f, z});
    slivers.positions.push_back({-0.013f, -0.5f, z});
    slivers.triangles.push_back({first, first + 1, first + 2});
  }
  const std::vector<kit::Part> parts{part(std::move(slivers), 0, {0, 0, 0}),
                                     part(wall(-1, 1, 0), 1, {0.1, 0, 0})};
  const Flags flags = merge::farther_triangles(parts, by(Overlap::raster));
  EXPECT_EQ(std::ranges::count(flags[0], 1), 0);
}

}  // namespace
}  // namespace mr
