#include "mr/sensor/registration.h"

#include <gtest/gtest.h>

#include <cmath>

namespace mr::sensor {
namespace {

/// A lens with strong barrel distortion, well inside the range where it can be inverted.
Camera bent_camera(int width, int height) {
  Camera c;
  c.width = width, c.height = height;
  c.fx = c.fy = 0.8 * width, c.cx = 0.49 * width, c.cy = 0.52 * height;
  c.distortion = DistortionModel::brown;
  c.k = {-0.18, 0.04, 0.0, 0, 0, 0};
  c.p = {0.001, -0.002};
  return c;
}

SensorConfig bent_sensor() {
  SensorConfig sensor;
  sensor.depth_camera = bent_camera(160, 144);
  sensor.color_camera = bent_camera(200, 120);
  sensor.T_color_depth.translation = {-0.03, 0, 0};
  return sensor;
}

/// Depth of the plane n · p = d along a viewing ray with z = 1.
double plane_depth(Vec3d ray, Vec3d n, double d) { return d / dot(n, ray); }

TEST(Registration, APlaneSeenThroughABentLensComesOutStraight) {
  const SensorConfig sensor = bent_sensor();
  const Vec3d n = normalized(Vec3d{0.15, -0.1, 1.0});
  const double d = 2.0;
  Frame frame;
  frame.depth = ImageDepth(160, 144);
  for (int y = 0; y < 144; ++y)
    for (int x = 0; x < 160; ++x)
      *frame.depth.at(x, y) = static_cast<float>(
          plane_depth(unproject(sensor.depth_camera, {double(x), double(y)}), n, d));

  const Registration registration(sensor, SensorId{0});
  const Frame straight = registration.undistort(frame);
  const Camera& pinhole = registration.depth_camera();
  EXPECT_EQ(pinhole.distortion, DistortionModel::none);
  int covered = 0;
  double worst = 0;
  for (int y = 0; y < 144; ++y)
    for (int x = 0; x < 160; ++x) {
      const float z = *straight.depth.at(x, y);
      if (z == 0) continue;
      ++covered;
      const Vec3d ray = unproject(pinhole, {double(x), double(y)});
      worst = std::max(worst, std::abs(z - plane_depth(ray, n, d)));
    }
  EXPECT_GT(covered, 160 * 144 * 95 / 100);
  // Nearest pixel: at most 0.8 source pixels off, on a plane that changes by under 6 mm a pixel.
  EXPECT_LT(worst, 0.006);
}

TEST(Registration, AWideLensKeepsItsRim) {
  SensorConfig sensor = bent_sensor();
  Camera& wide = sensor.depth_camera;
  wide.fx = wide.fy = 0.55 * wide.width;
  wide.k = {-0.25, 0.05, 0, 0, 0, 0};
  const Camera pinhole = Registration(sensor, SensorId{0}).depth_camera();
  EXPECT_EQ(pinhole.width, wide.width);
  for (const Vec2d edge : {Vec2d{0, wide.cy}, {159, wide.cy}, {wide.cx, 0}, {wide.cx, 143}}) {
    const auto seen = project(pinhole, unproject(wide, edge));
    ASSERT_TRUE(seen.has_value());
    EXPECT_TRUE(seen->x > -1 && seen->x < 160 && seen->y > -1 && seen->y < 144)
        << seen->x << " " << seen->y;
    const auto cut = project(undistorted(wide), unproject(wide, edge));
    EXPECT_TRUE(cut->x < -4 || cut->x > 163 || cut->y < -4 || cut->y > 147) << "the test is none";
  }
}

TEST(Registration, ColourLinesBecomeStraight) {
  const SensorConfig sensor = bent_sensor();
  const Camera& bent = *sensor.color_camera;
  // In the world of rays, brightness grows linearly with the ray's x: undistorted it must be
  // linear in the pixel column.
  const auto value = [](double ray_x) { return 128 + 150 * ray_x; };
  Frame frame;
  frame.color = ImageRgb(bent.width, bent.height);
  for (int y = 0; y < bent.height; ++y)
    for (int x = 0; x < bent.width; ++x)
      for (int c = 0; c < 3; ++c)
        frame.color.at(x, y)[c] = static_cast<std::uint8_t>(
            std::lround(value(unproject(bent, {double(x), double(y)}).x)));
  const Frame straight = Registration(sensor, SensorId{0}).undistort(frame);
  for (int y = 10; y < bent.height - 10; ++y)
    for (int x = 10; x < bent.width - 10; ++x)
      ASSERT_NEAR(straight.color.at(x, y)[1], value((x - bent.cx) / bent.fx), 1.1) << x << "," << y;
}

TEST(Registration, PixelsOutsideTheOriginalAreEmpty) {
  SensorConfig sensor = bent_sensor();
  for (Camera* c : {&sensor.depth_camera, &*sensor.color_camera}) c->k = {0.25, 0, 0}, c->p = {};
  Frame frame;
  frame.depth = ImageDepth(160, 144, 1.0f);
  frame.color = ImageRgb(200, 120, 255);
  const Frame straight = Registration(sensor, SensorId{0}).undistort(frame);
  EXPECT_EQ(*straight.depth.at(0, 0), 0);
  EXPECT_EQ(straight.color.at(0, 0)[0], 0);
  EXPECT_EQ(*straight.depth.at(80, 72), 1.0f);
  EXPECT_EQ(straight.color.at(100, 60)[2], 255);
}

TEST(Registration, StraightPicturesPassThroughUntouched) {
  SensorConfig sensor = bent_sensor();
  sensor.depth_camera = undistorted(sensor.depth_camera);
  sensor.color_camera.reset();
  Frame frame;
  frame.depth = ImageDepth(160, 144, 1.5f);
  const Registration registration(sensor, SensorId{0});
  EXPECT_EQ(registration.undistort(frame).depth, frame.depth);
  EXPECT_FALSE(registration.color_view({}));
}

TEST(Registration, TheColourViewStandsBesideTheDepthCamera) {
  Pose T_world_depth = look_at({1, 2, 3}, {0, 0, 0}, {0, 0, 1});
  const auto view = Registration(bent_sensor(), SensorId{7}).color_view(T_world_depth);
  ASSERT_TRUE(view);
  EXPECT_EQ(view->id, ViewId{7});
  EXPECT_EQ(view->kind, View::Kind::pinhole);
  EXPECT_EQ(view->image_rect, (Rect{0, 0, 200, 120}));
  EXPECT_EQ(view->atlas_rect, view->image_rect);
  EXPECT_EQ(view->camera(), undistorted(bent_camera(200, 120)));
  const Vec3d p_color = view->T_world_camera.inverse() * (T_world_depth * Vec3d{0.1, 0.2, 2});
  EXPECT_NEAR(p_color.x, 0.07, 1e-12);
  EXPECT_NEAR(p_color.y, 0.2, 1e-12);
  EXPECT_NEAR(p_color.z, 2, 1e-12);
}

}  // namespace
}  // namespace mr::sensor
