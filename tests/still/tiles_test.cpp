#include "mr/still/tiles.h"

#include <gtest/gtest.h>

#include "still/room.h"

namespace mr {
namespace {

TEST(Tiles, ConfirmedWhereMostIsAndNothingMoves) {
  ImageMask confirmed(20, 16, 1), moving(20, 16);
  *moving.at(9, 3) = 1;
  for (int y = 8; y < 16; ++y)
    for (int x = 0; x < 5; ++x) *confirmed.at(x, y) = 0;
  const TileMask tiles = still::confirmed_tiles(confirmed, moving);
  EXPECT_EQ(tiles.columns, 3);
  EXPECT_EQ(tiles.rows, 2);
  EXPECT_EQ(tiles.tiles, (std::vector<std::uint8_t>{1, 0, 1, 0, 1, 1}));
}

TEST(Tiles, ColourIsHiddenWhereWhatMovesIsSeen) {
  const Camera camera = test::Room::camera();
  ImageDepth depth(camera.width, camera.height, 2);
  ImageMask moving(camera.width, camera.height);
  for (int y = 48; y < 64; ++y)
    for (int x = 64; x < 80; ++x) *moving.at(x, y) = 1;
  Pose T_color_depth;
  T_color_depth.translation.x = 2.0 * 32 / camera.fx;  // 32 pixels at 2 m
  const TileMask tiles = still::unoccluded_tiles(depth, moving, camera, camera, T_color_depth);
  EXPECT_EQ(tiles.columns, 10);
  for (int row = 0; row < tiles.rows; ++row)
    for (int column = 0; column < tiles.columns; ++column)
      EXPECT_EQ(tiles.at(column, row), column < 5 || column > 7 || row < 2 || row > 4)
          << column << ' ' << row;
}

TEST(Tiles, PartsHoldAllThatIsSet) {
  ImageMask mask(200, 100);
  *mask.at(40, 50) = *mask.at(60, 90) = *mask.at(199, 0) = 1;
  const auto parts = still::covering_rectangles(mask, 8);
  EXPECT_EQ(parts, (std::vector<Rect>{{24, 42, 48, 57}, {184, 0, 16, 9}}));
  EXPECT_TRUE(still::covering_rectangles(ImageMask(64, 64), 8).empty());
}

}  // namespace
}  // namespace mr
