#include "mr/baseline/vertex_colors.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "support/sensor_rig.h"

namespace mr {
namespace {

using Color = std::array<std::uint8_t, 3>;

/// Sensors before a wall whose pictures have one colour each; what their grid shows.
DecodedScene colored(const Scene& scene, const test::Solids& solids,
                     const std::vector<Color>& pictures) {
  std::vector<Frame> capture;
  for (std::size_t s = 0; s < pictures.size(); ++s) {
    Frame frame = test::frame_of(scene, sensor_at(s), 0, solids);
    for (std::size_t i = 0; i < frame.color.data.size(); ++i)
      frame.color.data[i] = pictures[s][i % 3];
    capture.push_back(std::move(frame));
  }
  auto made = baseline::vertex_colored_scene(scene, capture);
  if (made) return *std::move(made);
  ADD_FAILURE() << made.error().message;
  return {};
}

Vec3d color_camera(const Scene& scene, std::size_t sensor) {
  const SensorConfig& config = scene.sensors[sensor];
  return (config.T_world_depth[0] * config.T_color_depth.inverse()).translation;
}

TEST(VertexColors, AreTheMeanOfAllCamerasByAngle) {
  const Scene scene =
      test::scene_of_sensors({test::facing_the_wall(), test::facing_the_wall({0.8, 0, 0})});
  const DecodedScene shown = colored(scene, test::wall(), {{200, 0, 40}, {0, 100, 40}});
  ASSERT_EQ(shown.chunks.size(), 1u);
  const Chunk& chunk = *shown.chunks[0];
  ASSERT_EQ(chunk.colors.size(), chunk.mesh.positions.size());
  int both = 0;
  for (std::size_t v = 0; v < chunk.colors.size(); ++v) {
    const Vec3d p = vec_cast<double>(chunk.mesh.positions[v]);
    if (std::abs(p.x - 0.4) > 0.5 || std::abs(p.y) > 0.5) continue;  // seen by both
    const double a = test::kWall_m / length(p - color_camera(scene, 0));
    const double b = test::kWall_m / length(p - color_camera(scene, 1));
    EXPECT_NEAR(chunk.colors[v][0], 200 * a / (a + b), 2);
    EXPECT_NEAR(chunk.colors[v][1], 100 * b / (a + b), 2);
    EXPECT_EQ(chunk.colors[v][2], 40);
    ++both;
  }
  EXPECT_GT(both, 100);
}

TEST(VertexColors, WhatACameraDoesNotSeeItDoesNotColor) {
  const Scene scene =
      test::scene_of_sensors({test::facing_the_wall(), test::facing_the_wall({0.8, 0, 0})});
  // A box hides from the first camera a piece of the wall that the second sees.
  const DecodedScene shown =
      colored(scene, test::wall_with_box({-0.15, -0.15, 1.0}), {{200, 0, 0}, {0, 0, 200}});
  const Chunk& chunk = *shown.chunks.at(0);
  int hidden = 0, beside = 0;
  for (std::size_t v = 0; v < chunk.colors.size(); ++v) {
    const Vec3d p = vec_cast<double>(chunk.mesh.positions[v]);
    if (std::abs(p.z - test::kWall_m) > 0.05 || std::abs(p.y) > 0.1) continue;
    if (std::abs(p.x) < 0.2) {
      EXPECT_EQ(chunk.colors[v], (Color{0, 0, 200})) << p.x << ' ' << p.y;
      ++hidden;
    }
    if (p.x > 0.55 && p.x < 0.8) {
      EXPECT_GT(chunk.colors[v][0], 60) << "both see it";
      ++beside;
    }
  }
  EXPECT_GT(hidden, 10);
  EXPECT_GT(beside, 10);
}

TEST(VertexColors, WhatNoCameraSeesGetsItsNeighboursColor) {
  Scene scene = test::scene_of_sensors({test::facing_the_wall()});
  scene.sensors[0].color_camera = test::pinhole(40, 40, 120);  // the middle only
  const DecodedScene shown = colored(scene, test::wall(), {{10, 150, 90}});
  for (const Color& color : shown.chunks.at(0)->colors) EXPECT_EQ(color, (Color{10, 150, 90}));
}

TEST(VertexColors, NeedColorAndASurface) {
  Scene scene = test::scene_of_sensors({test::facing_the_wall()});
  std::vector<Frame> capture{test::frame_of(scene, sensor_at(0), 0, test::wall())};
  std::ranges::fill(capture[0].depth.data, 0.0f);
  EXPECT_FALSE(baseline::vertex_colored_scene(scene, capture));
  capture[0] = test::frame_of(scene, sensor_at(0), 0, test::wall());
  EXPECT_TRUE(baseline::vertex_colored_scene(scene, capture));
  capture[0].color = {};
  EXPECT_FALSE(baseline::vertex_colored_scene(scene, capture));
}

}  // namespace
}  // namespace mr
