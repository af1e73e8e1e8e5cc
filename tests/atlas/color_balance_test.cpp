#include "mr/atlas/color_balance.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <vector>

#include "mr/atlas/seam_color.h"
#include "mr/core/parallel.h"
#include "support/meshes.h"

namespace mr {
namespace {

using atlas::ColorBalance;
using atlas::ColorField;
using atlas::Pictures;
using Fields = std::map<ViewId, ColorField>;

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

using Paint = std::function<Vec3d(double x, double y)>;
/// A factor on light that depends on the place in the picture, both coordinates 0..1.
using Lens = std::function<double(double x, double y)>;

struct Rig {
  std::vector<View> views;
  Pictures pictures;
  atlas::ValidTiles valid;

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
  /// `shift_px`: how far its picture lies beside the place where it belongs.
  void draw(std::uint32_t camera, Vec3d exposure, const Paint& painted = paint,
            const Lens& lens = {}, int shift_px = 0) {
    const View& v = views[camera];
    auto picture = std::make_shared<ImageRgb>(v.width, v.height);
    for (int y = 0; y < v.height; ++y)
      for (int x = 0; x < v.width; ++x) {
        const Vec3d ray = unproject(v.camera(), {1.0 * x + shift_px, 1.0 * y});
        if (ray.z <= 0) continue;
        const Vec3d p = v.T_world_camera.translation + ray * (kWall_m / ray.z);
        const double light = lens ? lens((x + 0.5) / v.width, (y + 0.5) / v.height) : 1;
        for (int c = 0; c < 3; ++c)
          picture->at(x, y)[c] = to_srgb(painted(p.x, p.y)[c] * exposure[c] * light);
      }
    pictures[v.stream] = picture;
  }

