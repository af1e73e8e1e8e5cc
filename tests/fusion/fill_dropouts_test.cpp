#include "mr/fusion/fill_dropouts.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

namespace mr::fusion {
namespace {

constexpr int kSide = 60;

/// A slanted surface, 2 to 2.6 m away, in the picture's middle; nothing around it.
ImageDepth slanted() {
  ImageDepth depth(kSide, kSide);
  for (int y = 10; y < 50; ++y)
    for (int x = 10; x < 50; ++x) *depth.at(x, y) = 2 + 0.015f * static_cast<float>(x - 10);
  return depth;
}

long valid(const ImageDepth& depth) {
  return std::count_if(depth.data.begin(), depth.data.end(), [](float d) { return d > 0; });
}

TEST(FillDropouts, HolesInsideASurfaceClose) {
  const ImageDepth whole = slanted();
  ImageDepth broken = whole;
  std::mt19937 random(1);
  for (float& d : broken.data)
    if (random() % 10 < 6) d = 0;  // as on black hair
  const ImageDepth filled = fill_dropouts(broken, {});
  EXPECT_LT(valid(broken), 0.45 * 1600);
  EXPECT_GT(valid(filled), 0.8 * 1600);
  for (std::size_t i = 0; i < filled.data.size(); ++i) {
    if (filled.data[i] == 0) continue;
    EXPECT_NEAR(filled.data[i], whole.data[i], 0.02f);
  }
}

TEST(FillDropouts, NothingGrowsAndNothingElseChanges) {
  const ImageDepth whole = slanted();
  EXPECT_EQ(fill_dropouts(whole, {}), whole);
}

TEST(FillDropouts, GapsBetweenTwoSurfacesStay) {
  ImageDepth depth(kSide, kSide, 2.0f);
  for (int y = 0; y < kSide; ++y) {
    *depth.at(30, y) = 0;
    for (int x = 31; x < kSide; ++x) *depth.at(x, y) = 3;
  }
  EXPECT_EQ(fill_dropouts(depth, {}), depth);
}

}  // namespace
}  // namespace mr::fusion
