#include "mr/eval/photos.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>

#include "eval/small_scene.h"
#include "mr/core/parallel.h"
#include "mr/eval/covered_ssim.h"
#include "mr/eval/ssim.h"
#include "mr/kit/image_io.h"
#include "mr/kit/srgb.h"
#include "mr/synth/truth.h"

namespace mr::eval {
namespace {

ImageLuma noise(int width, int height, unsigned seed) {
  std::mt19937 random(seed);
  ImageLuma out(width, height);
  for (float& v : out.data) v = static_cast<float>(random() % 256);
  return out;
}

ImageMask some_of(int width, int height, unsigned seed) {
  std::mt19937 random(seed);
  ImageMask out(width, height);
  for (std::uint8_t& v : out.data) v = random() % 3 != 0;
  return out;
}

CoveredScore score_of(const ImageLuma& test, const ImageLuma& reference, const ImageMask& mask) {
  const auto score = covered_ssim(test, reference, mask);
  if (score) return *score;
  ADD_FAILURE() << score.error().message;
  return {};
}

/// The definition, window by window: Gaussian weights of the covered pixels, scaled to the sum 1;
/// two passes for variances.
double by_definition(const ImageLuma& a, const ImageLuma& b, const ImageMask& mask) {
  double sum = 0, windows = 0;
  for (int y = 5; y + 5 < a.height; ++y)
    for (int x = 5; x + 5 < a.width; ++x) {
      if (*mask.at(x, y) == 0) continue;
      const auto mean_of = [&](const std::function<double(int, int)>& value) {
        double total = 0, weight = 0;
        for (int dy = -5; dy <= 5; ++dy)
          for (int dx = -5; dx <= 5; ++dx) {
            if (*mask.at(x + dx, y + dy) == 0) continue;
            const double w = std::exp(-(dx * dx + dy * dy) / (2 * 1.5 * 1.5));
            total += w * value(x + dx, y + dy), weight += w;
          }
        return total / weight;
      };
      const double ma = mean_of([&](int i, int j) { return *a.at(i, j); });
      const double mb = mean_of([&](int i, int j) { return *b.at(i, j); });
      const double va = mean_of([&](int i, int j) { return std::pow(*a.at(i, j) - ma, 2); });
      const double vb = mean_of([&](int i, int j) { return std::pow(*b.at(i, j) - mb, 2); });
      const double co =
          mean_of([&](int i, int j) { return (*a.at(i, j) - ma) * (*b.at(i, j) - mb); });
      const double c1 = std::pow(0.01 * 255, 2), c2 = std::pow(0.03 * 255, 2);
      sum += (2 * ma * mb + c1) * (2 * co + c2) / ((ma * ma + mb * mb + c1) * (va + vb + c2));
      ++windows;
    }
  return sum / windows;
}

TEST(CoveredSsim, IsSsimWhereAllIsCovered) {
  const ImageLuma a = noise(61, 47, 1), b = noise(61, 47, 2);
  ImageLuma near = a;
  for (std::size_t i = 0; i < near.data.size(); ++i) near.data[i] = 0.9f * a.data[i] + 4;
  const ImageMask all(61, 47, 1);
  for (const ImageLuma& test : {near, b}) {
    const auto expected = Ssim::prepare(a)->compare(test);
    const CoveredScore score = score_of(test, a, all);
    EXPECT_NEAR(score.ssim, expected->ssim_full, 1e-6);
    EXPECT_NEAR(score.psnr_db, expected->psnr_db, 1e-6);
    EXPECT_EQ(score.windows, 51u * 37u);
  }
}

TEST(CoveredSsim, IsTheDefinitionOverCoveredPixels) {
  const ImageLuma a = noise(40, 33, 3);
  ImageLuma b = noise(40, 33, 4);
  for (std::size_t i = 0; i < b.data.size(); ++i) b.data[i] = 0.7f * a.data[i] + 0.3f * b.data[i];
  const ImageMask mask = some_of(40, 33, 5);
  const double expected = by_definition(b, a, mask);
  EXPECT_GT(expected, 0.5);
  EXPECT_LT(expected, 0.95);
  EXPECT_NEAR(score_of(b, a, mask).ssim, expected, 1e-9);
}

TEST(CoveredSsim, WhatIsNotCoveredNeitherHelpsNorHarms) {
  const ImageLuma a = noise(50, 40, 6), b = noise(50, 40, 7);
  const ImageMask mask = some_of(50, 40, 8);
  ImageLuma black = b, white = b;
  for (std::size_t i = 0; i < mask.data.size(); ++i)
    if (!mask.data[i]) black.data[i] = 0, white.data[i] = 255;
  const CoveredScore one = score_of(black, a, mask), other = score_of(white, a, mask);
  EXPECT_EQ(one.ssim, other.ssim);
  EXPECT_EQ(one.psnr_db, other.psnr_db);
  ImageLuma same = a;
  for (std::size_t i = 0; i < mask.data.size(); ++i)
    if (!mask.data[i]) same.data[i] = 0;
  EXPECT_NEAR(score_of(same, a, mask).ssim, 1, 1e-9);
  EXPECT_EQ(score_of(same, a, mask).psnr_db, kSamePsnr_db);
}

TEST(CoveredSsim, NothingCoveredCountsNothingAndBadInputIsRefused) {
  const ImageLuma a = noise(20, 20, 9);
  EXPECT_EQ(score_of(a, a, ImageMask(20, 20)).windows, 0u);
  EXPECT_FALSE(covered_ssim(a, a, ImageMask(19, 20)));
  EXPECT_FALSE(covered_ssim(noise(10, 30, 1), noise(10, 30, 1), ImageMask(10, 30)));
  ImageLuma broken = a;
  broken.data[7] = std::nanf("");
  EXPECT_FALSE(covered_ssim(broken, a, ImageMask(20, 20)));
}

TEST(CoveredSsim, IsTheSameOnAnyNumberOfThreads) {
  const ImageLuma a = noise(90, 130, 10), b = noise(90, 130, 11);
  const ImageMask mask = some_of(90, 130, 12);
  CoveredScore one, eight;
  Arena(1).run([&] { one = score_of(a, b, mask); });
  Arena(8).run([&] { eight = score_of(a, b, mask); });
  EXPECT_EQ(one.ssim, eight.ssim);
  EXPECT_EQ(one.psnr_db, eight.psnr_db);
}

}  // namespace
}  // namespace mr::eval
