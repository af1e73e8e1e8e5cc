#include "mr/rate/features.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>

#include "mr/core/parallel.h"

namespace mr::rate {
namespace {

using Plane = Image<float, 1>;
constexpr int kN = kFeatureBlock;

template <typename Value>
Plane plane_of(int width, int height, Value value) {
  Plane plane(width, height);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) *plane.at(x, y) = static_cast<float>(value(x, y));
  return plane;
}

/// Anything with all frequencies; the pictures of the stored values below.
Plane texture(int width, int height) {
  return plane_of(width, height,
                  [](int x, int y) { return (x * x * 7 + y * y * 13 + x * y * 5) % 256; });
}
Plane other_texture(int width, int height) {
  return plane_of(width, height, [](int x, int y) { return (x * 3 + y * y * 11) % 256; });
}

double cosine(int x, int frequency) {
  return std::sqrt((frequency == 0 ? 1.0 : 2.0) / kN) *
         std::cos(std::numbers::pi * (2 * x + 1) * frequency / (2.0 * kN));
}

double weight(int i, int j) {  // from 1, as in the paper
  return std::exp(std::pow(i * j / static_cast<double>(kN * kN), 2) - 1);
}

/// The formula as it stands: four loops a block.
double naive_energy(const Plane& plane, int x0, int y0) {
  double energy = 0;
  for (int j = 1; j <= kN; ++j)
    for (int i = 1; i <= kN; ++i) {
      if (i + j <= 2) continue;
      double dct = 0;
      for (int y = 0; y < kN; ++y)
        for (int x = 0; x < kN; ++x)
          dct += *plane.at(x0 + x, y0 + y) * cosine(x, i - 1) * cosine(y, j - 1);
      energy += weight(i, j) * std::abs(dct);
    }
  return energy;
}

TEST(DctEnergy, FlatPictureHasNone) {
  EXPECT_EQ(dct_energy(Plane(96, 64, 173.3f)), 0);
  EXPECT_EQ(dct_energy(Plane(96, 64, 4321.1f)), 0);
}

TEST(DctEnergy, OneCosineIsOneWeightedCoefficient) {
  for (const auto& [u, v] : {std::pair{1, 0}, {0, 1}, {5, 0}, {3, 7}, {31, 31}, {30, 2}}) {
    const Plane wave = plane_of(
        kN, kN, [u = u, v = v](int x, int y) { return 100 + 300 * cosine(x, u) * cosine(y, v); });
    // Pixels are floats; their rounding, about 1e-6, spreads over 1024 coefficients.
    EXPECT_NEAR(dct_energy(wave), 300 * weight(u + 1, v + 1), 1e-2) << u << ' ' << v;
  }
}

TEST(DctEnergy, HighFrequenciesWeighMore) {
  const auto wave = [](int u, int v) {
    return dct_energy(
        plane_of(kN, kN, [&](int x, int y) { return 100 * cosine(x, u) * cosine(y, v); }));
  };
  EXPECT_NEAR(wave(1, 0), 100 * std::exp(-1.0), 0.01);
  EXPECT_NEAR(wave(31, 31), 100, 0.01);
}

TEST(DctEnergy, AgreesWithTheFormulaAsItStands) {
  const Plane plane = texture(2 * kN, kN);
  const double expected = (naive_energy(plane, 0, 0) + naive_energy(plane, kN, 0)) / 2;
  EXPECT_NEAR(dct_energy(plane), expected, 1e-9 * expected);
}

// scipy.fft.dctn(block, norm='ortho') 1.10, over the 3 x 2 whole blocks of 100 x 70 pixels:
//   w = exp((outer(i, i) / 1024)**2 - 1), i = 1..32; w[0, 0] = 0
//   x, y = meshgrid(arange(100), arange(70)); p = (x*x*7 + y*y*13 + x*y*5) % 256
//   q = (x*3 + y*y*11) % 256; mean over blocks of sum(w * abs(dctn(p)))
TEST(DctEnergy, AgreesWithScipy) {
  EXPECT_NEAR(dct_energy(texture(100, 70)), 25576.110308899544, 1e-5);
  EXPECT_NEAR(dct_energy(other_texture(100, 70)), 13987.629106633585, 1e-5);
  EXPECT_NEAR(temporal_dct_energy(texture(100, 70), other_texture(100, 70)), 31573.75135915817,
              1e-5);
}

TEST(DctEnergy, ScalesWithContrastAndNotWithBrightness) {
  const Plane plane = texture(96, 96);
  Plane stronger = plane, brighter = plane;
  for (float& value : stronger.data) value *= 4;
  for (float& value : brighter.data) value += 64;
  EXPECT_DOUBLE_EQ(dct_energy(stronger), 4 * dct_energy(plane));
  EXPECT_DOUBLE_EQ(dct_energy(brighter), dct_energy(plane));
}

TEST(DctEnergy, CountsWholeBlocksOnly) {
  const Plane large = texture(3 * kN + 31, 2 * kN + 7);
  Plane whole(3 * kN, 2 * kN);
  for (int y = 0; y < whole.height; ++y) std::copy_n(large.row(y), whole.width, whole.row(y));
  EXPECT_EQ(dct_energy(large), dct_energy(whole));
  EXPECT_GT(dct_energy(large), 0);
}

TEST(DctEnergy, NoneBelowOneBlock) {
  EXPECT_EQ(dct_energy(texture(kN - 1, 500)), 0);
  EXPECT_EQ(dct_energy(texture(500, kN - 1)), 0);
  EXPECT_EQ(dct_energy(Plane{}), 0);
}

TEST(DctEnergy, SameOnAnyNumberOfThreads) {
  const Plane plane = texture(1280, 720);
  double one = 0, eight = 0;
  Arena(1).run([&] { one = dct_energy(plane); });
  Arena(8).run([&] { eight = dct_energy(plane); });
  EXPECT_EQ(one, eight);
}

TEST(TemporalDctEnergy, NoneWhereNothingMoves) {
  EXPECT_EQ(temporal_dct_energy(texture(96, 64), texture(96, 64)), 0);
}

TEST(TemporalDctEnergy, IsTheEnergyOfWhatAppeared) {
  const Plane before = texture(96, 64);
  Plane now = before;
  const Plane wave = plane_of(kN, kN, [](int x, int) { return 64 * cosine(x, 4); });
  for (int y = 0; y < kN; ++y)
    for (int x = 0; x < kN; ++x) *now.at(kN + x, y) += *wave.at(x, y);
  EXPECT_NEAR(temporal_dct_energy(before, now), dct_energy(wave) / 6, 1e-2);
  EXPECT_EQ(temporal_dct_energy(now, before), temporal_dct_energy(before, now));
}

TEST(LumaPlane, WeighsAsBt709) {
  ImageRgb picture(4, 1);
  picture.data = {255, 0, 0, 0, 255, 0, 0, 0, 255, 255, 255, 255};
  const Plane luma = luma_plane(picture);
  EXPECT_FLOAT_EQ(luma.data[0], 0.2126f * 255);
  EXPECT_FLOAT_EQ(luma.data[1], 0.7152f * 255);
  EXPECT_FLOAT_EQ(luma.data[2], 0.0722f * 255);
  EXPECT_FLOAT_EQ(luma.data[3], 255);
}

TEST(DepthPlane, HolesTakeTheirNeighboursDepth) {
  ImageDepth depth(3, 3);
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  depth.data = {0,    0,    1.5f,  //
                0,    2.0f, -1,    //
                kNan, 0,    3.0f};
  const ImageDepth::Values expected{1500, 1500, 1500, 1500, 2000, 2000, 1500, 1500, 3000};
  EXPECT_EQ(depth_plane(depth).data, expected);
  EXPECT_EQ(depth_plane(ImageDepth(2, 1)).data, (ImageDepth::Values{0, 0}));
}

TEST(DepthPlane, HolesInAWallAddNoEnergy) {
  ImageDepth wall(96, 64, 2.5f);
  for (std::size_t i = 0; i < wall.data.size(); ++i)
    if (i * i % 7 < 3) wall.data[i] = 0;
  ASSERT_EQ(wall.data[0], 0);
  EXPECT_EQ(dct_energy(depth_plane(wall)), 0);
  EXPECT_GT(dct_energy(wall), 0) << "the holes would have counted";
}

TEST(SceneFeatures, TellWhatMovesInWhich) {
  Frame frame;
  frame.color = ImageRgb(96, 64, 90);
  frame.depth = ImageDepth(64, 64, 2);
  const FeaturePlanes before = feature_planes(frame);
  *frame.color.at(40, 40) = 200;
  const FeaturePlanes painted = feature_planes(frame);
  *frame.depth.at(5, 5) = 1;
  const FeaturePlanes now = feature_planes(frame);

  const SceneFeatures paint = scene_features(before, painted);
  EXPECT_GT(paint.color_spatial, 0);
  EXPECT_DOUBLE_EQ(paint.color_temporal, paint.color_spatial);
  EXPECT_EQ(paint.depth_spatial, 0);
  EXPECT_EQ(paint.depth_temporal, 0);
  const SceneFeatures move = scene_features(painted, now);
  EXPECT_EQ(move.color_spatial, paint.color_spatial);
  EXPECT_EQ(move.color_temporal, 0);
  EXPECT_GT(move.depth_spatial, 0);
  EXPECT_EQ(move.depth_temporal, move.depth_spatial);
}

TEST(SceneFeatures, ASensorWithoutColourHasNoColourEnergy) {
  Frame frame;
  frame.depth = ImageDepth(64, 64, 2);
  *frame.depth.at(20, 20) = 1;
  const SceneFeatures features = scene_features(feature_planes(frame), feature_planes(frame));
  EXPECT_EQ(features.color_spatial, 0);
  EXPECT_GT(features.depth_spatial, 0);
}

}  // namespace
}  // namespace mr::rate
