#include "mr/baseline/points.h"

#include <gtest/gtest.h>
#include <stdlib.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <random>

#include "baseline/baseline_support.h"
#include "core/temp_dir.h"
#include "mr/baseline/draco_points.h"
#include "mr/baseline/ply_points.h"
#include "mr/baseline/vpcc.h"

namespace mr {
namespace {

using baseline::Bytes;
using baseline::PointSet;
using test::value;

PointSet some_points(int count) {
  std::mt19937 random(1);
  std::uniform_real_distribution<float> place(-2, 2);
  PointSet out;
  for (int i = 0; i < count; ++i) {
    out.positions.push_back(Lattice{}.snap({place(random), place(random), place(random)}));
    out.colors.push_back({static_cast<std::uint8_t>(random()), static_cast<std::uint8_t>(random()),
                          static_cast<std::uint8_t>(random())});
  }
  return out;
}

/// Places and colours as a sorted list.
std::vector<std::pair<Vec3f, std::array<std::uint8_t, 3>>> sorted(const PointSet& points) {
  std::vector<std::pair<Vec3f, std::array<std::uint8_t, 3>>> out;
  for (std::size_t i = 0; i < points.positions.size(); ++i)
    out.emplace_back(points.positions[i], points.colors[i]);
  std::sort(out.begin(), out.end());
  return out;
}

/// Two cameras at the origin that look along z: depth of 64 x 48 pixels and colour beside it.
struct Bench {
  Camera depth_camera;
  View view;
  ImageRgb color{128, 96};

