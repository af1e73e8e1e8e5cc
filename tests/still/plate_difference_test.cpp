#include "mr/still/plate_difference.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <vector>

namespace mr::still {
namespace {

/// A grey room of 64x32 pixels, one level all over, and a capture of it.
struct Pictures {
  ImageRgb color{64, 32, 100}, plate{64, 32, 100};
  TileMask known{kColorTile_px, 4, 2, std::vector<std::uint8_t>(8, 1)};

  PlateDifference::Input input() const { return {color, plate, known, {1, 1, 1}}; }
  /// Sets the green of the capture.
  void paint(std::uint8_t level) {
    for (std::size_t i = 1; i < color.data.size(); i += 3) color.data[i] = level;
  }
};

TEST(PlateDifference, TellsTheRoomFromWhatIsBeforeIt) {
  Pictures pictures;
  const ImageMask never;
  EXPECT_EQ(PlateDifference(pictures.input(), never).at(3, 3), PlateColor::same);
  pictures.paint(120);
  EXPECT_EQ(PlateDifference(pictures.input(), never).at(3, 3), PlateColor::unsure);
  pictures.paint(160);
  EXPECT_EQ(PlateDifference(pictures.input(), never).at(3, 3), PlateColor::different);
  std::ranges::fill(pictures.known.tiles, std::uint8_t{0});
  EXPECT_EQ(PlateDifference(pictures.input(), never).at(3, 3), PlateColor::unknown);
}

TEST(PlateDifference, WhatWasDifferentStaysSoForLess) {
  Pictures pictures;
  pictures.paint(160);
  const ImageMask never;
  PlateDifference first(pictures.input(), never);
  EXPECT_EQ(first.at(3, 3), PlateColor::different);
  const ImageMask was_different = first.take_different();
  EXPECT_EQ(*was_different.at(7, 7), 1);  // of the same block
  EXPECT_EQ(*was_different.at(8, 3), 0);  // was not looked at
  pictures.paint(121);
  PlateDifference next(pictures.input(), was_different);
  EXPECT_EQ(next.at(3, 3), PlateColor::different);
  EXPECT_EQ(next.at(8, 3), PlateColor::unsure);
}

}  // namespace
}  // namespace mr::still
