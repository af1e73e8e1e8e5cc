#include "mr/rate/features.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <random>

#include "mr/core/parallel.h"
#include "mr/core/simd.h"

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

constexpr double kSingle = 1e-6;  // of single precision, relative

double cosine(int x, int frequency) {
  return std::sqrt((frequency == 0 ? 1.0 : 2.0) / kN) *
         std::cos(std::numbers::pi * (2 * x + 1) * frequency / (2.0 * kN));
}

double weight(int i, int j) {  // from 1, as in the paper
  return std::exp(std::pow(i * j / static_cast<double>(kN * kN), 2) - 1);
}

/// The formula as it stands: four loops.
double naive_block_energy(const Plane& plane, int x0, int y0) {
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

/// Over the whole blocks of a picture.
double naive_energy(const Plane& plane) {
  const int columns = plane.width / kN, rows = plane.height / kN;
  double sum = 0;
  for (int b = 0; b < columns * rows; ++b)
    sum += naive_block_energy(plane, b % columns * kN, b / columns * kN);
  return sum / (columns * rows);
}

Plane difference(const Plane& a, const Plane& b) {
  Plane out = a;
  for (std::size_t i = 0; i < out.data.size(); ++i) out.data[i] -= b.data[i];
  return out;
}

/// A frame of noise, some of its depth invalid.
Frame random_frame(unsigned seed, int width = 150, int height = 100) {
  std::mt19937 random(seed);
  Frame frame;
  frame.color = ImageRgb(width, height);
  for (std::uint8_t& value : frame.color.data) value = static_cast<std::uint8_t>(random());
  frame.depth = ImageDepth(width - 10, height - 4);
  for (float& depth_m : frame.depth.data)
    depth_m = random() % 5 == 0 ? 0 : 1 + static_cast<float>(random() % 5000) * 1e-3f;
  *frame.depth.at(70, 20) = std::numeric_limits<float>::quiet_NaN();
  const int middle = frame.depth.height / 2;
  std::fill(frame.depth.at(20, middle), frame.depth.at(90, middle), 0.0f);
  return frame;
}

/// All numbers in turn, for comparisons to the bit.
std::vector<double> numbers(const SceneFeatures& features) {
  std::vector<double> out{features.moving_pixels};
  for (const PictureFeatures& one : {features.color, features.depth})
    out.insert(out.end(), {one.spatial, one.temporal, one.spatial_deviation, one.temporal_deviation,
                           one.temporal_gradient, one.pixel_deviation});
  return out;
}

/// Of the third of three frames.
std::vector<double> third_features() {
  FeatureExtractor extractor;
  extractor.extract(random_frame(1));
  extractor.extract(random_frame(2));
  return numbers(extractor.extract(random_frame(3)));
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
  const double expected = naive_energy(plane);
  EXPECT_NEAR(dct_energy(plane), expected, kSingle * expected);
}

TEST(DctEnergy, LosesNothingFarAway) {
  const Plane plane = plane_of(2 * kN, kN, [](int x, int y) { return 9000 + (x * x + 3 * y) % 7; });
  const double expected = naive_energy(plane);
  EXPECT_NEAR(dct_energy(plane), expected, kSingle * expected);
}

// scipy.fft.dctn(block, norm='ortho') 1.10, over the 3 x 2 whole blocks of 100 x 70 pixels:
//   w = exp((outer(i, i) / 1024)**2 - 1), i = 1..32; w[0, 0] = 0
//   x, y = meshgrid(arange(100), arange(70)); p = (x*x*7 + y*y*13 + x*y*5) % 256
//   q = (x*3 + y*y*11) % 256; mean over blocks of sum(w * abs(dctn(p)))
TEST(DctEnergy, AgreesWithScipy) {
  const Plane p = texture(100, 70), q = other_texture(100, 70);
  EXPECT_NEAR(dct_energy(p) / 25576.110308899544, 1, kSingle);
  EXPECT_NEAR(dct_energy(q) / 13987.629106633585, 1, kSingle);
  EXPECT_NEAR(dct_energy(difference(p, q)) / 31573.75135915817, 1, kSingle);
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

TEST(DctEnergy, EveryInstructionSetGivesTheSameBits) {
  const Plane plane = texture(96, 64);
  const double best = dct_energy(plane);
  for (const std::string& target : simd_targets()) {
    ASSERT_TRUE(set_simd_target(target));
    EXPECT_EQ(dct_energy(plane), best) << target;
  }
  set_simd_target("");
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

TEST(DepthPlane, ARowIsFilledFromWhereverItsHolesBegin) {
  ImageDepth depth(70, 3);
  for (int x = 0; x < 70; ++x) *depth.at(x, 1) = x >= 21 && x % 9 > 2 ? 1 + 0.25f * x : 0;
  const ImageDepth plane = depth_plane(depth);
  float last = 1000 * *depth.at(21, 1);
  EXPECT_EQ(*plane.at(0, 0), last);
  for (int x = 0; x < 70; ++x) {
    if (*depth.at(x, 1) > 0) last = 1000 * *depth.at(x, 1);
    EXPECT_EQ(*plane.at(x, 1), last) << x;
  }
  EXPECT_EQ(*plane.at(69, 2), *plane.at(0, 0));
}

TEST(SceneFeatures, TellWhatMovesInWhich) {
  Frame frame;
  frame.color = ImageRgb(96, 64, 90);
  frame.depth = ImageDepth(64, 64, 2);
  FeatureExtractor extractor;
  extractor.extract(frame);
  *frame.color.at(40, 40) = 200;
  const SceneFeatures paint = extractor.extract(frame);
  *frame.depth.at(5, 5) = 1;
  const SceneFeatures move = extractor.extract(frame);

  EXPECT_GT(paint.color.spatial, 0);
  EXPECT_EQ(paint.color.temporal, paint.color.spatial);
  EXPECT_EQ(paint.depth.spatial, 0);
  EXPECT_EQ(paint.depth.temporal, 0);
  EXPECT_EQ(paint.moving_pixels, 0);
  EXPECT_EQ(move.color.spatial, paint.color.spatial);
  EXPECT_EQ(move.color.temporal, 0);
  EXPECT_EQ(move.color.temporal_gradient, -paint.color.temporal);
  EXPECT_GT(move.depth.spatial, 0);
  EXPECT_EQ(move.depth.temporal, move.depth.spatial);
  EXPECT_EQ(move.depth.temporal_gradient, move.depth.temporal);
  EXPECT_EQ(move.moving_pixels, 1.0 / (64 * 64));
}

TEST(SceneFeatures, AreThoseOfThePlanesAndTheirDifference) {
  const Frame before = random_frame(1), now = random_frame(2);
  FeatureExtractor extractor;
  extractor.extract(before);
  const SceneFeatures features = extractor.extract(now);
  const Plane luma = luma_plane(now.color), depth = depth_plane(now.depth);
  EXPECT_EQ(features.color.spatial, dct_energy(luma));
  EXPECT_EQ(features.depth.spatial, dct_energy(depth));
  const double color_change = dct_energy(difference(luma, luma_plane(before.color)));
  const double depth_change = dct_energy(difference(depth, depth_plane(before.depth)));
  EXPECT_NEAR(features.color.temporal, color_change, kSingle * color_change);
  EXPECT_NEAR(features.depth.temporal, depth_change, kSingle * depth_change);
}

TEST(SceneFeatures, AreTheSameInTheOtherDirection) {
  FeatureExtractor forwards, backwards;
  forwards.extract(random_frame(1));
  backwards.extract(random_frame(2));
  EXPECT_EQ(forwards.extract(random_frame(2)).color.temporal,
            backwards.extract(random_frame(1)).color.temporal);
}

TEST(SceneFeatures, DeviationsOverBlocksAndPixels) {
  Frame frame;
  frame.color = ImageRgb(4 * kN, kN, 100);
  frame.depth = ImageDepth(kN, kN, 2);
  FeatureExtractor extractor;
  extractor.extract(frame);
  for (int y = 0; y < kN; ++y)  // stripes of 50 and 150 in one block of four
    for (int x = 0; x < kN; ++x)
      std::fill_n(frame.color.at(x, y), 3, static_cast<std::uint8_t>(x % 2 == 0 ? 50 : 150));
  const PictureFeatures color = extractor.extract(frame).color;
  EXPECT_GT(color.spatial, 0);
  // E, 0, 0, 0: mean E / 4, variance (E² - E² / 4) / 4.
  EXPECT_NEAR(color.spatial_deviation, color.spatial * std::sqrt(3.0), kSingle * color.spatial);
  EXPECT_NEAR(color.temporal_deviation, color.temporal * std::sqrt(3.0), kSingle * color.temporal);
  EXPECT_NEAR(color.pixel_deviation, 25, 1e-4);
}

TEST(SceneFeatures, TheFirstFrameMovesNothing) {
  FeatureExtractor extractor;
  const SceneFeatures first = extractor.extract(random_frame(1));
  EXPECT_GT(first.color.spatial, 0);
  for (const PictureFeatures& one : {first.color, first.depth}) {
    EXPECT_EQ(one.temporal, 0);
    EXPECT_EQ(one.temporal_deviation, 0);
    EXPECT_EQ(one.temporal_gradient, 0);
  }
  EXPECT_EQ(first.moving_pixels, 0);
  EXPECT_EQ(extractor.extract(random_frame(2)).color.temporal_gradient, 0);
}

TEST(SceneFeatures, AnotherSizeBeginsAnew) {
  FeatureExtractor extractor, fresh;
  extractor.extract(random_frame(1));
  extractor.extract(random_frame(2));
  EXPECT_EQ(numbers(extractor.extract(random_frame(3, 200, 70))),
            numbers(fresh.extract(random_frame(3, 200, 70))));
}

TEST(SceneFeatures, NoneBelowOneBlock) {
  FeatureExtractor extractor;
  for (unsigned seed : {1, 2}) {
    const SceneFeatures features = extractor.extract(random_frame(seed, 100, kN - 1));
    EXPECT_EQ(features.color.spatial, 0);
    EXPECT_EQ(features.depth.spatial, 0);
  }
}

TEST(SceneFeatures, NoiseOfDepthDoesNotMove) {
  Frame frame;
  frame.depth = ImageDepth(50, 40, 3);
  FeatureExtractor extractor({.base_m = 0.001, .per_m2 = 0.0002});
  extractor.extract(frame);
  for (float& depth_m : frame.depth.data) depth_m += 0.005f;  // sigma is 2.8 mm
  EXPECT_EQ(extractor.extract(frame).moving_pixels, 0);
  for (int x = 0; x < 50; ++x) *frame.depth.at(x, 7) += x < 40 ? 0.1f : -0.1f;
  *frame.depth.at(3, 7) = 0;
  *frame.depth.at(4, 7) = std::numeric_limits<float>::quiet_NaN();
  const double expected = 48.0 / (50 * 40 - 2);
  EXPECT_DOUBLE_EQ(extractor.extract(frame).moving_pixels, expected);
}

TEST(SceneFeatures, WithoutAnyValidDepthNothingCounts) {
  Frame frame;
  frame.depth = ImageDepth(64, 64, std::numeric_limits<float>::quiet_NaN());
  FeatureExtractor extractor;
  for (int i = 0; i < 3; ++i)
    EXPECT_EQ(numbers(extractor.extract(frame)), std::vector<double>(13, 0.0));
}

TEST(SceneFeatures, SameOnAnyNumberOfThreads) {
  std::vector<double> one, two;
  Arena(1).run([&] { one = third_features(); });
  Arena(2).run([&] { two = third_features(); });
  EXPECT_EQ(one, two);
}

TEST(SceneFeatures, EveryInstructionSetGivesTheSameBits) {
  const std::vector<double> best = third_features();
  for (const std::string& target : simd_targets()) {
    ASSERT_TRUE(set_simd_target(target));
    EXPECT_EQ(third_features(), best) << target;
  }
  set_simd_target("");
}

TEST(SceneFeatures, ASensorWithoutColourHasNoColourEnergy) {
  Frame frame;
  frame.depth = ImageDepth(64, 64, 2);
  *frame.depth.at(20, 20) = 1;
  const SceneFeatures features = FeatureExtractor().extract(frame);
  EXPECT_EQ(features.color.spatial, 0);
  EXPECT_GT(features.depth.spatial, 0);
}

TEST(MeanFeatures, CountColourOnlyOfSensorsThatHaveIt) {
  SensorFeatures with{true, {}}, without{false, {}};
  with.features.color.spatial = 6, with.features.depth.temporal = 2,
  with.features.moving_pixels = 1, with.features.mask_coverage = 0.5;
  with.features.triangles = 1000;
  without.features.depth.temporal = 4;
  const SceneFeatures mean = mean_features(std::vector{with, without});
  EXPECT_EQ(mean.color.spatial, 6);
  EXPECT_EQ(mean.depth.temporal, 3);
  EXPECT_EQ(mean.moving_pixels, 0.5);
  EXPECT_EQ(mean.mask_coverage, 0.25);
  EXPECT_EQ(mean.triangles, 500);
  EXPECT_EQ(mean_features({}).depth.temporal, 0);
}

TEST(SceneFeatures, TravelAsNumbers) {
  SceneFeatures features;
  features.color = {1, 2, 3, 4, -5, 6};
  features.depth = {7, 8, 9, 10, 11, 12};
  features.moving_pixels = 0.25, features.mask_coverage = 0.5, features.triangles = 1234;
  const std::vector<float> values = values_of(features);
  EXPECT_EQ(values,
            (std::vector<float>{1, 2, 3, 4, -5, 6, 7, 8, 9, 10, 11, 12, 0.25f, 0.5f, 1234}));
  const auto back = features_of(values);
  ASSERT_TRUE(back);
  EXPECT_EQ(values_of(*back), values);
  EXPECT_FALSE(features_of({}));
  EXPECT_FALSE(features_of(std::span(values).first(14)));
  std::vector<float> more = values;
  more.push_back(0);
  EXPECT_FALSE(features_of(more));
}

}  // namespace
}  // namespace mr::rate
