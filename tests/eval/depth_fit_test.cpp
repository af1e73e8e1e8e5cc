#include "mr/eval/depth_fit.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <utility>
#include <vector>

#include "support/meshes.h"
#include "support/rays.h"

namespace mr {
namespace {

constexpr double kVoxel_m = 0.01;

/// A sensor in the origin that looks along z and reads 2 m everywhere.
struct OneSensor {
  OneSensor() {
    SensorConfig sensor;
    sensor.id = "cam";
    sensor.depth_camera = test::small_camera();
    sensor.depth_near_m = 0.5, sensor.depth_far_m = 4;
    scene.sensors.push_back(sensor);
    Frame& frame = capture.emplace_back();
    frame.depth = ImageDepth(sensor.depth_camera.width, sensor.depth_camera.height);
    std::fill(frame.depth.data.begin(), frame.depth.data.end(), 2.0f);
  }
  eval::DepthFit fit(const Mesh& shown) const {
    return eval::depth_fit(shown, scene, capture, kVoxel_m);
  }

  Scene scene;
  std::vector<Frame> capture;
};

/// Faces the sensor; from x = -2 on.
Mesh wall(float z, float width = 4) {
  return test::grid({-2, 2, z}, {width, 0, 0}, {0, -4, 0}, 20, 20);
}

TEST(DepthFit, AWholeSurfaceAgrees) {
  const eval::DepthFit fit = OneSensor().fit(wall(2));
  EXPECT_EQ(fit.pixels, 80u * 72u);
  EXPECT_EQ(fit.hole_ratio, 0);
  EXPECT_EQ(fit.agreement, 1);
  EXPECT_EQ(fit.beyond_1_voxel, 0);
}

TEST(DepthFit, WhatIsMissingIsAHole) {
  const eval::DepthFit fit = OneSensor().fit(wall(2, 2));  // the left half
  EXPECT_NEAR(fit.hole_ratio, 0.5, 0.01);
  EXPECT_NEAR(fit.agreement, 0.5, 0.01);
  EXPECT_NEAR(fit.beyond_3_voxels, 0.5, 0.03);
}

TEST(DepthFit, BehindIsAHoleAndBeforeIsNot) {
  const OneSensor setup;
  const eval::DepthFit behind = setup.fit(wall(2.05f)), before = setup.fit(wall(1.95f)),
                       near = setup.fit(wall(1.98f));
  EXPECT_EQ(behind.hole_ratio, 1);
  EXPECT_EQ(behind.agreement, 0);
  EXPECT_EQ(behind.beyond_3_voxels, 1);
  EXPECT_EQ(before.hole_ratio, 0);
  EXPECT_EQ(before.agreement, 0);
  EXPECT_GT(near.agreement, 0.8);  // along slanted rays it is a little farther
  EXPECT_EQ(near.beyond_1_voxel, 1);
  EXPECT_EQ(near.beyond_3_voxels, 0);
}

TEST(DepthFit, BackFacesShowNothing) {
  Mesh turned = wall(2);
  for (Triangle& t : turned.triangles) std::swap(t[1], t[2]);
  const eval::DepthFit fit = OneSensor().fit(turned);
  EXPECT_EQ(fit.hole_ratio, 1);
  EXPECT_EQ(fit.beyond_1_voxel, 0) << "it is there, though";
  append(turned, wall(2.02f));  // behind it
  EXPECT_EQ(OneSensor().fit(turned).hole_ratio, 0);
}

TEST(DepthFit, OnlyDepthInRangeAndVolumeCounts) {
  OneSensor setup;
  setup.scene.sensors[0].depth_far_m = 1.5;
  EXPECT_EQ(setup.fit(wall(2)).pixels, 0u);
  EXPECT_EQ(setup.fit(wall(2)).agreement, 0);
  setup.scene.sensors[0].depth_far_m = 4;
  setup.scene.volume = Box3d{{0, -5, 0}, {5, 5, 5}};
  EXPECT_EQ(setup.fit(wall(2)).pixels, 40u * 72u);
}

}  // namespace
}  // namespace mr
