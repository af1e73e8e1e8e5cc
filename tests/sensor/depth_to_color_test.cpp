#include "mr/sensor/depth_to_color.h"

#include <gtest/gtest.h>

#include <cmath>

#include "mr/sensor/azure_kinect/calibration.h"

namespace mr::sensor {
namespace {

Camera pinhole(int width, int height, double focal_px) {
  Camera out;
  out.width = width, out.height = height;
  out.fx = out.fy = focal_px;
  out.cx = (width - 1) / 2.0, out.cy = (height - 1) / 2.0;
  return out;
}

const Camera kDepthCamera = pinhole(160, 120, 140), kColorCamera = pinhole(320, 240, 280);
/// The colour camera lies 5 cm to the right of the depth camera.
const Pose kRight{{}, {-0.05, 0, 0}};

/// A square of 0.3 m at 1 m, before a wall at 3 m, as the depth camera sees it.
ImageDepth square_before_wall() {
  ImageDepth out(160, 120, 3);
  for (int y = 0; y < 120; ++y)
    for (int x = 0; x < 160; ++x) {
      const Vec3d ray = unproject(kDepthCamera, {double(x), double(y)});
      if (std::abs(ray.x) < 0.15 && std::abs(ray.y) < 0.15) *out.at(x, y) = 1;
    }
  return out;
}

/// The same in the colour camera: a red square before a blue wall.
ImageRgb red_before_blue() {
  ImageRgb out(320, 240);
  for (int y = 0; y < 240; ++y)
    for (int x = 0; x < 320; ++x) {
      const Vec3d at = kRight.inverse() * unproject(kColorCamera, {double(x), double(y)});
      out.at(x, y)[std::abs(at.x) < 0.15 && std::abs(at.y) < 0.15 ? 0 : 2] = 255;
    }
  return out;
}

TEST(DepthInColor, AWallKeepsItsDistance) {
  const ImageDepth wall(160, 120, 2);
  const Pose behind{{}, {-0.05, 0, 0.1}};  // the colour camera lies 10 cm behind
  const ImageDepth out = depth_in_color(wall, kDepthCamera, kColorCamera, behind);
  int seen = 0;
  for (const float m : out.data) {
    if (m == 0) continue;
    ASSERT_NEAR(m, 2.1, 1e-5);
    ++seen;
  }
  // The wall's part that the depth camera sees, without half a pixel around it.
  const double wide = 2.0 * 159 / 140 / 2.1 * 280, high = 2.0 * 119 / 140 / 2.1 * 280;
  EXPECT_NEAR(seen, wide * high, 0.02 * wide * high);
}

TEST(DepthInColor, TheNearestIsKeptAndNothingIsDrawnAcrossAnEdge) {
  const ImageDepth out = depth_in_color(square_before_wall(), kDepthCamera, kColorCamera, kRight);
  for (const float m : out.data)
    EXPECT_TRUE(m == 0 || std::abs(m - 1) < 1e-5 || std::abs(m - 3) < 1e-5) << m;
  const auto at = [&](Vec3d p) {
    const auto pixel = project(kColorCamera, kRight * p);
    return *out.at(static_cast<int>(std::lround(pixel->x)),
                   static_cast<int>(std::lround(pixel->y)));
  };
  EXPECT_FLOAT_EQ(at({0, 0, 1}), 1);
  EXPECT_FLOAT_EQ(at({-0.13, 0.13, 1}), 1);
  EXPECT_FLOAT_EQ(at({1, 0, 3}), 3);
  EXPECT_EQ(at({0.4, 0, 3}), 0) << "only the colour camera sees this part of the wall";
}

TEST(DepthInColor, InvalidPixelsLeaveHoles) {
  ImageDepth wall(160, 120, 2);
  for (int y = 50; y < 60; ++y)
    for (int x = 70; x < 80; ++x) *wall.at(x, y) = 0;
  const ImageDepth out = depth_in_color(wall, kDepthCamera, kColorCamera, Pose{});
  EXPECT_EQ(*out.at(149, 109), 0);
  EXPECT_FLOAT_EQ(*out.at(130, 109), 2);
}

TEST(ColorForDepth, ForegroundDoesNotLeakOntoWhatIsBehind) {
  const ImageDepth depth = square_before_wall();
  const DepthColors out =
      color_for_depth(depth, red_before_blue(), kDepthCamera, kColorCamera, kRight);
  int hidden = 0, mixed = 0;
  for (int y = 0; y < 120; ++y)
    for (int x = 0; x < 160; ++x) {
      const std::uint8_t* rgb = out.color.at(x, y);
      if (*depth.at(x, y) == 1) {
        ASSERT_TRUE(*out.seen.at(x, y)) << x << " " << y;
        EXPECT_GT(rgb[0], 100) << "the square is red at " << x << " " << y;
        continue;
      }
      const auto pixel =
          project(kColorCamera, kRight * (unproject(kDepthCamera, {double(x), double(y)}) * 3.0));
      if (pixel->x < 0 || pixel->x > 319) continue;
      hidden += !*out.seen.at(x, y);
      mixed += *out.seen.at(x, y) && rgb[0] > 0;
    }
  // The square hides 5 cm (1 - 1 / 3) of the wall, times 140 px, at each of its 42 rows.
  EXPECT_NEAR(hidden, 42 * 0.05 * (1 - 1.0 / 3) * 140, 60);
  EXPECT_LE(mixed, 2 * 42 + 42) << "the square's rim, half a pixel of it, is nobody's";
}

TEST(ColorForDepth, ASlantedWallHidesNothingOfItself) {
  ImageDepth slanted(160, 120);
  const Vec3d normal{std::sin(1.2), 0, -std::cos(1.2)};  // 69 degrees
  for (int y = 0; y < 120; ++y)
    for (int x = 0; x < 160; ++x) {
      const Vec3d ray = unproject(kDepthCamera, {double(x), double(y)});
      const double m = -2 * std::cos(1.2) / dot(normal, ray);
      if (m > 0.3 && m < 8) *slanted.at(x, y) = static_cast<float>(m);
    }
  const DepthColors out = color_for_depth(slanted, ImageRgb(320, 240, 9), kDepthCamera,
                                          kColorCamera, Pose{{}, {0.02, 0, 0}});
  int lost = 0, valid = 0;
  for (std::size_t i = 0; i < slanted.data.size(); ++i) {
    valid += slanted.data[i] > 0 && out.color.data[3 * i] + out.seen.data[i] > 0;
    lost += slanted.data[i] > 0 && !out.seen.data[i];
  }
  EXPECT_GT(valid, 5000);
  EXPECT_LT(lost, 0.1 * valid) << "at the picture's rim";
}

// FORMATS.md 3.6: depth pixels and where they lie in the colour picture.
TEST(ColorForDepth, FollowsAKinectsCalibration) {
  KinectCalibration kinect;
  kinect.depth = {.cx = 0.49862006306648254,
                  .cy = 0.49299359321594238,
                  .fx = 0.49295613169670105,
                  .fy = 0.49312511086463928,
                  .k = {3.8691997528076172, 2.0663304328918457, 0.086164794862270355,
                        4.2011380195617676, 3.3314094543457031, 0.50915241241455078},
                  .p1 = 0.00015635808813385666,
                  .p2 = 7.02285033185035E-5,
                  .sensor_width = 1024,
                  .sensor_height = 1024,
                  .T_camera_reference = {}};
  kinect.color = KinectCamera{.cx = 0.50041943788528442,
                              .cy = 0.51068669557571411,
                              .fx = 0.476089745759964,
                              .fy = 0.63471859693527222,
                              .k = {0.34417539834976196, -2.8604564666748047, 1.8035205602645874,
                                    0.21697279810905457, -2.6490097045898437, 1.7056518793106079},
                              .p1 = 0.00047436624299734831,
                              .p2 = -4.4145919673610479E-5,
                              .sensor_width = 4096,
                              .sensor_height = 3072,
                              .T_camera_reference = {}};
  kinect.color->T_camera_reference = {
      {{0.99997377395629883, 0.0072122937999665737, -0.00064296292839571834, -0.007122507318854332,
        0.99573004245758057, 0.092037834227085114, 0.0013040214544162154, -0.0920308455824852,
        0.99575531482696533}},
      {-0.032023865729570389, -0.0021201763302087784, 0.0039135357365012169}};
  const Camera depth_of = *depth_camera(kinect, *find_depth_mode("NFOV_UNBINNED"));
  const Camera color_of = *color_camera(kinect, *find_color_mode("1080P"));
  const Pose T = T_color_depth(kinect);
  ImageRgb ramp(1920, 1080);  // red: columns; green: rows
  for (int y = 0; y < 1080; ++y)
    for (int x = 0; x < 1920; ++x)
      ramp.at(x, y)[0] = static_cast<std::uint8_t>(x / 8),
                 ramp.at(x, y)[1] = static_cast<std::uint8_t>(y / 8);
  struct Row {
    int x, y;
    float m;
    double u, v, color_m;
  };
  for (const Row& row : {Row{320, 288, 1.0f, 933.6034, 571.3630, 1.0063059},
                         Row{320, 288, 2.5f, 951.0392, 572.5580, 2.5098945},
                         Row{100, 100, 1.0f, 476.2931, 177.2593, 1.0464319},
                         Row{600, 500, 2.5f, 1607.5766, 1049.0618, 2.4006892}}) {
    ImageDepth wall(640, 576);
    for (int y = row.y - 8; y <= row.y + 8; ++y)
      for (int x = row.x - 8; x <= row.x + 8; ++x) *wall.at(x, y) = row.m;
    const ImageDepth seen = depth_in_color(wall, depth_of, color_of, T);
    const int u = static_cast<int>(std::lround(row.u)), v = static_cast<int>(std::lround(row.v));
    EXPECT_NEAR(*seen.at(u, v), row.color_m, 0.0005 * row.m) << row.u;
    const DepthColors colors = color_for_depth(wall, ramp, depth_of, color_of, T);
    ASSERT_TRUE(*colors.seen.at(row.x, row.y));
    EXPECT_NEAR(colors.color.at(row.x, row.y)[0], row.u / 8, 1);
    EXPECT_NEAR(colors.color.at(row.x, row.y)[1], row.v / 8, 1);
  }
}

}  // namespace
}  // namespace mr::sensor
