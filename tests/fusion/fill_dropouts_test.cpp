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

ImageDepth filled(const ImageDepth& depth, int most_px = 2) {
  const RaySpacing rays(depth.width, depth.height);
  const RayGrid grid = fill_dropouts(to_grid(depth, rays), rays, {}, most_px);
  return to_depth(grid, rays, &depth);
}

long filled_pixels(const ImageDepth& depth) {
  return std::count_if(depth.data.begin(), depth.data.end(), [](float d) { return d > 0; });
}

TEST(FillDropouts, HolesInsideASurfaceClose) {
  const ImageDepth whole = slanted();
  ImageDepth broken = whole;
  std::mt19937 random(1);
  for (float& d : broken.data)
    if (random() % 10 < 6) d = 0;  // as on black hair
  const ImageDepth whole_again = filled(broken);
  EXPECT_LT(filled_pixels(broken), 0.45 * 1600);
  EXPECT_GT(filled_pixels(whole_again), 0.8 * 1600);
  for (std::size_t i = 0; i < whole_again.data.size(); ++i) {
    if (whole_again.data[i] == 0) continue;
    EXPECT_NEAR(whole_again.data[i], whole.data[i], 0.02f);
  }
}

TEST(FillDropouts, NothingGrowsAndNothingElseChanges) {
  const ImageDepth whole = slanted();
  EXPECT_EQ(filled(whole), whole);
}

TEST(FillDropouts, GapsBetweenTwoSurfacesStay) {
  ImageDepth depth(kSide, kSide, 2.0f);
  for (int y = 0; y < kSide; ++y) {
    *depth.at(30, y) = 0;
    for (int x = 31; x < kSide; ++x) *depth.at(x, y) = 3;
  }
  EXPECT_EQ(filled(depth, 7), depth);
}

/// A shelf before a wall, near enough to be one grazing surface, were it not that both face the
/// camera.
TEST(FillDropouts, GapsAtADepthEdgeStayWhereNoSideLeadsAcross) {
  constexpr Precision kExact{.base_m = 0.0001, .per_m2 = 0};
  const auto edge = [](float slope) {
    ImageDepth depth(kSide, 1);
    for (int x = 0; x < kSide; ++x)
      *depth.at(x, 0) = 2 + slope * static_cast<float>(x) + (x > 30 && slope == 0 ? 0.04f : 0.0f);
    *depth.at(30, 0) = 0;
    return depth;
  };
  const auto is_filled = [&](float slope) {
    const ImageDepth depth = edge(slope);
    const RaySpacing rays(depth.width, depth.height);
    const RayGrid grid = fill_dropouts(to_grid(depth, rays), rays, kExact, 2, true);
    return *to_depth(grid, rays, nullptr).at(30, 0) > 0;
  };
  EXPECT_FALSE(is_filled(0));
  EXPECT_TRUE(is_filled(0.02f));  // as steep, but both sides lead across
}

TEST(FillDropouts, GapsCloseUpToTheBound) {
  for (int gap = 1; gap <= 9; ++gap) {
    ImageDepth depth(kSide, kSide, 2.0f);
    for (int y = 0; y < kSide; ++y) std::fill_n(depth.at(20, y), gap, 0.0f);
    const ImageDepth whole(kSide, kSide, 2.0f);
    for (int most = 0; most <= 7; ++most)
      EXPECT_EQ(filled(depth, most), gap <= most ? whole : depth) << gap << ", " << most;
  }
}

TEST(FillDropouts, AGapIsFilledStraight) {
  ImageDepth depth(kSide, 1);
  for (int x = 0; x < kSide; ++x) *depth.at(x, 0) = 1 / (0.5f + 0.0005f * static_cast<float>(x));
  const ImageDepth whole = depth;
  std::fill_n(depth.at(30, 0), 5, 0.0f);
  const ImageDepth closed = filled(depth, 5);
  for (int x = 0; x < kSide; ++x) EXPECT_NEAR(*closed.at(x, 0), *whole.at(x, 0), 1e-5f);
}

}  // namespace
}  // namespace mr::fusion
