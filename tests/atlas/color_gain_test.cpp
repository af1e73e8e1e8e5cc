#include "mr/atlas/color_gain.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <vector>

#include "mr/atlas/compose.h"
#include "mr/atlas/layout.h"
#include "mr/core/parallel.h"
#include "support/meshes.h"

namespace mr {
namespace {

using atlas::ColorBalance;
using atlas::Gains;
using atlas::Pictures;

std::uint8_t to_srgb(double linear) {
  const double v = linear <= 0.0031308 ? linear * 12.92 : 1.055 * std::pow(linear, 1 / 2.4) - 0.055;
  return static_cast<std::uint8_t>(std::clamp(v * 255 + 0.5, 0.0, 255.0));
}

/// A wall 8 m wide and 3 m high, 2 m in front of cameras in a row, in linear light.
constexpr float kWall_m = 2;
Vec3d paint(double x, double y) {
  return {0.30 + 0.10 * std::sin(1.5 * x), 0.35 + 0.08 * std::cos(2 * y), 0.25 + 0.02 * x};
}
Mesh wall() {
  Mesh mesh = test::grid({-4, 1.5f, kWall_m}, {8, 0, 0}, {0, -3, 0}, 40, 15);
  std::vector<ViewId> views(mesh.triangles.size());
  for (std::size_t t = 0; t < views.size(); ++t) views[t] = ViewId{mesh.centroid(t).x > 0};
  set_triangle_views(mesh, views);
  return mesh;
}

struct Rig {
  std::vector<View> views;
  Pictures pictures;

