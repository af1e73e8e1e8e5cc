#include "mr/synth/noise.h"

#include <gtest/gtest.h>

#include <cmath>

namespace mr::synth {
namespace {

constexpr DepthNoise kKinect{.on = true, .precision = {}, .near_m = 0.3, .far_m = 6};

DepthTruth wall(float z_mm) {
  DepthTruth truth(320, 288);
  truth.z_mm.assign(truth.z_mm.size(), z_mm);
  find_edges(truth, {0, 0, truth.width, truth.height});
  return truth;
}

std::vector<std::uint16_t> measured(const DepthTruth& truth, std::uint64_t seed = 1,
                                    const DepthNoise& noise = kKinect) {
  std::vector<std::uint16_t> out(truth.z_mm.size());
  measure(truth, noise, seed, out);
  return out;
}

TEST(Noise, GrowsWithTheSquareOfTheDistance) {
  for (const double z_m : {2.0, 4.0}) {
    const auto depth = measured(wall(static_cast<float>(z_m * 1000)));
    double sum = 0, squares = 0;
    for (const std::uint16_t d : depth) {
      const double off = d - z_m * 1000;
      sum += off, squares += off * off;
    }
    const double n = static_cast<double>(depth.size()), expected = 1 + 0.2 * z_m * z_m;
    EXPECT_NEAR(sum / n, 0, 0.05);
    EXPECT_NEAR(std::sqrt(squares / n), expected, 0.1 * expected);
  }
}

TEST(Noise, CorrelatedNoiseKeepsItsVariance) {
  DepthNoise noise = kKinect;
  noise.precision = {.base_m = 0.02, .per_m2 = 0};  // far above the whole millimetres
  noise.correlation_px = 2;
  double squares = 0, at_2 = 0, at_6 = 0, between_frames = 0;
  int count = 0;
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    const auto a = measured(wall(2000), seed, noise), b = measured(wall(2000), seed + 100, noise);
    for (int y = 0; y < 288; ++y)
      for (int x = 0; x + 6 < 320; ++x, ++count) {
        const std::size_t i = static_cast<std::size_t>(y) * 320 + x;
        const double off = a[i] - 2000.0;
        squares += off * off, at_2 += off * (a[i + 2] - 2000.0), at_6 += off * (a[i + 6] - 2000.0);
        between_frames += off * (b[i] - 2000.0);
      }
  }
  EXPECT_NEAR(std::sqrt(squares / count), 20, 0.6);
  EXPECT_NEAR(at_2 / squares, std::exp(-0.5), 0.03);
  EXPECT_NEAR(at_6 / squares, std::exp(-4.5), 0.03);
  EXPECT_NEAR(between_frames / squares, 0, 0.05);
}

TEST(Noise, MayBeMoreThanThePrecisionSays) {
  DepthNoise noise = kKinect;
  noise.factor = 2;
  double squares = 0;
  const auto depth = measured(wall(3000), 1, noise);
  for (const std::uint16_t d : depth) squares += (d - 3000.0) * (d - 3000.0);
  const double expected = 2 * (1 + 0.2 * 9);
  EXPECT_NEAR(std::sqrt(squares / static_cast<double>(depth.size())), expected, 0.1 * expected);
}

TEST(Noise, HalfOfTheEdgePixelsAreMixed) {
  DepthTruth truth = wall(2000);
  for (int y = 0; y < truth.height; ++y)
    for (int x = 160; x < truth.width; ++x) truth.z_mm[y * truth.width + x] = 3000;
  find_edges(truth, {0, 0, truth.width, truth.height});
  const auto depth = measured(truth);
  int edges = 0, mixed = 0;
  for (std::size_t i = 0; i < depth.size(); ++i) {
    if ((truth.flags[i] & DepthTruth::kEdge) == 0) continue;
    ++edges;
    mixed += depth[i] > 2050 && depth[i] < 2950;
  }
  EXPECT_EQ(edges, 2 * truth.height);
  EXPECT_NEAR(mixed, edges / 2, edges / 12);
}

TEST(Noise, RowsThatLieApartHaveNoMixedPixels) {
  const auto edges = [](bool rows_touch) {
    DepthTruth truth = wall(2000);
    truth.rows_touch = rows_touch;
    for (int y = 0; y < truth.height; ++y)  // a step from row to row
      std::fill_n(&truth.z_mm[y * truth.width], truth.width, 2000.0f + 200.0f * (y % 2));
    find_edges(truth, {0, 0, truth.width, truth.height});
    return std::ranges::count_if(
        truth.flags, [](std::uint8_t flags) { return (flags & DepthTruth::kEdge) != 0; });
  };
  EXPECT_GT(edges(true), 200 * 320);
  EXPECT_EQ(edges(false), 0);
}

TEST(Noise, GrazingAlwaysFailsAndDarkMostly) {
  DepthTruth truth = wall(2000);
  for (std::size_t i = 0; i < truth.flags.size(); ++i)
    truth.flags[i] = i % 2 == 0 ? DepthTruth::kGrazing : DepthTruth::kDark;
  const auto depth = measured(truth);
  int grazing = 0, dark = 0;
  for (std::size_t i = 0; i < depth.size(); ++i) (i % 2 == 0 ? grazing : dark) += depth[i] != 0;
  EXPECT_EQ(grazing, 0);
  EXPECT_NEAR(dark, 0.4 * static_cast<double>(depth.size()) / 2, 0.02 * depth.size());
  EXPECT_TRUE(is_dark({0.01f, 0.01f, 0.01f}));
  EXPECT_FALSE(is_dark({0.03f, 0.03f, 0.03f}));
}

TEST(Noise, IsNewInEveryFrameAndOffWhenAsked) {
  const DepthTruth truth = wall(2000.4f);
  EXPECT_EQ(measured(truth, 1), measured(truth, 1));
  EXPECT_NE(measured(truth, 1), measured(truth, 2));
  DepthNoise off = kKinect;
  off.on = false;
  for (const std::uint16_t d : measured(truth, 1, off)) ASSERT_EQ(d, 2000);
  off.far_m = 1.5;
  for (const std::uint16_t d : measured(truth, 1, off)) ASSERT_EQ(d, 0);
}

}  // namespace
}  // namespace mr::synth