  ColorBalance::Capture capture(const Mesh& mesh) const { return {mesh, views, pictures, valid}; }
};

ColorBalance balance_of(const Mesh& mesh, const Rig& rig) {
  ColorBalance balance;
  balance.estimate(rig.capture(mesh), 1);
  balance.follow(true);
  return balance;
}
Fields balanced(const Mesh& mesh, const Rig& rig) { return balance_of(mesh, rig).fields(); }

/// Factor on linear light in the middle of the picture.
Vec3d gain(const Fields& fields, std::uint32_t view) {
  const Vec3f log_gain = fields.at(ViewId{view}).at({0.5f, 0.5f});
  return {std::exp(log_gain.x), std::exp(log_gain.y), std::exp(log_gain.z)};
}

/// Gain times exposure must be the same for both views, in each channel.
void expect_balanced(const Fields& fields, std::uint32_t a, Vec3d exposure_a, std::uint32_t b,
                     Vec3d exposure_b) {
  for (int c = 0; c < 3; ++c) {
    const double ratio = gain(fields, a)[c] * exposure_a[c] / (gain(fields, b)[c] * exposure_b[c]);
    EXPECT_NEAR(ratio, 1, 0.02) << "views " << a << " and " << b << ", channel " << c;
  }
}

void expect_untouched(const Fields& fields, std::uint32_t view) {
  EXPECT_TRUE(fields.at(ViewId{view}).empty()) << "view " << view;
}

void expect_nearly_untouched(const ColorField& field) {
  for (const Vec3f& log_gain : field.log_gain)
    for (int c = 0; c < 3; ++c) EXPECT_LT(std::abs(log_gain[c]), 0.06);
}

atlas::ColorCorrections corrections(const Fields& fields) {
  atlas::ColorCorrections out;
  for (const auto& [id, field] : fields) out[id].field = field;
  return out;
}

constexpr Vec3d kPlain{1, 1, 1}, kWarm{1.3, 1, 0.8};

TEST(ColorBalance, TwoViewsOfAWallAgree) {
  Rig rig;
  rig.add(-0.6, kPlain), rig.add(0.6, kWarm);
  expect_balanced(balanced(wall(), rig), 0, kPlain, 1, kWarm);
}

TEST(ColorBalance, SeamsAreHardToSee) {
  Rig rig;
  rig.add(-0.6, kPlain), rig.add(0.6, kWarm);
  const double before = atlas::seam_color_step(wall(), rig.views, rig.pictures, {});
  const double after =
      atlas::seam_color_step(wall(), rig.views, rig.pictures, corrections(balanced(wall(), rig)));
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
  const Fields fields = balanced(wall(), rig);
  expect_balanced(fields, 0, kDark, 1, kPlain);
  expect_balanced(fields, 1, kPlain, 2, kWarm);
}

TEST(ColorBalance, VignettingIsEvenedOut) {
  const auto vignetting = [](double x, double y) {
    const double r2 = ((x - 0.5) * (x - 0.5) * 256 + (y - 0.5) * (y - 0.5) * 81) / (64 + 20.25);
    return 1 - 0.45 * r2;
  };
  Rig rig;
  rig.add(-0.8, kPlain), rig.add(0, kPlain), rig.add(0.8, kPlain);
  for (std::uint32_t camera = 0; camera < 3; ++camera) rig.draw(camera, kPlain, paint, vignetting);
  const Fields fields = balanced(wall(), rig);
  const double before = atlas::seam_color_step(wall(), rig.views, rig.pictures, {});
  const double after = atlas::seam_color_step(wall(), rig.views, rig.pictures, corrections(fields));
  EXPECT_LT(after, 0.5 * before);
  const auto& middle = fields.at(ViewId{1});
  // Lit evenly: what the lens took at the sides is given back, relative to the middle.
  for (const float x : {0.1f, 0.9f})
    EXPECT_NEAR(std::exp(middle.at({x, 0.5f}).y - middle.at({0.5f, 0.5f}).y) * vignetting(x, 0.5) /
                    vignetting(0.5, 0.5),
                1, 0.05);
}

TEST(ColorBalance, ACameraThreeStopsDarkerChangesNoOther) {
  constexpr Vec3d kDark{0.125, 0.125, 0.125};
  Rig rig;
  rig.add(-0.5, kPlain), rig.add(0.5, kDark);
  Fields fields = balanced(wall(), rig);
  expect_untouched(fields, 0);
  EXPECT_NEAR(gain(fields, 1).y, 8, 0.4);

  rig.add(0, kPlain), rig.add(0.2, kPlain);
  fields = balanced(wall(), rig);
  for (const std::uint32_t view : {0u, 2u, 3u}) expect_untouched(fields, view);
  EXPECT_NEAR(gain(fields, 1).y, 8, 0.4);
  EXPECT_NEAR(balance_of(wall(), rig).findings().at(ViewId{1}).gain.y, 8, 0.4);  // told
}

TEST(ColorBalance, AColouredLampIsLightNotExposure) {
  const auto lamp = [](double x, double y) {
    const double red = 0.5 / (1 + (x - 1.5) * (x - 1.5));
    return paint(x, y) + Vec3d{red * 0.5, 0.05 * red, 0};
  };
  Rig rig;
  rig.add(-0.6, kPlain), rig.add(0, kPlain), rig.add(0.6, kPlain);
  for (std::uint32_t camera = 0; camera < 3; ++camera) rig.draw(camera, kPlain, lamp);
  const Fields fields = balanced(wall(), rig);
  for (const std::uint32_t view : {0u, 1u, 2u}) expect_untouched(fields, view);
}

TEST(ColorBalance, AMirrorOrScreenWorsensNoView) {
  const auto reflecting = [](double offset) {  // each camera sees something else in it
    return [offset](double x, double y) {
      if (std::abs(x) > 0.3 || std::abs(y) > 0.3) return paint(x, y);
      const double shine = std::sin(9 * x + 7 * y + offset) > 0 ? 0.7 : 0.05;
      return Vec3d{shine, shine * (0.5 + 0.3 * offset), 0.3};
    };
  };
  Rig rig;
  rig.add(-0.5, kPlain), rig.add(0, kPlain), rig.add(0.5, kPlain);
  for (std::uint32_t camera = 0; camera < 3; ++camera) rig.draw(camera, kPlain, reflecting(camera));
  const Fields fields = balanced(wall(), rig);
  for (const auto& [id, field] : fields) expect_nearly_untouched(field);
}

TEST(ColorBalance, APictureBesideItsPlaceWorsensNoOtherAndIsTold) {
  const auto textured = [](double x, double y) {
    const double stripe = std::sin(14 * x) * std::sin(11 * y + 1) > 0 ? 0.35 : 1;
    return paint(x, y) * stripe;
  };
  Rig rig;
  for (const double x : {-0.6, -0.2, 0.2, 0.6}) rig.add(x, kPlain);
  for (std::uint32_t camera = 0; camera < 4; ++camera) rig.draw(camera, kPlain, textured);
  rig.draw(2, kPlain, textured, {}, 20);
  const ColorBalance balance = balance_of(wall(), rig);
  for (const auto& [id, field] : balance.fields())
    if (id != ViewId{2}) expect_nearly_untouched(field);
  double most = 0;
  for (const auto& [id, finding] : balance.findings())
    if (id != ViewId{2}) most = std::max(most, finding.misfit);
  EXPECT_GT(balance.findings().at(ViewId{2}).misfit, 2 * most);
}

TEST(ColorBalance, APanoramaAgreesWithAPinhole) {
  Rig rig;
  rig.add(0, kPlain), rig.add(0.3, kWarm, View::Kind::equirectangular);
  expect_balanced(balanced(wall(), rig), 0, kPlain, 1, kWarm);
}

TEST(ColorBalance, ViewsWithoutOverlapStayAsTheyAre) {
  Rig rig;
  rig.add(-2, kPlain), rig.add(2, kWarm);
  const Fields fields = balanced(wall(), rig);
  ASSERT_EQ(fields.size(), 2u);
  for (const std::uint32_t view : {0u, 1u}) expect_untouched(fields, view);
  for (const auto& [id, field] : balanced({}, rig)) EXPECT_TRUE(field.empty());
  EXPECT_TRUE(balanced(wall(), {}).empty());
}

TEST(ColorBalance, WhatIsHiddenIsNoEvidence) {
  Rig rig;  // a screen between the second camera and the wall, which its picture does not show
  rig.add(-0.3, kPlain), rig.add(0.3, kWarm);
  Mesh mesh = wall();
  clear_labels(mesh);
  append(mesh, test::grid({0, 0.5f, 0.3f}, {0.6f, 0, 0}, {0, -1, 0}, 4, 4));
  for (const auto& [id, field] : balanced(mesh, rig)) EXPECT_TRUE(field.empty());
}

TEST(ColorBalance, WhatIsNotValidIsNoEvidence) {
  Rig rig;
  rig.add(-0.6, kPlain), rig.add(0.6, kWarm);
  rig.valid[ViewId{1}] = {16, 20, 12, std::vector<std::uint8_t>(240, 0)};
  for (const auto& [id, field] : balanced(wall(), rig)) EXPECT_TRUE(field.empty());
  rig.valid[ViewId{1}].tiles.assign(240, 1);
  expect_balanced(balanced(wall(), rig), 0, kPlain, 1, kWarm);
}

TEST(ColorBalance, AlikeViewsStayAsTheyAre) {
  Rig rig;
  rig.add(-0.6, kPlain), rig.add(0.6, kPlain);
  const Fields fields = balanced(wall(), rig);
  for (const auto& [id, field] : fields) EXPECT_TRUE(field.empty());
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

TEST(ColorBalance, AViewThatReturnsFitsAtOnce) {
  Rig rig;
  rig.add(-0.6, kPlain), rig.add(0, kPlain), rig.add(0.6, kWarm);
  const std::vector<View> fewer(rig.views.begin(), rig.views.begin() + 2);
  const Mesh mesh = wall();
  ColorBalance balance;
  balance.estimate(rig.capture(mesh), 1);
  balance.estimate({mesh, fewer, rig.pictures, {}}, 0.3f);
  ASSERT_EQ(balance.fields().size(), 2u);
  balance.estimate(rig.capture(mesh), 0.3f);
  expect_balanced(balance.fields(), 0, kPlain, 2, kWarm);
}

TEST(ColorBalance, AChangeOfExposureIsFollowedSmoothlyAndThenStandsStill) {
  Rig rig;
  rig.add(-0.6, kPlain), rig.add(0.6, kPlain);
  const Mesh mesh = wall();
  ColorBalance balance;
  balance.estimate(rig.capture(mesh), 1);
  rig.draw(1, kWarm);
  std::array<double, 2> last{1, 1};
  for (int tick = 0; tick < 600; ++tick) {
    if (tick % 30 == 0) balance.estimate(rig.capture(mesh), 0.3f);
    balance.follow(false);
    for (const std::uint32_t view : {0u, 1u}) {
      const double now = gain(balance.fields(), view).x;
      EXPECT_LT(std::abs(now - last[view]), 0.016);  // or the dead band
      last[view] = now;
    }
  }
  expect_balanced(balance.fields(), 0, kPlain, 1, kWarm);
  const Fields settled = balance.fields();
  for (int tick = 0; tick < 20; ++tick)
    balance.estimate(rig.capture(mesh), 0.3f), balance.follow(false);
  EXPECT_EQ(balance.fields(), settled);
}

TEST(ColorBalance, TheSameOnAnyNumberOfThreads) {
  Rig rig;
  rig.add(-0.6, kPlain), rig.add(0, {0.9, 1.1, 1}), rig.add(0.6, kWarm);
  const auto on = [&](int threads) {
    Fields fields;
    Arena(threads).run([&] { fields = balanced(wall(), rig); });
    return fields;
  };
  const Fields one = on(1);
  EXPECT_FALSE(one.at(ViewId{2}).empty());
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
  for (const auto& [id, field] : balanced(mesh, rig)) EXPECT_TRUE(field.empty());
  EXPECT_EQ(atlas::seam_color_step(mesh, rig.views, rig.pictures, {}), 0);
}

TEST(ToneCurves, OneLeavesBytesAndAFactorIsOneOnLinearLight) {
  using Curves = atlas::ToneCurves;
  const float stop = std::log(2.0f);
  for (int i = 0; i < 256; ++i) EXPECT_EQ(Curves::of(0)[i], i);
  EXPECT_EQ(Curves::of(stop)[to_srgb(0.2)], to_srgb(0.4));
  EXPECT_EQ(Curves::of(-stop)[255], to_srgb(0.5));
  EXPECT_EQ(Curves::of(-stop)[to_srgb(0.5)], to_srgb(0.25));
}

TEST(ToneCurves, RiseAndClipNoMoreThanTheCamera) {
  for (const float stops : {-4.0f, -1.0f, 0.1f, 0.4f, 1.0f, 3.0f, 4.0f}) {
    const auto& curve = atlas::ToneCurves::of(stops * std::log(2.0f));
    for (int i = 1; i < 256; ++i) EXPECT_GE(curve[i], curve[i - 1]) << stops;
    EXPECT_LT(curve[253], 254) << stops;
    if (stops > 0) {
      EXPECT_EQ(curve[255], 255) << stops;
    }
  }
}

}  // namespace
}  // namespace mr
