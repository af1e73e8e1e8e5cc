#include "mr/still/connected_components.h"

#include <gtest/gtest.h>

#include "mr/still/moving_pixels.h"

namespace mr {
namespace {

ImageMask picture(const std::vector<std::string>& rows) {
  ImageMask out(static_cast<int>(rows[0].size()), static_cast<int>(rows.size()));
  for (int y = 0; y < out.height; ++y)
    for (int x = 0; x < out.width; ++x) *out.at(x, y) = static_cast<std::uint8_t>(rows[y][x] - '0');
  return out;
}

TEST(ConnectedComponents, TouchAcrossCornersAndAroundHoles) {
  const auto regions =
      still::connected_components(picture({"1110011",  //
                                           "1010000", "1110101", "0001010", "1000000"}));
  EXPECT_EQ(regions.pixels, (std::vector<std::uint32_t>{12, 2, 1}));
  ImageMask number(7, 5);
  regions.for_each_pixel(7, [&](std::size_t i, std::uint32_t region) {
    number.data[i] = static_cast<std::uint8_t>(region + 1);
  });
  EXPECT_EQ(number, picture({"1110022", "1010000", "1110101", "0001010", "3000000"}));
}

TEST(ConnectedComponents, ArmsThatMeetBelowAreOne) {
  const auto regions = still::connected_components(picture({"10101", "10101", "11111"}));
  EXPECT_EQ(regions.pixels, (std::vector<std::uint32_t>{11}));
}

bool never(int, int) { return false; }

TEST(MovingRegions, ScatteredPixelsAreNone) {
  ImageMask strong(100, 100);
  for (int i = 0; i < 100; ++i) *strong.at(i * 37 % 100, i) = 1;
  for (const std::uint8_t m : still::moving_regions(strong, ImageMask(100, 100), never, 1).data)
    EXPECT_EQ(m, 0);
}

TEST(MovingRegions, WeakPixelsAndThoseWithoutDepthGoAlong) {
  ImageMask strong(100, 100), weak = strong, no_depth = strong;
  const auto fill = [&](ImageMask& mask, Rect r) {
    for (int y = r.y; y < r.y + r.height; ++y)
      for (int x = r.x; x < r.x + r.width; ++x) *mask.at(x, y) = 1;
  };
  fill(strong, {40, 40, 20, 20});
  fill(weak, {40, 60, 20, 5});                                   // feet
  fill(no_depth, {40, 35, 20, 5});                               // hair
  fill(weak, {0, 0, 20, 20}), fill(no_depth, {80, 80, 20, 20});  // neither touches what is strong
  const ImageMask moving = still::moving_regions(
      strong, no_depth, [&](int x, int y) { return *weak.at(x, y) != 0; }, 1);
  int count = 0;
  for (const std::uint8_t m : moving.data) count += m;
  EXPECT_EQ(count, 20 * 30);
  EXPECT_EQ(*moving.at(50, 36), 1);
  EXPECT_EQ(*moving.at(50, 64), 1);
}

}  // namespace
}  // namespace mr
