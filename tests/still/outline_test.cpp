#include "mr/still/outline.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <functional>
#include <random>

#include "mr/core/parallel.h"
#include "mr/still/tiles.h"

namespace mr::still {
namespace {

using Rgb = std::array<int, 3>;
constexpr int kAlphaStep_px = AlphaPlane::kStep_px;

Camera pinhole(int width, int height, double f) {
  Camera c;
  c.width = width, c.height = height, c.fx = c.fy = f;
  c.cx = 0.5 * (width - 1), c.cy = 0.5 * (height - 1);
  return c;
}

/// A disc of 0.4 m radius at 2 m before a wall at 4 m, seen by a depth camera and a colour camera
/// of twice its resolution in one place.
struct Stage {
  static constexpr float kDisc_m = 2, kWall_m = 4;
  static constexpr double kRadius_m = 0.4;

  Camera depth_camera = pinhole(200, 160, 180), color_camera = pinhole(397, 317, 360);
  Rgb disc{40, 90, 180}, wall{170, 165, 160};
  std::function<bool(int x, int y)> drops_out = [](int, int) { return false; };  ///< of the depth
  std::function<Rgb(Rgb wall, int x, int y)> light = [](Rgb c, int, int) { return c; };
  std::function<Rgb(Rgb disc, int x, int y)> pattern = [](Rgb c, int, int) { return c; };
  int noise = 0;                             ///< levels of colour
  double depth_radius_m = kRadius_m - 0.02;  ///< cleaning takes the border
  bool has_plate = true;
  bool is_known = true;  ///< that the disc is not the room
  unsigned seed = 1;

  static double from_middle(const Camera& camera, double x, double y) {
    return kDisc_m * std::hypot((x - camera.cx) / camera.fx, (y - camera.cy) / camera.fy);
  }
  bool on_disc(double x, double y) const { return from_middle(color_camera, x, y) < kRadius_m; }

  /// Alpha as it should be; a pixel of its plane lies on the disc if its middle does.
  bool shown(int x, int y) const {
    return on_disc((x + 0.5) * kAlphaStep_px - 0.5, (y + 0.5) * kAlphaStep_px - 0.5);
  }

  Outline find(OutlineFinder& finder) {
    std::mt19937 random(seed);
    std::uniform_int_distribution<int> jitter(-noise, noise);
    const int w = depth_camera.width, h = depth_camera.height;
    ImageDepth measured(w, h), cleaned(w, h);
    ImageMask moving(w, h);
    for (int y = 0; y < h; ++y)
      for (int x = 0; x < w; ++x) {
        const double r = from_middle(depth_camera, x, y);
        const bool border = r >= depth_radius_m && r < kRadius_m;
        *moving.at(x, y) = r < kRadius_m;
        *measured.at(x, y) = drops_out(x, y) || border ? 0 : r < kRadius_m ? kDisc_m : kWall_m;
        if (*moving.at(x, y)) *cleaned.at(x, y) = *measured.at(x, y);
      }
    ImageRgb color(color_camera.width, color_camera.height), plate = color;
    for (int y = 0; y < color.height; ++y)
      for (int x = 0; x < color.width; ++x) {
        const Rgb now = on_disc(x, y) ? pattern(disc, x, y) : light(wall, x, y);
        for (int c = 0; c < 3; ++c) {
          color.at(x, y)[c] =
              static_cast<std::uint8_t>(std::clamp(now[c] + jitter(random), 0, 255));
          plate.at(x, y)[c] = static_cast<std::uint8_t>(wall[c]);
        }
      }
    TileMask known{kColorTile_px, (color.width + 15) / 16, (color.height + 15) / 16, {}};
    known.tiles.assign(static_cast<std::size_t>(known.columns) * known.rows, has_plate);
    return finder.find({measured,
                        cleaned,
                        moving,
                        is_known ? moving : ImageMask(w, h),
                        {color, plate, known, {1, 1, 1}}});
  }
  Outline find() {
    OutlineFinder finder(depth_camera, color_camera, Pose{});
    return find(finder);
  }