  explicit Bench(double baseline_m) {
    depth_camera.width = 64, depth_camera.height = 48;
    depth_camera.fx = depth_camera.fy = 50, depth_camera.cx = 31.5, depth_camera.cy = 23.5;
    view.width = 128, view.height = 96;
    view.fx = view.fy = 100, view.cx = 63.5, view.cy = 47.5;
    view.image_rect = view.atlas_rect = {0, 0, 128, 96};
    view.T_world_camera.translation.x = baseline_m;
    for (int y = 0; y < 96; ++y)
      for (int x = 0; x < 128; ++x) {
        color.at(x, y)[0] = static_cast<std::uint8_t>(2 * x);
        color.at(x, y)[1] = static_cast<std::uint8_t>(2 * y);
      }
  }
};

TEST(Points, AreColouredWhereTheColourCameraSeesThem) {
  const Bench bench(0);
  const PointSet points = baseline::colored_points(
      {ImageDepth(64, 48, 2.0f), bench.depth_camera, {}}, bench.color, bench.view, std::nullopt);
  ASSERT_EQ(points.positions.size(), 64u * 48u);
  for (std::size_t i = 0; i < points.positions.size(); ++i) {
    const Vec3f p = points.positions[i];
    EXPECT_FLOAT_EQ(p.z, 2);
    EXPECT_NEAR(points.colors[i][0], 2 * (p.x / p.z * 100 + 63.5), 1.1);
    EXPECT_NEAR(points.colors[i][1], 2 * (p.y / p.z * 100 + 47.5), 1.1);
  }
}

TEST(Points, WhatTheColourCameraCannotSeeIsLeftOut) {
  const Bench bench(0.3);  // it looks past the near board's right side
  ImageDepth depth(64, 48, 3.0f);
  for (int y = 10; y < 40; ++y)
    for (int x = 20; x < 40; ++x) *depth.at(x, y) = 1.0f;
  const PointSet points = baseline::colored_points({depth, bench.depth_camera, {}}, bench.color,
                                                   bench.view, std::nullopt);
  // Behind the board as the colour camera sees it: x from 0.3 + (-0.24 - 0.3) · 3 up to the board's
  // own shadow in the depth picture.
  std::size_t behind = 0, near = 0;
  for (const Vec3f& p : points.positions) {
    if (p.z < 2) {
      ++near;
      continue;
    }
    const double x_at_board = 0.3 + (p.x - 0.3) / 3, y_at_board = p.y / 3;
    behind += x_at_board > -0.17 && x_at_board < 0.11 && std::abs(y_at_board) < 0.2;
  }
  EXPECT_EQ(near, 20u * 30u);
  EXPECT_EQ(behind, 0u);
  EXPECT_GT(points.positions.size(), 64u * 48u / 2);
}

TEST(Points, PixelsBetweenTwoSurfacesAreDropped) {
  const Bench bench(0);
  ImageDepth depth(64, 48, 3.0f);
  for (int y = 0; y < 48; ++y) {
    for (int x = 0; x < 30; ++x) *depth.at(x, y) = 1.0f;
    *depth.at(30, y) = 1.9f;
  }
  ImageDepth wanted = depth;
  for (int y = 0; y < 48; ++y) *wanted.at(30, y) = 0;
  baseline::drop_flying_pixels(depth, bench.depth_camera, Precision{});
  for (int y = 1; y < 47; ++y)
    for (int x = 1; x < 63; ++x) ASSERT_EQ(*depth.at(x, y), *wanted.at(x, y)) << x << " " << y;
}

TEST(Points, OnePerVoxelWithItsMeans) {
  const PointSet a{{{0.01f, 0.01f, 0.01f}, {0.99f, 0, 0}}, {{10, 0, 200}, {1, 2, 3}}};
  const PointSet b{{{0.03f, 0.05f, 0.09f}, {-0.01f, 0, 0}}, {{20, 0, 100}, {4, 5, 6}}};
  const PointSet sets[] = {a, b};
  const PointSet got = baseline::voxel_sampled(sets, 0.1);
  ASSERT_EQ(got.positions.size(), 3u);
  EXPECT_NEAR(length(got.positions[0] - Vec3f{0.02f, 0.03f, 0.05f}), 0, 1e-6);
  EXPECT_EQ(got.colors[0], (std::array<std::uint8_t, 3>{15, 0, 150}));
  EXPECT_EQ(got.positions[1], a.positions[1]);
  EXPECT_EQ(got.positions[2], b.positions[1]);
  EXPECT_EQ(got.colors[2], b.colors[1]);
}

TEST(Points, DracoKeepsEveryPointAndColour) {
  const PointSet points = some_points(5000);
  const Bytes bytes = value(baseline::encode_draco_points(points, Lattice{}));
  EXPECT_EQ(sorted(value(baseline::decode_draco_points(bytes, 5000, Lattice{}))), sorted(points));
  EXPECT_FALSE(baseline::decode_draco_points(bytes, 4999, Lattice{}));
  PointSet outside = points;
  outside.positions[17].x = 600;
  const auto refused = baseline::encode_draco_points(outside, Lattice{});
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().cause, Error::Cause::invalid);
}

TEST(Points, PlyIsReadBack) {
  const PointSet points = some_points(100);
  EXPECT_EQ(value(baseline::from_ply(baseline::to_ply(points), 100)), points);
  EXPECT_FALSE(baseline::from_ply(baseline::to_ply(points), 99));
  const std::string ascii =
      "ply\r\nformat ascii 1.0\r\ncomment by hand\r\nelement vertex 2\r\nproperty double x\r\n"
      "property double y\r\nproperty double z\r\nproperty float nx\r\nproperty uint8 red\r\n"
      "property uint8 green\r\nproperty uint8 blue\r\nelement face 0\r\n"
      "property list uchar int vertex_indices\r\nend_header\r\n1 2 3 0 10 20 30\n-1.5 0 4 1 255 0 "
      "9\n";
  const auto text = std::as_bytes(std::span(ascii));
  const PointSet got = value(baseline::from_ply(text, 10));
  EXPECT_EQ(got.positions, (std::vector<Vec3f>{{1, 2, 3}, {-1.5f, 0, 4}}));
  EXPECT_EQ(got.colors[1], (std::array<std::uint8_t, 3>{255, 0, 9}));
  EXPECT_FALSE(baseline::from_ply(text.first(text.size() - 12), 10));
  EXPECT_FALSE(baseline::from_ply(text.first(100), 10));
  EXPECT_FALSE(baseline::from_ply({}, 10));
}

/// A PATH with stand-ins for MPEG's programs, which pack the .ply as it is.
class VpccStandIn : public testing::Test {
 protected:
  VpccStandIn() : before_(getenv("PATH")) {
    setenv("PATH", (folder() + ":" + before_).c_str(), 1);
    setenv("TMPDIR", temp_.path().c_str(), 1);
  }
  ~VpccStandIn() override {
    setenv("PATH", before_.c_str(), 1);
    unsetenv("TMPDIR");
  }