  /// A camera at x that is `exposure` times as bright as the others.
  void add(double x, Vec3d exposure, View::Kind kind = View::Kind::pinhole) {
    View v;
    const auto number = static_cast<std::uint32_t>(views.size());
    v.id = ViewId{number}, v.stream = StreamId{number};
    v.kind = kind, v.width = 320, v.height = 180;
    v.fx = v.fy = 200, v.cx = 159.5, v.cy = 89.5;
    v.T_world_camera.translation = {x, 0, 0};
    v.image_rect = v.atlas_rect = {0, 0, v.width, v.height};
    views.push_back(v);
    draw(number, exposure);
  }
  void draw(std::uint32_t camera, Vec3d exposure,
            const std::function<Vec3d(double x, double y)>& painted = paint) {
    const View& v = views[camera];
    auto picture = std::make_shared<ImageRgb>(v.width, v.height);
    for (int y = 0; y < v.height; ++y)
      for (int x = 0; x < v.width; ++x) {
        const Vec3d ray = unproject(v.camera(), {1.0 * x, 1.0 * y});
        if (ray.z <= 0) continue;
        const Vec3d p = v.T_world_camera.translation + ray * (kWall_m / ray.z);
        for (int c = 0; c < 3; ++c)
          picture->at(x, y)[c] = to_srgb(painted(p.x, p.y)[c] * exposure[c]);
      }
    pictures[v.stream] = picture;
  }
};

Gains balanced(const Mesh& mesh, const Rig& rig) {
  ColorBalance balance;
  balance.update(mesh, rig.views, rig.pictures);
  return balance.gains();
}

/// Gain times exposure must be the same for both views, in each channel.
void expect_balanced(const Gains& gains, std::uint32_t a, Vec3d exposure_a, std::uint32_t b,
                     Vec3d exposure_b) {
  for (int c = 0; c < 3; ++c) {
    const double ratio =
        gains.at(ViewId{a})[c] * exposure_a[c] / (gains.at(ViewId{b})[c] * exposure_b[c]);
    EXPECT_NEAR(ratio, 1, 0.02) << "views " << a << " and " << b << ", channel " << c;
  }
}

constexpr Vec3d kPlain{1, 1, 1}, kWarm{1.3, 1, 0.8};

TEST(ColorBalance, TwoViewsOfAWallAgree) {
  Rig rig;
  rig.add(-0.6, kPlain), rig.add(0.6, kWarm);
  const Gains gains = balanced(wall(), rig);
  expect_balanced(gains, 0, kPlain, 1, kWarm);
  for (int c = 0; c < 3; ++c)  // the mean stays
    EXPECT_NEAR(gains.at(ViewId{0})[c] * gains.at(ViewId{1})[c], 1, 0.02);
}

TEST(ColorBalance, SeamsAreHardToSee) {
  Rig rig;
  rig.add(-0.6, kPlain), rig.add(0.6, kWarm);
  const double before = atlas::seam_color_step(wall(), rig.views, rig.pictures, {});
  const double after =
      atlas::seam_color_step(wall(), rig.views, rig.pictures, balanced(wall(), rig));
  const double without = to_srgb(1.3 * 0.30) - to_srgb(0.30);
  EXPECT_NEAR(before, without, 2);
  EXPECT_LT(after, 0.2 * before);
}

TEST(SeamColorStep, CanBeLimitedToWhatIsPlain) {
  const auto striped_above = [](double x, double y) {
    const double stripe = std::sin(60 * x) > 0 && y < 0 ? 0.2 : 1;
    return paint(x, y) * stripe;
  };
  Rig rig;
  rig.add(-0.6, kPlain), rig.add(0.6, kWarm);
  const double plain = atlas::seam_color_step(wall(), rig.views, rig.pictures, {}, 12);
  EXPECT_NEAR(plain, atlas::seam_color_step(wall(), rig.views, rig.pictures, {}), 0.5);
  rig.draw(1, kPlain, striped_above);  // as if it were calibrated badly
  rig.draw(0, kPlain);
  EXPECT_GT(atlas::seam_color_step(wall(), rig.views, rig.pictures, {}), 10);
  EXPECT_LT(atlas::seam_color_step(wall(), rig.views, rig.pictures, {}, 12), 1);
}

TEST(ColorBalance, AChainOfViewsAgrees) {
  Rig rig;  // each sees 3.2 m: the outer two see nothing in common
  constexpr Vec3d kDark{0.7, 0.75, 0.8};
  rig.add(-2, kDark), rig.add(0, kPlain), rig.add(2, kWarm);
  const Gains gains = balanced(wall(), rig);
  expect_balanced(gains, 0, kDark, 1, kPlain);
  expect_balanced(gains, 1, kPlain, 2, kWarm);
}

TEST(ColorBalance, APanoramaAgreesWithAPinhole) {
  Rig rig;
  rig.add(0, kPlain), rig.add(0.3, kWarm, View::Kind::equirectangular);
  expect_balanced(balanced(wall(), rig), 0, kPlain, 1, kWarm);
}

TEST(ColorBalance, ViewsWithoutOverlapStayAsTheyAre) {
  Rig rig;
  rig.add(-2, kPlain), rig.add(2, kWarm);
  const Gains gains = balanced(wall(), rig);
  ASSERT_EQ(gains.size(), 2u);
  for (const auto& [id, gain] : gains) EXPECT_EQ(gain, (Vec3f{1, 1, 1}));
  for (const auto& [id, gain] : balanced({}, rig)) EXPECT_EQ(gain, (Vec3f{1, 1, 1}));
  EXPECT_TRUE(balanced(wall(), {}).empty());
}

TEST(ColorBalance, WhatIsHiddenIsNoEvidence) {
  Rig rig;  // a screen between the second camera and the wall, which its picture does not show
  rig.add(-0.3, kPlain), rig.add(0.3, kWarm);
  Mesh mesh = wall();
  clear_labels(mesh);
  append(mesh, test::grid({0, 0.5f, 0.3f}, {0.6f, 0, 0}, {0, -1, 0}, 4, 4));
  for (const auto& [id, gain] : balanced(mesh, rig)) EXPECT_EQ(gain, (Vec3f{1, 1, 1}));
}

TEST(ColorBalance, AlikeViewsLeaveTheAtlasUntouched) {
  Rig rig;
  rig.add(-0.6, kPlain), rig.add(0.6, kPlain);
  const Gains gains = balanced(wall(), rig);
  for (const auto& [id, gain] : gains) EXPECT_EQ(gain, (Vec3f{1, 1, 1}));
  const atlas::Layout layout = *atlas::make_layout(rig.views, {}, 1, 1);
  const std::map<ViewId, View> children{{ViewId{0}, rig.views[0]}, {ViewId{1}, rig.views[1]}};
  EXPECT_EQ(atlas::compose_atlas(layout, children, rig.pictures, {}, false, gains),
            atlas::compose_atlas(layout, children, rig.pictures, {}, false));
}

TEST(ColorBalance, ClippedPixelsAreNoEvidence) {
  const auto half_white = [](double x, double y) {
    return x > 0 ? Vec3d{1, 1, 1} : paint(x, y);  // clipped in both, which suggests a ratio of 1
  };
  Rig rig;
  rig.add(-0.3, kPlain), rig.add(0.6, kPlain);
  constexpr Vec3d kBright{1.4, 1.4, 1.4};
  rig.draw(0, kPlain, half_white), rig.draw(1, kBright, half_white);
  expect_balanced(balanced(wall(), rig), 0, kPlain, 1, kBright);
}

TEST(ColorBalance, AThirdOfWrongPixelsDoesNotMatter) {
  Rig rig;  // something on the wall that only one of them has seen
  rig.add(-0.3, kPlain), rig.add(0.3, kWarm);
  rig.draw(1, kWarm, [](double x, double y) {
    return std::abs(x) < 0.4 ? Vec3d{0.05, 0.05, 0.3} : paint(x, y);
  });
  expect_balanced(balanced(wall(), rig), 0, kPlain, 1, kWarm);
}

TEST(ColorBalance, GainsAreLimited) {
  Rig rig;
  rig.add(-0.3, {0.08, 0.08, 0.08}), rig.add(0.3, {1.8, 1.8, 1.8});
  for (const auto& [id, gain] : balanced(wall(), rig))
    EXPECT_FLOAT_EQ(gain.x, id == ViewId{0} ? 3 : 1 / 3.0f);
}

TEST(ColorBalance, AViewThatReturnsFitsAtOnce) {
  Rig rig;
  rig.add(-0.6, kPlain), rig.add(0, kPlain), rig.add(0.6, kWarm);
  const std::vector<View> fewer(rig.views.begin(), rig.views.begin() + 2);
  ColorBalance balance;
  balance.update(wall(), rig.views, rig.pictures);
  const Gains all = balance.gains();
  balance.update(wall(), fewer, rig.pictures);
  ASSERT_EQ(balance.gains().size(), 2u);
  EXPECT_NEAR(balance.gains().at(ViewId{0}).x, all.at(ViewId{0}).x,
              0.01);  // the others take their time
  for (int frame = 0; frame < 200; ++frame) balance.update(wall(), fewer, rig.pictures);
  EXPECT_NEAR(balance.gains().at(ViewId{0}).x, 1, 0.01);
  balance.update(wall(), rig.views, rig.pictures);
  expect_balanced(balance.gains(), 0, kPlain, 2, kWarm);
  for (int frame = 0; frame < 200; ++frame) balance.update(wall(), rig.views, rig.pictures);
  EXPECT_NEAR(balance.gains().at(ViewId{0}).x, all.at(ViewId{0}).x, 0.01);
}

TEST(ColorBalance, AChangeOfExposureIsFollowedSmoothlyAndThenStandsStill) {
  Rig rig;
  rig.add(-0.6, kPlain), rig.add(0.6, kPlain);
  ColorBalance balance;
  balance.update(wall(), rig.views, rig.pictures);
  rig.draw(1, kWarm);
  double last = 1;
  for (int frame = 0; frame < 250; ++frame) {
    balance.update(wall(), rig.views, rig.pictures);
    const double now = balance.gains().at(ViewId{0}).x;
    EXPECT_LT(std::abs(now - last), 0.015);
    last = now;
  }
  expect_balanced(balance.gains(), 0, kPlain, 1, kWarm);
  const Gains settled = balance.gains();
  for (int frame = 0; frame < 20; ++frame) balance.update(wall(), rig.views, rig.pictures);
  EXPECT_EQ(balance.gains(), settled);
}

TEST(ColorBalance, TheSameOnAnyNumberOfThreads) {
  Rig rig;
  rig.add(-0.6, kPlain), rig.add(0, {0.9, 1.1, 1}), rig.add(0.6, kWarm);
  const auto on = [&](int threads) {
    Gains gains;
    Arena(threads).run([&] { gains = balanced(wall(), rig); });
    return gains;
  };
  const Gains one = on(1);
  EXPECT_NE(one.at(ViewId{0}), (Vec3f{1, 1, 1}));
  EXPECT_EQ(on(2), one);
  EXPECT_EQ(on(8), one);
}

TEST(ColorBalance, BrokenInputIsHarmless) {
  Rig rig;
  rig.add(-0.6, kPlain), rig.add(0.6, kWarm), rig.add(0, kPlain), rig.add(0.1, kPlain);
  rig.pictures[StreamId{0}] = std::make_shared<ImageRgb>(16, 16);  // smaller than the view
  rig.pictures[StreamId{1}] = nullptr;
  rig.pictures.erase(StreamId{2});
  Mesh mesh = wall();
  mesh.positions[3].x = std::numeric_limits<float>::quiet_NaN();
  for (const auto& [id, gain] : balanced(mesh, rig)) EXPECT_EQ(gain, (Vec3f{1, 1, 1}));
  EXPECT_EQ(atlas::seam_color_step(mesh, rig.views, rig.pictures, {}), 0);
}

TEST(GainTables, OneLeavesBytesAndTwoIsAStopInLinearLight) {
  const atlas::GainTables tables = atlas::gain_tables({1, 2, 0.5f});
  for (int i = 0; i < 256; ++i) EXPECT_EQ(tables[0][i], i);
  EXPECT_EQ(tables[1][to_srgb(0.2)], to_srgb(0.4));
  EXPECT_EQ(tables[1][255], 255);
  EXPECT_EQ(tables[2][255], to_srgb(0.5));
}

TEST(Compose, GainsApplyToTheirTileOnly) {
  Rig rig;
  rig.add(-0.6, kPlain), rig.add(0.6, kPlain);
  const atlas::Layout layout = *atlas::make_layout(rig.views, {}, 1, 1);
  const std::map<ViewId, View> children{{ViewId{0}, rig.views[0]}, {ViewId{1}, rig.views[1]}};
  const Gains gains{{ViewId{1}, {1.2f, 1, 0.7f}}};
  const ImageRgb plain = atlas::compose_atlas(layout, children, rig.pictures, {}, false);
  const ImageRgb changed = atlas::compose_atlas(layout, children, rig.pictures, {}, false, gains);
  const atlas::GainTables tables = atlas::gain_tables(gains.at(ViewId{1}));
  for (const View& tile : layout.views)
    for (int y = 0; y < tile.atlas_rect.height; ++y)
      for (int x = 0; x < tile.atlas_rect.width; ++x)
        for (int c = 0; c < 3; ++c) {
          const std::uint8_t was = plain.at(tile.atlas_rect.x + x, tile.atlas_rect.y + y)[c];
          const std::uint8_t is = changed.at(tile.atlas_rect.x + x, tile.atlas_rect.y + y)[c];
          ASSERT_EQ(is, tile.id == ViewId{1} ? tables[c][was] : was);
        }
}

}  // namespace
}  // namespace mr