  /// Of the plane's pixels over two from the true outline, those that are wrong.
  int wrong(const ImageMask& alpha, bool only_disc = false) const {
    int out = 0;
    for (int y = 0; y < alpha.height; ++y)
      for (int x = 0; x < alpha.width; ++x) {
        const double r = from_middle(color_camera, (x + 0.5) * kAlphaStep_px - 0.5,
                                     (y + 0.5) * kAlphaStep_px - 0.5);
        const double two_px = 2.0 * kAlphaStep_px / color_camera.fx * kDisc_m;
        const bool is_near = r < kRadius_m + 0.1;  // farther away nothing need be cut
        if (!is_near || std::abs(r - kRadius_m) < two_px || (only_disc && r > kRadius_m)) continue;
        out += (*alpha.at(x, y) != 0) != shown(x, y);
      }
    return out;
  }
};

TEST(OutlineFinder, CutsWhereTheColourEdgeIs) {
  Stage stage;
  const Outline out = stage.find();
  ASSERT_EQ(out.alpha.width, 199);
  ASSERT_EQ(out.alpha.height, 159);
  int cut = 0, wrong = 0;
  for (int y = 0; y < out.alpha.height; ++y)
    for (int x = 0; x < out.alpha.width; ++x) cut += *out.alpha.at(x, y) == 0;
  EXPECT_GT(cut, 500);
  EXPECT_EQ(stage.wrong(out.alpha), 0);
  // At the outline itself no pixel is off by more than one.
  for (int y = 1; y + 1 < out.alpha.height; ++y)
    for (int x = 1; x + 1 < out.alpha.width; ++x) {
      const double r = Stage::from_middle(stage.color_camera, 2 * x + 0.5, 2 * y + 0.5);
      if (std::abs(r - Stage::kRadius_m) > 0.05 || (*out.alpha.at(x, y) != 0) == stage.shown(x, y))
        continue;
      bool beside = false;
      for (int dy = -1; dy <= 1; ++dy)
        for (int dx = -1; dx <= 1; ++dx) beside |= stage.shown(x + dx, y + dy) != stage.shown(x, y);
      wrong += !beside;
    }
  EXPECT_EQ(wrong, 0);
}

/// How far depth reaches, as a share of the disc; and whether it reaches beyond it.
struct Reach {
  double covered = 0;
  int beyond = 0;