  std::string folder() const { return dir_.path().string(); }
  void program(const std::string& name, const std::string& script) const {
    const auto file = dir_.path() / name;
    std::ofstream(file) << "#!/bin/sh\n" << script;
    std::filesystem::permissions(file, std::filesystem::perms::owner_all);
  }
  /// Copies the file named by one option to that named by another.
  void packer(const std::string& name, const std::string& from, const std::string& to) const {
    program(name, "for a in \"$@\"; do case \"$a\" in --" + from + "=*) i=${a#*=};; --" + to +
                      "=*) o=${a#*=};; esac; done\necho noise; cp \"$i\" \"$o\"\n");
  }
  void both() const {
    packer("PccAppEncoder", "uncompressedDataPath", "compressedStreamPath");
    packer("PccAppDecoder", "compressedStreamPath", "reconstructedDataPath");
  }

  test::TempDir dir_, temp_;
  std::string before_;
};

TEST_F(VpccStandIn, BothProgramsMustBeThere) {
  packer("PccAppEncoder", "uncompressedDataPath", "compressedStreamPath");
  setenv("PATH", folder().c_str(), 1);
  EXPECT_FALSE(baseline::find_vpcc());
  program("PccAppDecoder", "");
  EXPECT_TRUE(baseline::find_vpcc());
}

TEST_F(VpccStandIn, PointsGoThroughThePrograms) {
  both();
  const auto programs = baseline::find_vpcc();
  ASSERT_TRUE(programs);
  const PointSet points = some_points(500);
  const Bytes bytes = value(baseline::encode_vpcc_points(*programs, points, 0.01));
  const PointSet got = value(baseline::decode_vpcc_points(*programs, bytes, 1000));
  ASSERT_EQ(got.positions.size(), 500u);
  EXPECT_EQ(got.colors, points.colors);
  for (std::size_t i = 0; i < 500; ++i)
    EXPECT_LT(length(got.positions[i] - points.positions[i]), 0.0087f);  // half a voxel's diagonal
  EXPECT_FALSE(baseline::decode_vpcc_points(*programs, bytes, 499));
  EXPECT_FALSE(baseline::decode_vpcc_points(*programs, std::span(bytes).first(20), 1000));
  EXPECT_TRUE(std::filesystem::is_empty(temp_.path()));  // nothing is left behind
}

TEST_F(VpccStandIn, TheBaselineSaysThatItUsesThem) {
  both();
  test::Rig rig("points", 1, 1);
  EXPECT_EQ(rig.system->name(), "point cloud (V-PCC)");
  const auto geometry =
      value(rig.system->decode_geometry(value(rig.system->encode_geometry(rig.captures[0]))));
  EXPECT_GT(geometry.chunks.front()->mesh.positions.size(), 1000u);
}

TEST_F(VpccStandIn, FailuresAreErrors) {
  program("PccAppEncoder", "exit 3\n");
  program("PccAppDecoder", "exit 0\n");
  auto programs = *baseline::find_vpcc();
  const PointSet points = some_points(10);
  EXPECT_FALSE(baseline::encode_vpcc_points(programs, points, 0.01));  // exit code
  program("PccAppEncoder", "exit 0\n");
  EXPECT_FALSE(baseline::encode_vpcc_points(programs, points, 0.01));  // no file
  program("PccAppEncoder", "sleep 60 & sleep 60\n");
  programs.limit = std::chrono::seconds(1);
  const auto late = baseline::encode_vpcc_points(programs, points, 0.01);
  ASSERT_FALSE(late);
  EXPECT_NE(late.error().message.find("too long"), std::string::npos);
  EXPECT_TRUE(std::filesystem::is_empty(temp_.path()));
}

TEST(Points, WithoutThemDracoIsNamed) {
  if (baseline::find_vpcc()) GTEST_SKIP() << "V-PCC is installed";
  EXPECT_EQ(test::Rig("points", 1, 1).system->name(), "point cloud (Draco)");
}

TEST(FlyingPixels, OfALidarGoByItsRowsAndWrap) {
  Camera camera;
  camera.model = CameraModel::lidar;
  camera.width = 256, camera.height = 16;
  for (int row = 0; row < 16; ++row) camera.beam_altitude_rad.push_back(0.2 - 0.03 * row);
  camera.beam_azimuth_rad.assign(16, 0);
  ImageDepth depth(256, 16, 3.0f);  // a wall all around
  *depth.at(100, 8) = 1.5f;         // a speck in front of it
  baseline::drop_flying_pixels(depth, camera, {});
  EXPECT_EQ(*depth.at(100, 8), 0);
  EXPECT_EQ(std::count(depth.data.begin(), depth.data.end(), 0.0f), 1);
}

}  // namespace
}  // namespace mr
