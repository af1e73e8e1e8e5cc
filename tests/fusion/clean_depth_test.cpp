#include "mr/fusion/clean_depth.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>

#include "mr/core/parallel.h"
#include "mr/fusion/smooth_depth.h"

namespace mr::fusion {
namespace {

constexpr fusion::CleanConfig kNothing{
    .mixed_pixels = false, .speckle_px = 0, .fill_px = 0, .smooth_depth = false};

fusion::CleanConfig only_mixed() {
  fusion::CleanConfig config = kNothing;
  config.mixed_pixels = true;
  return config;
}

fusion::CleanConfig only_speckle(int least_px) {
  fusion::CleanConfig config = kNothing;
  config.speckle_px = least_px;
  return config;
}

fusion::CleanConfig only_fill(int most_px) {
  fusion::CleanConfig config = kNothing;
  config.fill_px = most_px;
  return config;
}

Camera pinhole(int width, int height) {
  Camera camera;
  camera.width = width, camera.height = height;
  camera.fx = camera.fy = 504;
  camera.cx = (width - 1) / 2.0, camera.cy = (height - 1) / 2.0;
  return camera;
}

/// Sixteen beams 1.4 degrees apart, every second one ten columns behind.
Camera lidar() {
  Camera camera;
  camera.model = CameraModel::lidar;
  camera.width = 1024, camera.height = 16;
  for (int y = 0; y < camera.height; ++y) {
    camera.beam_altitude_rad.push_back((7.5 - y) * 1.4 * std::numbers::pi / 180);
    camera.beam_azimuth_rad.push_back(y % 2 == 0 ? 0 : 10 * 2 * std::numbers::pi / camera.width);
  }
  return camera;
}

ImageDepth cleaned(const ImageDepth& depth, const fusion::CleanConfig& config) {
  return clean_depth(depth, pinhole(depth.width, depth.height), {}, config);
}

long valid_pixels(const ImageDepth& depth) {
  return std::count_if(depth.data.begin(), depth.data.end(), [](float d) { return d > 0; });
}

/// 1 m away on the left, 2 m on the right.
ImageDepth two_walls(int width, int height) {
  ImageDepth depth(width, height, 2);
  for (int y = 0; y < height; ++y) std::fill_n(depth.row(y), width / 2, 1.0f);
  return depth;
}

void add_noise(ImageDepth& depth, const Precision& precision) {
  std::mt19937 random(5);
  for (float& d : depth.data) {
    double sum = -6;  // twelve uniform numbers: nearly normal, the same everywhere
    for (int i = 0; i < 12; ++i) sum += static_cast<double>(random()) / 4294967296.0;
    d += static_cast<float>(sum * precision.sigma_m(d));
  }
}

TEST(CleanDepth, MixedPixelsBetweenTwoWallsVanish) {
  const ImageDepth walls = two_walls(80, 60);
  ImageDepth mixed = walls, expected = walls;
  std::mt19937 random(1);
  for (int y = 0; y < 60; ++y)
    for (int x = 39; x < 41; ++x) {
      *mixed.at(x, y) = 1.1f + 0.8f * static_cast<float>(random() % 1000) / 1000;
      *expected.at(x, y) = 0;
    }
  EXPECT_EQ(cleaned(mixed, only_mixed()), expected);
  EXPECT_EQ(cleaned(walls, only_mixed()), walls);
  EXPECT_EQ(cleaned(mixed, kNothing), mixed);
}

TEST(CleanDepth, MixedPixelsInALineVanish) {
  ImageDepth upright(80, 60, 2.0f), level(60, 80, 2.0f);
  for (int along = 0; along < 60; ++along)
    for (int i = 0; i < 41; ++i)
      *upright.at(i, along) = *level.at(along, i) = i == 40 ? 1.5f : 1.0f;
  EXPECT_EQ(valid_pixels(cleaned(upright, only_mixed())), 79 * 60);
  EXPECT_EQ(valid_pixels(cleaned(level, only_mixed())), 79 * 60);
}

TEST(CleanDepth, ThinPolesStay) {
  for (const int thick : {1, 2, 3}) {
    ImageDepth depth(80, 60, 2.0f);
    for (int y = 0; y < 60; ++y) std::fill_n(depth.at(40, y), thick, 1.0f);
    EXPECT_EQ(cleaned(depth, only_mixed()), depth) << thick;
    EXPECT_EQ(cleaned(depth, only_speckle(12)), depth) << thick;
  }
}

TEST(CleanDepth, AGrazingFloorStays) {
  const int below = 30;  // of the horizon: 3.4 degrees; the floor ends at 8
  ImageDepth floor(200, 41);
  for (int y = 0; y < floor.height; ++y)
    std::fill_n(floor.row(y), floor.width, 0.3f * 504 / static_cast<float>(y + below));
  EXPECT_EQ(cleaned(floor, only_mixed()), floor);
  add_noise(floor, {});
  Camera camera = pinhole(floor.width, floor.height);
  camera.cy = -below;
  EXPECT_EQ(clean_depth(floor, camera, {}, only_mixed()), floor);
  EXPECT_EQ(clean_depth(floor, camera, {}, only_speckle(1000)), floor);
}

TEST(CleanDepth, SpecklesVanishAndLargerRegionsStay) {
  ImageDepth depth(80, 60, 2.0f);
  const auto patch = [](ImageDepth& out, int x0, int y0, int width, int height, float z) {
    for (int y = y0; y < y0 + height; ++y) std::fill_n(out.at(x0, y), width, z);
  };
  patch(depth, 5, 5, 4, 5, 1.0f);    // 20 pixels: stays
  patch(depth, 20, 30, 5, 4, 1.2f);  // so does this
  ImageDepth expected = depth;
  patch(depth, 40, 10, 1, 19, 1.0f);  // 19 pixels
  patch(depth, 60, 40, 4, 4, 3.0f);
  depth.data[0] = 0.5f;
  patch(expected, 40, 10, 1, 19, 0.0f);
  patch(expected, 60, 40, 4, 4, 0.0f);
  expected.data[0] = 0;
  EXPECT_EQ(cleaned(depth, only_speckle(20)), expected);
  EXPECT_EQ(cleaned(depth, only_speckle(1)), depth);
  EXPECT_EQ(valid_pixels(cleaned(depth, only_speckle(1000000))), 0);
}

TEST(CleanDepth, ARegionMayWindAndMeetItself) {
  ImageDepth comb(41, 30);  // twenty-one teeth that only the last row joins
  for (int y = 0; y < 30; ++y)
    for (int x = 0; x < 41; ++x)
      if (x % 2 == 0 || y == 29) *comb.at(x, y) = 1;
  EXPECT_EQ(cleaned(comb, only_speckle(static_cast<int>(valid_pixels(comb)))), comb);
  EXPECT_EQ(valid_pixels(cleaned(comb, only_speckle(static_cast<int>(valid_pixels(comb)) + 1))), 0);
}

TEST(CleanDepth, RowsOfALidarAreComparedWhereTheyLookTheSameWay) {
  const Camera camera = lidar();
  ImageDepth depth(camera.width, camera.height, 20.0f);
  for (int y = 4; y < 8; ++y)  // two columns wide, four rows high, across the seam
    for (int x = 0; x < 2; ++x) *depth.at((1033 - 10 * (y % 2) + x) % 1024, y) = 8;
  ImageDepth bare = depth;
  std::replace(bare.data.begin(), bare.data.end(), 8.0f, 0.0f);
  EXPECT_EQ(clean_depth(depth, camera, {}, only_speckle(8)), depth);
  EXPECT_EQ(clean_depth(depth, camera, {}, only_speckle(9)), bare);
}

TEST(CleanDepth, RowsOfALidarMixNoLight) {
  const Camera camera = lidar();
  ImageDepth depth(camera.width, camera.height, 6.0f);
  std::fill_n(depth.data.begin(), 8 * 1024, 3.0f);
  std::fill_n(depth.row(8), 1024, 4.5f);  // one row on an object between: real
  EXPECT_EQ(clean_depth(depth, camera, {}, only_mixed()), depth);
  std::fill_n(depth.row(8), 1024, 0.0f);
  EXPECT_EQ(clean_depth(depth, camera, {}, only_fill(7)), depth);
}

TEST(CleanDepth, RangeImagesGoRound) {
  Camera camera = lidar();
  ImageDepth depth(camera.width, camera.height, 6.0f);
  for (int y = 0; y < 16; ++y) {
    std::fill_n(depth.row(y), 512, 3.0f);
    *depth.at(0, y) = 4.5f;  // between column 1 and column 1023
  }
  EXPECT_EQ(valid_pixels(clean_depth(depth, camera, {}, only_mixed())), 1023 * 16);
  ImageDepth holes(camera.width, camera.height, 6.0f);
  for (int y = 0; y < 16; ++y) *holes.at(0, y) = *holes.at(1023, y) = 0;
  EXPECT_EQ(valid_pixels(clean_depth(holes, camera, {}, only_fill(2))), 1024 * 16);
  EXPECT_EQ(clean_depth(holes, camera, {}, only_fill(1)), holes);
  camera.model = CameraModel::equirectangular;
  EXPECT_EQ(valid_pixels(clean_depth(holes, camera, {}, only_fill(2))), 1024 * 16);
}

TEST(CleanDepth, SmoothingLeavesASlantedPlaneWhereItIs) {
  const Precision precision;
  ImageDepth plane(120, 80);
  for (int y = 0; y < plane.height; ++y)
    for (int x = 0; x < plane.width; ++x)  // 12 mm a row: over four sigma
      *plane.at(x, y) =
          1 / (0.3f + 0.0014f * static_cast<float>(y) + 0.0004f * static_cast<float>(x));
  ImageDepth noisy = plane;
  add_noise(noisy, precision);
  fusion::CleanConfig config = kNothing;
  config.smooth_depth = true;
  const ImageDepth smooth = cleaned(noisy, config), exact = cleaned(plane, config);
  double before = 0, after = 0;
  for (int y = 3; y < plane.height - 3; ++y)
    for (int x = 3; x < plane.width - 3; ++x) {
      const float z = *plane.at(x, y);
      EXPECT_NEAR(*exact.at(x, y), z, 2e-5f);
      before += std::pow(*noisy.at(x, y) - z, 2);
      after += std::pow(*smooth.at(x, y) - z, 2);
    }
  EXPECT_LT(after, before / 4);
}

TEST(CleanDepth, WhatIsNoDepthBecomesInvalid) {
  const float inf = std::numeric_limits<float>::infinity();
  ImageDepth depth = two_walls(40, 30), expected = depth;
  int i = 0;
  for (const float bad : {std::nanf(""), inf, -inf, -1.0f, -0.0f, std::numeric_limits<float>::max(),
                          std::numeric_limits<float>::denorm_min()}) {
    depth.data[i] = depth.data[100 * (i + 1)] = bad;
    expected.data[i] = expected.data[100 * (i + 1)] = 0;
    ++i;
  }
  EXPECT_EQ(cleaned(depth, kNothing), expected);
  const ImageDepth all = cleaned(depth, {});
  for (const float d : all.data) EXPECT_TRUE(std::isfinite(d) && d >= 0 && d < 3) << d;
  const ImageDepth exact = clean_depth(depth, pinhole(40, 30), {0, 0}, {});  // a perfect sensor
  for (const float d : exact.data) EXPECT_TRUE(std::isfinite(d) && d >= 0 && d < 3) << d;
}

TEST(CleanDepth, SmallAndEmptyPictures) {
  EXPECT_TRUE(clean_depth({}, Camera{}, {}, {}).empty());
  for (const float d : {0.0f, 1.0f, std::nanf("")}) {
    fusion::CleanConfig config;
    EXPECT_EQ(cleaned(ImageDepth(1, 1, d), config).data[0], 0);  // speckle
    config.speckle_px = 0;
    EXPECT_EQ(cleaned(ImageDepth(1, 1, d), config).data[0], d > 0 ? 1.0f : 0.0f);
  }
  Camera tiny = lidar();
  for (const int width : {1, 2, 3}) {
    tiny.width = width;
    EXPECT_EQ(valid_pixels(clean_depth(ImageDepth(width, 16, 2.0f), tiny, {}, {})), width * 16);
    EXPECT_EQ(valid_pixels(cleaned(ImageDepth(width, 16, 2.0f), {})), width * 16);
  }
  EXPECT_EQ(valid_pixels(cleaned(ImageDepth(64, 48), {})), 0);
}

TEST(CleanDepth, TheSameOnAnyNumberOfThreads) {
  ImageDepth depth = two_walls(320, 288);
  add_noise(depth, {});
  std::mt19937 random(3);
  for (float& d : depth.data)
    if (random() % 8 == 0) d *= static_cast<float>(random() % 3);
  ImageDepth one, other;
  Arena(1).run([&] { one = cleaned(depth, {}); });
  EXPECT_NE(one, depth);
  for (const int threads : {2, 8}) {
    Arena(threads).run([&] { other = cleaned(depth, {}); });
    EXPECT_EQ(one, other) << threads;
  }
}

}  // namespace
}  // namespace mr::fusion
