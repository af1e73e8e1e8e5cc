#include "mr/node/capture.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace mr::node {
namespace {

/// A wall 2 m away whose right half lies a little nearer.
Frame stepped_wall(const Camera& camera, float step_m) {
  Frame frame;
  frame.depth = ImageDepth(camera.width, camera.height, 2.0f);
  for (int y = 0; y < camera.height; ++y)
    for (int x = camera.width / 2; x < camera.width; ++x) *frame.depth.at(x, y) = 2 - step_m;
  return frame;
}

float largest_change(const ImageDepth& a, const ImageDepth& b) {
  float most = 0;
  for (std::size_t i = 0; i < a.data.size(); ++i)
    most = std::max(most, std::abs(a.data[i] - b.data[i]));
  return most;
}

TEST(PrepareDepth, AStepIsNoNoiseInTheMeanOfManyReadings) {
  Scene scene;
  scene.sensors.resize(1);
  Camera camera;
  camera.width = 64, camera.height = 48, camera.fx = camera.fy = 504;
  camera.cx = 31.5, camera.cy = 23.5;
  const Frame wall = stepped_wall(camera, 0.004f);
  EXPECT_GT(largest_change(prepare_depth(scene, camera, wall), wall.depth), 0.001f)
      << "in one reading it may be noise";
  EXPECT_LT(largest_change(prepare_depth(scene, camera, wall, 32), wall.depth), 0.0002f);
}

}  // namespace
}  // namespace mr::node
