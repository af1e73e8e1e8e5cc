#include "mr/sensor/floor.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace mr::sensor {
namespace {

constexpr int kTable = 20 * 48;  // pixels

/// A camera 2 m above the floor that looks straight down on it and on a table half a metre high;
/// up is -y of the world.
struct Scene {
  Camera camera;
  Pose T_world_camera = look_at({0, -2, 0}, {0, 0, 0}, {0, 0, 1});
  ImageDepth depth{64, 48, 2.0f};

  Scene() {
    camera.width = 64, camera.height = 48;
    camera.fx = camera.fy = 60, camera.cx = 31.5, camera.cy = 23.5;
    for (int x = 0; x < 20; ++x)
      for (int y = 0; y < 48; ++y) *depth.at(x, y) = 1.5f;
  }
  long without(FloorConfig floor) {
    remove_floor(depth, camera, T_world_camera, floor, {0, -1, 0});
    return std::count_if(depth.data.begin(), depth.data.end(), [](float d) { return d > 0; });
  }
};

TEST(Floor, GoesAndWhatStandsOnItStays) {
  Scene s;
  EXPECT_EQ(s.without({0, 0.03}), kTable);
  EXPECT_GT(*s.depth.at(5, 5), 0);
  EXPECT_EQ(*s.depth.at(40, 5), 0);
}

TEST(Floor, HeightAndMarginCount) {
  EXPECT_EQ(Scene().without({0.6, 0}), 0);
  EXPECT_EQ(Scene().without({0.48, 0.03}), 0);
  EXPECT_EQ(Scene().without({0.48, 0.01}), kTable);
  EXPECT_EQ(Scene().without({-0.1, 0}), 64 * 48);
}

TEST(Floor, OfALidarGoesByRangeAlongTheRay) {
  Camera camera;
  camera.model = CameraModel::lidar;
  camera.width = 32, camera.height = 8;
  for (int row = 0; row < 8; ++row) camera.beam_altitude_rad.push_back(-0.1 - 0.18 * row);
  camera.beam_azimuth_rad.assign(8, 0);
  const Pose T_world_camera{{}, {0, -2, 0}};  // upright, 2 m above the floor
  ImageDepth depth(32, 8);
  for (int y = 0; y < 8; ++y)  // the floor, and a table half a metre high on the right half
    for (int x = 0; x < 32; ++x)
      *depth.at(x, y) = static_cast<float>((x < 16 ? 2 : 1.5) / std::sin(0.1 + 0.18 * y));
  remove_floor(depth, camera, T_world_camera, {0, 0.03}, {0, -1, 0});
  for (int y = 0; y < 8; ++y)
    for (int x = 0; x < 32; ++x) EXPECT_EQ(*depth.at(x, y) > 0, x >= 16) << x << " " << y;
}

}  // namespace
}  // namespace mr::sensor
