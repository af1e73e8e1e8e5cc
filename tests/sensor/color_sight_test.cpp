#include "mr/sensor/color_sight.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "support/depth_pictures.h"

namespace mr {
namespace {

using sensor::ColorSight;

constexpr float kWall_m = 3;

/// A depth camera and a colour camera in one place, before a wall; the colour camera sees 320x240
/// pixels, 20x15 tiles.
struct Sight {
  Camera depth = test::pinhole(160, 120, 130);
  Camera color = test::pinhole(320, 240, 260);
  std::optional<Box3d> volume{};
  ImageDepth measured = wall(), cleaned = wall();

  static ImageDepth wall() { return {160, 120, kWall_m}; }
  /// Sets depth in the tiles [first, last] of both directions.
  static void set(ImageDepth& picture, int first, int last, float z) {
    for (int y = 8 * first; y < 8 * (last + 1); ++y)
      for (int x = 8 * first; x < 8 * (last + 1); ++x) *picture.at(x, y) = z;
  }
  TileMask blind(const ImageMask* of = nullptr, const Pose& T_world_depth = {}) const {
    return ColorSight(depth, color, {}, volume).blind(measured, cleaned, of, T_world_depth);
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

TEST(ColorSight, SeesWhatTheDepthPictureShows) {
  const TileMask blind = Sight().blind();
  EXPECT_TRUE(blind.is_of(320, 240));
  EXPECT_EQ(blind.tile_px, ColorSight::kTile_px);
  EXPECT_TRUE(none(blind));
}

TEST(ColorSight, IsBlindBeyondTheDepthPicture) {
  Sight sight;
  sight.depth.fx = sight.depth.fy = 195;  // 213 of 320 columns, 160 of 240 rows
  const TileMask blind = sight.blind();
  // It begins at column 54 and row 41; a tile more is seen.
  for (int column = 0; column < blind.columns; ++column)
    EXPECT_EQ(blind.at(column, 7), column < 2 || column > 17) << column;
  for (int row = 0; row < blind.rows; ++row)
    EXPECT_EQ(blind.at(10, row), row < 2 || row > 12) << row;
}

TEST(ColorSight, APixelWithoutDepthIsNotBlind) {
  Sight sight;
  Sight::set(sight.measured, 3, 9, 0), Sight::set(sight.cleaned, 3, 9, 0);
  EXPECT_TRUE(none(sight.blind()));
}

TEST(ColorSight, WhatLiesBeforeTheVolumeHides) {
  Sight sight;
  Sight::set(sight.measured, 3, 6, 1), Sight::set(sight.cleaned, 3, 6, 1);
  EXPECT_TRUE(none(sight.blind())) << "it is reconstructed";
  sight.volume = Box3d{{-9, -9, 2}, {9, 9, 9}};
  EXPECT_TRUE(only(sight.blind(), 3, 6));
  // Seen from inside, and from a place whose rays do not enter it.
  EXPECT_TRUE(none(sight.blind(nullptr, Pose{{}, {0, 0, 2.5}})));
  EXPECT_TRUE(none(sight.blind(nullptr, Pose{{}, {0, 0, 20}})));
  // Behind it nothing is hidden.
  sight.volume = Box3d{{-9, -9, -9}, {9, 9, 2}};
  EXPECT_TRUE(none(sight.blind()));
}

TEST(ColorSight, WhatCleaningRemovesHides) {
  Sight sight;
  Sight::set(sight.measured, 3, 6, 1), Sight::set(sight.cleaned, 3, 6, 0);
  EXPECT_TRUE(only(sight.blind(), 3, 6));
  ImageMask of(160, 120);
  EXPECT_TRUE(none(sight.blind(&of))) << "it belongs to what is reconstructed otherwise";
  std::ranges::fill(of.data, 1);
  EXPECT_TRUE(only(sight.blind(&of), 3, 6));
}

TEST(ColorSight, MixedPixelsBehindASilhouetteDoNotHide) {
  Sight sight;
  Sight::set(sight.measured, 3, 6, 1), Sight::set(sight.cleaned, 3, 6, 1);
  for (int y = 24; y < 56; ++y)
    for (int x = 48; x < 54; ++x) *sight.measured.at(x, y) = 2, *sight.cleaned.at(x, y) = 0;
  EXPECT_TRUE(none(sight.blind())) << "nearer surface is left in these tiles";
}

TEST(ColorSight, ASpeckIsNoOccluder) {
  Sight sight;
  for (int x = 80; x < 84; ++x) *sight.measured.at(x, 60) = 1, *sight.cleaned.at(x, 60) = 0;
  EXPECT_TRUE(none(sight.blind()));
}

TEST(ColorSight, OfCoarseDepthAndOtherModelsOnlyTheBorderIsKnown) {
  Sight sight;
  sight.depth = test::pinhole(16, 12, 13);
  sight.measured = ImageDepth(16, 12, 1), sight.cleaned = ImageDepth(16, 12);
  EXPECT_TRUE(none(sight.blind()));
  sight.depth = {};
  sight.depth.model = CameraModel::equirectangular;
  sight.depth.width = 64, sight.depth.height = 32;
  sight.measured = ImageDepth(64, 32, 1), sight.cleaned = ImageDepth(64, 32);
  EXPECT_TRUE(none(sight.blind()));
}

}  // namespace
}  // namespace mr
