#include "mr/core/camera.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace mr {
namespace {

constexpr double kPi = std::numbers::pi;

Camera pinhole(DistortionModel distortion = DistortionModel::none) {
  Camera c;
  c.width = 640, c.height = 576;
  c.fx = 504.6, c.fy = 504.7, c.cx = 332.8, c.cy = 348.8;
  c.distortion = distortion;
  if (distortion == DistortionModel::brown) {
    c.k = {-0.28, 0.09, -0.01};
    c.p = {0.0012, -0.0007};
  } else if (distortion != DistortionModel::none) {
    c.k = {0.45, -2.6, 1.5, 0.33, -2.4, 1.43};
    c.p = {0.0006, -0.0002};
  }
  return c;
}

Camera equirectangular() {
  Camera c;
  c.model = CameraModel::equirectangular;
  c.width = 256, c.height = 128;
  return c;
}

Camera lidar() {
  Camera c;
  c.model = CameraModel::lidar;
  c.width = 512, c.height = 16;
  for (int row = 0; row < c.height; ++row) {
    c.beam_altitude_rad.push_back((15 - 2 * row) * kPi / 180);
    c.beam_azimuth_rad.push_back((row % 4 - 1.5) * kPi / 180);
  }
  return c;
}

void expect_pixel(const Camera& camera, Vec3d point, Vec2d pixel, double tolerance = 1e-8) {
  const auto at = project(camera, point);
  ASSERT_TRUE(at);
  EXPECT_NEAR(at->x, pixel.x, tolerance);
  EXPECT_NEAR(at->y, pixel.y, tolerance);
}

double turn_between(Vec3d a, Vec3d b) { return length(normalized(a) - normalized(b)); }

TEST(Pinhole, ProjectsAsWorkedOutByHand) {
  expect_pixel(pinhole(), {1, -0.5, 2}, {332.8 + 252.3, 348.8 - 126.175});
  EXPECT_EQ(unproject(pinhole(), {332.8, 348.8}), (Vec3d{0, 0, 1}));
  EXPECT_FALSE(project(pinhole(), {1, 1, 0}));
  EXPECT_FALSE(project(pinhole(), {0, 0, -1}));
  EXPECT_FALSE(project(pinhole(), {0, 0, 0}));
  EXPECT_FALSE(project(pinhole(), {NAN, 0, 1}));
}

// The numbers were made by python3 from the formula in OpenCV's documentation, in powers of r:
//   x = X/Z; y = Y/Z; r2 = x**2 + y**2
//   c = (1 + k1*r2 + k2*r2**2 + k3*r2**3) / (1 + k4*r2 + k5*r2**2 + k6*r2**3)
//   u = fx*(x*c + 2*p1*x*y + p2*(r2 + 2*x**2)) + cx
//   v = fy*(y*c + p1*(r2 + 2*y**2) + 2*p2*x*y) + cy
TEST(Pinhole, BrownMatchesReference) {
  const Camera c = pinhole(DistortionModel::brown);
  expect_pixel(c, {0.3, -0.2, 1.0}, {478.714530561, 251.552483112});
  expect_pixel(c, {-0.5, 0.4, 1.25}, {144.21455706, 499.783010255});
  expect_pixel(c, {0.0, 0.0, 2.0}, {332.8, 348.8});
  expect_pixel(c, {0.9, 0.6, 1.5}, {598.273063379, 526.25452265});
}

TEST(Pinhole, RationalMatchesReference) {
  const Camera c = pinhole(DistortionModel::rational);
  expect_pixel(c, {0.3, -0.2, 1.0}, {485.975315876, 246.693504023});
  expect_pixel(c, {-0.5, 0.4, 1.25}, {126.778740787, 513.707940916});
  expect_pixel(c, {0.0, 0.0, 2.0}, {332.8, 348.8});
  expect_pixel(c, {0.9, 0.6, 1.5}, {643.1783945, 555.952395126});
}

TEST(Pinhole, EarlyKinectsHaveHalfTheMixedTerms) {
  const Camera usual = pinhole(DistortionModel::rational);
  Camera early = usual;
  early.distortion = DistortionModel::rational_6kt;
  const Vec3d p{0.3, -0.2, 1};
  expect_pixel(early, p,
               *project(usual, p) -
                   Vec2d{early.fx * early.p[0] * p.x * p.y, early.fy * early.p[1] * p.x * p.y});
}

TEST(Pinhole, EveryPixelComesBack) {
  for (const auto model : {DistortionModel::none, DistortionModel::brown, DistortionModel::rational,
                           DistortionModel::rational_6kt}) {
    const Camera c = pinhole(model);
    ASSERT_TRUE(c.problems().empty()) << c.problems()[0];
    for (int y = 0; y < c.height; y += 5)
      for (int x = 0; x < c.width; x += 5) {
        const Vec3d direction = unproject(c, {double(x), double(y)});
        ASSERT_EQ(direction.z, 1);
        const auto back = project(c, 2.5 * direction);
        ASSERT_TRUE(back) << x << " " << y;
        ASSERT_NEAR(back->x, x, 1e-6);
        ASSERT_NEAR(back->y, y, 1e-6);
      }
  }
}

TEST(Pinhole, PointsBeyondTheFoldOfTheDistortionAreNotSeen) {
  Camera c = pinhole(DistortionModel::brown);
  c.k = {-0.3, 0, 0};  // r (1 - 0.3 r²) falls beyond r = 1.054
  c.p = {};
  EXPECT_TRUE(project(c, {0.9, 0, 1}));
  EXPECT_FALSE(project(c, {1.2, 0, 1}));
  EXPECT_FALSE(project(c, {20, 0, 1}));
}

TEST(Pinhole, UndistortedKeepsTheRest) {
  const Camera c = undistorted(pinhole(DistortionModel::brown));
  EXPECT_EQ(c, pinhole());
}

TEST(Equirectangular, KnownDirections) {
  const Camera c = equirectangular();
  expect_pixel(c, {0, 0, 3}, {127.5, 63.5});
  expect_pixel(c, {2, 0, 0}, {191.5, 63.5});
  expect_pixel(c, {-2, 0, 0}, {63.5, 63.5});
  expect_pixel(c, {0, 1, 1}, {127.5, 95.5});
  expect_pixel(c, {1, 1, 1}, {159.5, (std::atan(std::sqrt(0.5)) / kPi + 0.5) * 128 - 0.5});
}

TEST(Equirectangular, EveryPixelComesBack) {
  const Camera c = equirectangular();
  for (int y = 0; y < c.height; ++y)
    for (int x = 0; x < c.width; ++x) {
      const Vec3d direction = unproject(c, {double(x), double(y)});
      ASSERT_NEAR(length(direction), 1, 1e-12);
      const auto back = project(c, 4.0 * direction);
      ASSERT_TRUE(back);
      ASSERT_NEAR(back->x, x, 1e-7);
      ASSERT_NEAR(back->y, y, 1e-7);
    }
}

TEST(Equirectangular, TheSeamAndThePolesHoldTogether) {
  const Camera c = equirectangular();
  // The picture's left and right edges are one line, straight behind.
  EXPECT_LT(turn_between(unproject(c, {-0.5, 40}), unproject(c, {255.5, 40})), 1e-12);
  EXPECT_LT(turn_between(unproject(c, {-0.5, 63.5}), {0, 0, -1}), 1e-12);
  const auto right = project(c, {1e-9, 0, -1}), left = project(c, {-1e-9, 0, -1});
  ASSERT_TRUE(right && left);
  EXPECT_NEAR(right->x, 255.5, 1e-6);
  EXPECT_NEAR(left->x, -0.5, 1e-6);
  // Top and bottom edges are points.
  for (const double x : {0.0, 77.0, 255.0}) {
    EXPECT_LT(turn_between(unproject(c, {x, -0.5}), {0, -1, 0}), 1e-12);
    EXPECT_LT(turn_between(unproject(c, {x, 127.5}), {0, 1, 0}), 1e-12);
  }
  EXPECT_NEAR(project(c, {0, -1, 0})->y, -0.5, 1e-9);
  EXPECT_NEAR(project(c, {0, 1, 0})->y, 127.5, 1e-9);
}

TEST(Lidar, EveryBeamComesBack) {
  const Camera c = lidar();
  ASSERT_TRUE(c.problems().empty());
  for (int y = 0; y < c.height; ++y)
    for (int x = 0; x < c.width; ++x) {
      const Vec3d direction = unproject(c, {double(x), double(y)});
      ASSERT_NEAR(length(direction), 1, 1e-12);
      const auto back = project(c, 10.0 * direction);
      ASSERT_TRUE(back);
      const double off = std::abs(back->x - x);
      ASSERT_LT(std::min(off, c.width - off), 1e-7) << x << " " << y;
      ASSERT_EQ(back->y, y);
    }
}

TEST(Lidar, TheFirstBeamPointsUp) {
  const Camera c = lidar();
  EXPECT_LT(unproject(c, {100, 0}).y, 0);
  EXPECT_NEAR(std::asin(-unproject(c, {100, 0}).y), 15 * kPi / 180, 1e-12);
}

TEST(CameraProblems, NamesWhatIsImpossible) {
  const auto problems_with = [](auto change) {
    Camera c = pinhole();
    change(c);
    return c.problems().size();
  };
  EXPECT_EQ(problems_with([](Camera&) {}), 0u);
  EXPECT_GT(problems_with([](Camera& c) { c.width = 0; }), 0u);
  EXPECT_GT(problems_with([](Camera& c) { c.fx = -500; }), 0u);
  EXPECT_GT(problems_with([](Camera& c) { c.fy = 1e9; }), 0u);
  EXPECT_GT(problems_with([](Camera& c) { c.cx = 640; }), 0u);
  EXPECT_GT(problems_with([](Camera& c) { c.k[0] = NAN; }), 0u);
  EXPECT_GT(problems_with([](Camera& c) {
              c.distortion = DistortionModel::brown;
              c.k[0] = -20;
            }),
            0u);
  Camera short_table = lidar();
  short_table.beam_altitude_rad.pop_back();
  EXPECT_EQ(short_table.problems().size(), 1u);
}

TEST(Camera, HasNoImageBeyondTheRadiusOfItsLens) {
  Camera camera;
  camera.width = 100, camera.height = 100;
  camera.fx = camera.fy = 50, camera.cx = camera.cy = 50;
  camera.distortion = DistortionModel::rational;
  camera.k[0] = 0.01;
  EXPECT_TRUE(project(camera, {1.2, 0, 1}).has_value());
  camera.most_radius = 1;
  EXPECT_TRUE(project(camera, {0.9, 0, 1}).has_value());
  EXPECT_FALSE(project(camera, {1.2, 0, 1}).has_value());
  EXPECT_EQ(undistorted(camera).most_radius, 0);
}

}  // namespace
}  // namespace mr
