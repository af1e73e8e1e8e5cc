#include "mr/sensor/blind_tiles.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "support/depth_pictures.h"

namespace mr {
namespace {

using sensor::BlindTiles;

constexpr float kWall_m = 3;

/// A depth camera and a colour camera in one place, before a wall; the colour camera sees 320x240
/// pixels, 20x15 tiles.
struct TwoCameras {
  Camera depth = test::pinhole(160, 120, 130);
  Camera color = test::pinhole(320, 240, 260);
  Pose T_color_depth{};
  sensor::ReconstructedSpace space{};
  ImageDepth measured = wall(), cleaned = wall();

  static ImageDepth wall() { return {160, 120, kWall_m}; }
  /// Sets depth in the tiles [first, last] of both directions.
  static void set(ImageDepth& picture, int first, int last, float z) {
    for (int y = 8 * first; y < 8 * (last + 1); ++y)
      for (int x = 8 * first; x < 8 * (last + 1); ++x) *picture.at(x, y) = z;
  }
  TileMask blind(const ImageMask* of = nullptr, const Pose& T_world_depth = {}) const {
    return BlindTiles(depth, color, T_color_depth, space)
        .blind(measured, cleaned, of, T_world_depth);
  }
};

/// Whether exactly the tiles [first, last] of both directions are blind.
bool only(const TileMask& blind, int first, int last) {
  bool out = true;
  for (int row = 0; row < blind.rows; ++row)
    for (int column = 0; column < blind.columns; ++column)
      out &= blind.at(column, row) ==
             (std::min(column, row) >= first && std::max(column, row) <= last);
  return out;
}
bool none(const TileMask& blind) { return std::ranges::count(blind.tiles, 1) == 0; }

TEST(BlindTiles, NoneWhereTheDepthPictureShowsWhatIsMade) {
  const TileMask blind = TwoCameras().blind();
  EXPECT_TRUE(blind.is_of(320, 240));
  EXPECT_EQ(blind.tile_px, BlindTiles::kTile_px);
  EXPECT_TRUE(none(blind));
}

TEST(BlindTiles, BeyondTheDepthPicture) {
  TwoCameras cameras;
  cameras.depth.fx = cameras.depth.fy = 195;  // 213 of 320 columns, 160 of 240 rows
  const TileMask blind = cameras.blind();
  // It begins at column 54 and row 41; a tile more is seen.
  for (int column = 0; column < blind.columns; ++column)
    EXPECT_EQ(blind.at(column, 7), column < 2 || column > 17) << column;
  for (int row = 0; row < blind.rows; ++row)
    EXPECT_EQ(blind.at(10, row), row < 2 || row > 12) << row;
}

TEST(BlindTiles, NotWhereThisCaptureMeasuresSurface) {
  TwoCameras cameras;
  cameras.depth.fx = cameras.depth.fy = 195;
  cameras.T_color_depth.translation = {0.1, 0, 0};
  // The depth picture ends at column 292 for what is 1 m away, and beyond 320 for 0.3 m.
  EXPECT_TRUE(cameras.blind().at(19, 7));
  std::ranges::fill(cameras.measured.data, 0.3f), std::ranges::fill(cameras.cleaned.data, 0.3f);
  EXPECT_FALSE(cameras.blind().at(19, 7));
  EXPECT_TRUE(cameras.blind().at(0, 7)) << "nothing is measured there";
  std::ranges::fill(cameras.cleaned.data, 0.0f);
  EXPECT_TRUE(cameras.blind().at(19, 7)) << "no surface is made of it";
}

TEST(BlindTiles, APixelWithoutDepthIsNotBlind) {
  TwoCameras cameras;
  TwoCameras::set(cameras.measured, 3, 9, 0), TwoCameras::set(cameras.cleaned, 3, 9, 0);
  EXPECT_TRUE(none(cameras.blind()));
}

TEST(BlindTiles, WhatLiesBeforeTheVolumeHides) {
  TwoCameras cameras;
  TwoCameras::set(cameras.measured, 3, 6, 1), TwoCameras::set(cameras.cleaned, 3, 6, 1);
  EXPECT_TRUE(none(cameras.blind())) << "it is reconstructed";
  cameras.space.volume = Box3d{{-9, -9, 2}, {9, 9, 9}};
  EXPECT_TRUE(only(cameras.blind(), 3, 6));
  // Seen from inside, and from a place whose rays do not enter it.
  EXPECT_TRUE(none(cameras.blind(nullptr, Pose{{}, {0, 0, 2.5}})));
  EXPECT_TRUE(none(cameras.blind(nullptr, Pose{{}, {0, 0, 20}})));
  // Behind it nothing is hidden.
  cameras.space.volume = Box3d{{-9, -9, -9}, {9, 9, 2}};
  EXPECT_TRUE(none(cameras.blind()));
}

TEST(BlindTiles, WhatCleaningRemovesHides) {
  TwoCameras cameras;
  TwoCameras::set(cameras.measured, 3, 6, 1), TwoCameras::set(cameras.cleaned, 3, 6, 0);
  EXPECT_TRUE(only(cameras.blind(), 3, 6));
  ImageMask of(160, 120);
  EXPECT_TRUE(none(cameras.blind(&of))) << "it belongs to what is reconstructed otherwise";
  std::ranges::fill(of.data, 1);
  EXPECT_TRUE(only(cameras.blind(&of), 3, 6));
}

TEST(BlindTiles, ARemovedFloorHidesNothing) {
  TwoCameras cameras;
  cameras.space.up = {0, -1, 0};
  // From row 104 on: a floor 1 m below the camera, nearer than the wall.
  const auto set_floor = [&](ImageDepth& picture, bool is_removed) {
    for (int y = 104; y < 120; ++y)
      for (int x = 0; x < 160; ++x)
        *picture.at(x, y) = is_removed ? 0 : static_cast<float>(130 / (y - cameras.depth.cy));
  };
  set_floor(cameras.measured, false), set_floor(cameras.cleaned, true);
  EXPECT_FALSE(none(cameras.blind())) << "without a word about a floor it is something removed";
  cameras.space.floor = sensor::FloorConfig{.height_m = -1, .margin_m = 0.03};
  EXPECT_TRUE(none(cameras.blind()));
  // The floor is that of the world.
  cameras.space.floor->height_m = -3;
  EXPECT_FALSE(none(cameras.blind()));
  EXPECT_TRUE(none(cameras.blind(nullptr, Pose{{}, {0, 2, 0}})));
  // What stands on it and is removed does hide.
  cameras.space.floor->height_m = -1;
  TwoCameras::set(cameras.measured, 3, 6, 1), TwoCameras::set(cameras.cleaned, 3, 6, 0);
  EXPECT_TRUE(only(cameras.blind(), 3, 6));
}

TEST(BlindTiles, MixedPixelsBehindASilhouetteDoNotHide) {
  TwoCameras cameras;
  TwoCameras::set(cameras.measured, 3, 6, 1), TwoCameras::set(cameras.cleaned, 3, 6, 1);
  for (int y = 24; y < 56; ++y)
    for (int x = 48; x < 54; ++x) *cameras.measured.at(x, y) = 2, *cameras.cleaned.at(x, y) = 0;
  EXPECT_TRUE(none(cameras.blind())) << "nearer surface is left in these tiles";
}

TEST(BlindTiles, ASpeckIsNoOccluder) {
  TwoCameras cameras;
  for (int x = 80; x < 84; ++x) *cameras.measured.at(x, 60) = 1, *cameras.cleaned.at(x, 60) = 0;
  EXPECT_TRUE(none(cameras.blind()));
}

TEST(BlindTiles, OfCoarseDepthAndOtherModelsOnlyTheBorderIsKnown) {
  TwoCameras cameras;
  cameras.depth = test::pinhole(16, 12, 13);
  cameras.measured = ImageDepth(16, 12, 1), cameras.cleaned = ImageDepth(16, 12);
  EXPECT_TRUE(none(cameras.blind()));
  cameras.depth = {};
  cameras.depth.model = CameraModel::equirectangular;
  cameras.depth.width = 64, cameras.depth.height = 32;
  cameras.measured = ImageDepth(64, 32, 1), cameras.cleaned = ImageDepth(64, 32);
  EXPECT_TRUE(none(cameras.blind()));
}

}  // namespace
}  // namespace mr