  Reach(const Stage& stage, const ImageDepth& depth) {
    int all = 0, with_depth = 0;
    const double pixel_m = Stage::kDisc_m / stage.depth_camera.fx;
    for (int y = 0; y < depth.height; ++y)
      for (int x = 0; x < depth.width; ++x) {
        const double r = Stage::from_middle(stage.depth_camera, x, y);
        const bool has_depth = *depth.at(x, y) > 0;
        if (r < Stage::kRadius_m - 0.5 * pixel_m) ++all, with_depth += has_depth;
        beyond += has_depth && r > Stage::kRadius_m + 1.5 * pixel_m;
      }
    covered = static_cast<double>(with_depth) / all;
  }
};

TEST(OutlineFinder, DepthReachesTheColourEdge) {
  Stage stage;
  const Outline out = stage.find();
  const Reach reach(stage, out.depth);
  EXPECT_GT(reach.covered, 0.995);  // 0.90 as measured
  EXPECT_EQ(reach.beyond, 0);
  for (const float d : out.depth.data)
    if (d > 0) {
      EXPECT_NEAR(d, Stage::kDisc_m, 0.05);
    }
}

TEST(OutlineFinder, FillsHairThatDepthMisses) {
  Stage stage;
  stage.drops_out = [](int, int y) { return y < 60; };  // the top of the disc, and the wall
  const Outline out = stage.find();
  const Reach reach(stage, out.depth);
  EXPECT_GT(reach.covered, 0.98);
  EXPECT_EQ(reach.beyond, 0);
  EXPECT_EQ(stage.wrong(out.alpha, true), 0);
}

/// So another sensor that sees such a place straight on knows it better than a flange would say.
TEST(OutlineFinder, WhatIsAddedTurnsAway) {
  Stage stage;
  stage.drops_out = [](int, int y) { return y < 60; };
  const ImageDepth depth = stage.find().depth;
  const int x = depth.width / 2;
  int y = 60;
  float before = *depth.at(x, y);
  EXPECT_NEAR(before, Stage::kDisc_m, 1e-4);
  for (--y; y >= 0 && *depth.at(x, y) > 0; --y) {
    EXPECT_GT(*depth.at(x, y), before);
    before = *depth.at(x, y);
  }
  EXPECT_LT(y, 55);
  EXPECT_LT(before, Stage::kDisc_m + 0.08f);  // not behind a wall
}

TEST(OutlineFinder, FillsWhereColourHardlyTells) {
  Stage stage;
  stage.drops_out = [](int, int y) { return y < 60; };
  stage.pattern = [&](Rgb disc, int x, int y) {  // gaps, 15 levels from the wall
    const auto [r, g, b] = stage.wall;
    return y < 120 && x / 4 % 4 == 0 ? Rgb{r - 15, g, b + 15} : disc;
  };
  EXPECT_GT(Reach(stage, stage.find().depth).covered, 0.97);
}

TEST(OutlineFinder, DoesNotGrowOverWhatLooksLikeTheRoom) {
  Stage stage;
  stage.drops_out = [](int x, int y) { return x > 100 && y < 60; };
  stage.disc = stage.wall;  // nobody can tell it from the wall
  const Outline out = stage.find();
  EXPECT_EQ(Reach(stage, out.depth).beyond, 0);
}

TEST(OutlineFinder, BlackHairBeforeABlackWallIsNotEaten) {
  Stage stage;
  stage.disc = {22, 20, 24}, stage.wall = {25, 24, 26};
  stage.drops_out = [](int, int y) { return y < 60; };
  const Outline out = stage.find();
  EXPECT_EQ(stage.wrong(out.alpha, true), 0);
}

TEST(OutlineFinder, AShadowOnTheWallStaysWall) {
  Stage stage;
  stage.light = [](Rgb wall, int x, int) {
    return x > 200 ? Rgb{wall[0] * 3 / 4, wall[1] * 3 / 4, wall[2] * 3 / 4} : wall;
  };
  const Outline out = stage.find();
  EXPECT_EQ(stage.wrong(out.alpha), 0);
  EXPECT_EQ(Reach(stage, out.depth).beyond, 0);
}

TEST(OutlineFinder, WithoutAPlateAllStays) {
  Stage stage;
  stage.has_plate = false;
  stage.drops_out = [](int x, int y) { return x > 100 && y < 60; };
  const Outline out = stage.find();
  EXPECT_EQ(std::ranges::count(out.alpha.data, 0), 0);
  stage.disc = stage.wall, stage.has_plate = true;  // looks like the room: nothing grows
  EXPECT_EQ(out.depth, stage.find().depth);
}

TEST(OutlineFinder, WhatMayBeTheRoomIsKeptAsItIs) {
  Stage stage;
  stage.is_known = false;
  stage.drops_out = [](int, int y) { return y < 60; };
  const Outline out = stage.find();
  EXPECT_EQ(std::ranges::count(out.alpha.data, 0), 0);
  EXPECT_LT(Reach(stage, out.depth).covered, 0.9);
}

TEST(OutlineFinder, NothingIsCutWhereNothingMoves) {
  Stage stage;
  stage.depth_radius_m = 0;  // nothing is left by cleaning
  const Outline out = stage.find();
  EXPECT_EQ(std::ranges::count(out.alpha.data, 0), 0);
  EXPECT_EQ(std::ranges::count_if(out.depth.data, [](float d) { return d > 0; }), 0);
}

TEST(OutlineFinder, AFingerThatDepthTakesForTheWallGrows) {
  Stage stage;
  const auto on_finger = [&](double x, double y) {  // 4 pixels of depth long, 3 wide
    const double r = Stage::from_middle(stage.color_camera, x, y);
    return x > stage.color_camera.cx && std::abs(y - stage.color_camera.cy) < 3 &&
           r < Stage::kRadius_m + 3.4 / stage.depth_camera.fx * Stage::kDisc_m;
  };
  stage.light = [&](Rgb wall, int x, int y) { return on_finger(x, y) ? stage.disc : wall; };
  const Outline out = stage.find();
  const int y = stage.depth_camera.height / 2;
  const int tip = static_cast<int>(stage.depth_camera.cx +
                                   Stage::kRadius_m / Stage::kDisc_m * stage.depth_camera.fx + 2);
  EXPECT_NEAR(*out.depth.at(tip, y), Stage::kDisc_m, 0.1);
  EXPECT_EQ(*out.depth.at(tip, y - 8), 0) << "beside the finger is wall";
  EXPECT_EQ(*out.alpha.at(2 * tip * stage.color_camera.width / 2 / stage.color_camera.width, y), 1);
}

TEST(OutlineFinder, SpecksOnTheWallAreNoOutline) {
  Stage stage;
  stage.light = [](Rgb wall, int x, int y) {
    return x / 2 % 5 == 0 && y / 2 % 5 == 0 ? Rgb{0, 0, 0} : wall;
  };
  EXPECT_EQ(stage.wrong(stage.find().alpha), 0);
}

/// How many pixels of alpha change from capture to capture in noise, at most.
int most_changes(Stage stage) {
  OutlineFinder finder(stage.depth_camera, stage.color_camera, Pose{});
  ImageMask before = stage.find(finder).alpha;
  int most = 0;
  for (unsigned i = 2; i < 9; ++i) {
    stage.seed = i;
    const ImageMask now = stage.find(finder).alpha;
    int changed = 0;
    for (std::size_t p = 0; p < now.data.size(); ++p) changed += now.data[p] != before.data[p];
    if (i > 4) most = std::max(most, changed);
    before = now;
  }
  return most;
}

TEST(OutlineFinder, IsSteadyInNoise) {
  Stage stage;
  stage.noise = 8;
  stage.disc = {170, 128, 160};                   // as different from the wall as is told
  stage.depth_radius_m = 0.3;                     // colour alone tells where it ends
  EXPECT_LT(most_changes(std::move(stage)), 50);  // of some 2,000 that colour decides
}

TEST(OutlineFinder, TheSameOnAnyNumberOfThreads) {
  Stage stage;
  stage.noise = 6;
  Outline one, four;
  Arena(1).run([&] { one = stage.find(); });
  Arena(4).run([&] { four = stage.find(); });
  EXPECT_EQ(one.depth, four.depth);
  EXPECT_EQ(one.alpha, four.alpha);
}

}  // namespace
}  // namespace mr::still
