#include "mr/atlas/view_blend.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <optional>
#include <utility>
#include <vector>

#include "mr/atlas/occluders.h"
#include "mr/core/parallel.h"
#include "mr/kit/raster.h"
#include "support/meshes.h"
#include "walls.h"

namespace mr {
namespace {

using atlas::ViewBlend;
using Color = std::array<std::uint8_t, 3>;
constexpr atlas::BlendConfig kMean{1, false};

ImageRgb plain(Color color, int width = 320, int height = 240) {
  ImageRgb out(width, height);
  for (int y = 0; y < out.height; ++y)
    for (int x = 0; x < out.width; ++x) std::copy_n(color.data(), 3, out.at(x, y));
  return out;
}

/// Cameras before a wall, each with a picture.
struct BlendRoom {
  Mesh mesh = test::wall(2, 8);
  std::vector<View> views;
  std::vector<ImageRgb> pictures;
  std::vector<ImageDepth> depths;

  void add(double x, ImageRgb picture) {
    views.push_back(
        test::view(ViewId{static_cast<std::uint32_t>(views.size())}, {x, 0, 0}, {x, 0, 2}));
    pictures.push_back(std::move(picture));
  }
  /// A camera of another size and focal length (pixels), with a plain picture.
  void add(double x, int width, int height, double focal, Color color) {
    add(x, plain(color, width, height));
    View& v = views.back();
    v.width = width, v.height = height, v.fx = v.fy = focal;
    v.cx = (width - 1) / 2.0, v.cy = (height - 1) / 2.0;
    v.image_rect = v.atlas_rect = {0, 0, width, height};
  }
  std::vector<ViewBlend::Source> sources() {
    depths.clear();
    for (const View& view : views)
      depths.push_back(
          kit::rasterize_depth(mesh, atlas::depth_camera(view.camera()), view.T_world_camera));
    std::vector<ViewBlend::Source> out(views.size());
    for (std::size_t v = 0; v < out.size(); ++v)
      out[v].view = &views[v], out[v].picture = &pictures[v], out[v].nearest = &depths[v];
    return out;
  }
};

TEST(ViewBlend, BothSidesOfABorderShowTheSameColour) {
  BlendRoom room;
  room.add(-0.3, plain({100, 60, 50})), room.add(0.4, plain({140, 80, 50}));
  const ViewBlend blend(room.sources(), kMean);
  const ImageRgb a = blend.picture(0, nullptr, &room.depths[0]),
                 b = blend.picture(1, nullptr, &room.depths[1]);
  int compared = 0;
  for (float x = -0.7f; x < 0.8f; x += 0.1f)
    for (float y = -0.8f; y < 0.8f; y += 0.1f) {
      const auto in = [&](std::size_t v) {
        return *project(room.views[v].camera(),
                        room.views[v].T_world_camera.inverse() * Vec3d{x, y, 2});
      };
      const Vec2d p = in(0), q = in(1);
      if (std::min({p.x, p.y, q.x, q.y}) < 4 || std::max(p.x, q.x) > 315 ||
          std::max(p.y, q.y) > 235)
        continue;
      const auto color_a = sample_bilinear(a, {0, 0, 320, 240}, p.x, p.y);
      const auto color_b = sample_bilinear(b, {0, 0, 320, 240}, q.x, q.y);
      for (int c = 0; c < 3; ++c) EXPECT_NEAR(color_a[c], color_b[c], 2) << x << " " << y;
      ++compared;
    }
  EXPECT_GT(compared, 100);
  EXPECT_NEAR(*a.at(190, 120), 120, 12);  // seen equally well: half way
}

TEST(ViewBlend, NearThePicturesBorderAViewCountsLess) {
  BlendRoom room;
  room.add(0, plain({100, 100, 100})), room.add(0.9, plain({200, 200, 200}));
  const ViewBlend blend(room.sources(), kMean);
  const ImageRgb out = blend.picture(0, nullptr, &room.depths[0]);
  // The other picture begins at column 117 of this one; no step there.
  EXPECT_EQ(*out.at(100, 120), 100);
  int most = 0;
  for (int x = 101; x < 290; ++x) most = std::max(most, *out.at(x, 120) - *out.at(x - 1, 120));
  EXPECT_LE(most, 5);
  EXPECT_GT(*out.at(316, 120), 180);  // its own border
}

TEST(ViewBlend, WhatHidesAPlaceFromAViewIsNotPaintedThere) {
  BlendRoom room;
  room.add(0, plain({100, 100, 100})), room.add(0.5, plain({240, 0, 0}));
  // A board before the second camera alone.
  append(room.mesh, test::grid({0.42f, 0.3f, 0.4f}, {0.16f, 0, 0}, {0, -0.6f, 0}, 2, 2));
  const ViewBlend blend(room.sources(), kMean);
  const ImageRgb out = blend.picture(0, nullptr, &room.depths[0]);
  const auto at = [&](float x) {
    const Vec2d p = *project(room.views[0].camera(), Vec3d{x, 0, 2});
    return *out.at(static_cast<int>(std::lround(p.x)), static_cast<int>(std::lround(p.y)));
  };
  EXPECT_EQ(at(0.5f), 100);  // behind the board
  EXPECT_EQ(at(0.2f), 100);
  EXPECT_GT(at(-0.1f), 130);  // beside it
}

/// Cameras whose depth maps are as fine as their pictures, half and a quarter as fine.
TEST(ViewBlend, DepthMapsMayBeCoarserThanPictures) {
  struct Case {
    int width, height;
    double focal;
    int divisor;
  };
  for (const Case& c : {Case{323, 243, 290, 1}, {1283, 723, 700, 2}, {1283, 723, 1300, 4}})
    for (const bool keep_detail : {false, true}) {
      BlendRoom room;
      room.add(0, c.width, c.height, c.focal, {100, 100, 100});
      room.add(0.25, c.width, c.height, c.focal, {180, 180, 180});
      ASSERT_EQ(atlas::depth_divisor(room.views[0].camera()), c.divisor);
      // A board before the second camera alone hides x = 0.08 to 0.18 on the wall.
      append(room.mesh, test::grid({0.19f, 0.3f, 0.7f}, {0.035f, 0, 0}, {0, -0.6f, 0}, 2, 2));
      const ViewBlend blend(room.sources(), {1, keep_detail});
      const ImageRgb out = blend.picture(0, nullptr, &room.depths[0]);
      const auto at = [&](float x) {
        const Vec2d p = *project(room.views[0].camera(), Vec3d{x, 0, 2});
        return *out.at(static_cast<int>(std::lround(p.x)), static_cast<int>(std::lround(p.y)));
      };
      EXPECT_NEAR(at(0.13f), 100, keep_detail ? 6 : 0) << c.focal;
      EXPECT_GT(at(-0.1f), 120) << c.focal << " " << keep_detail;
      EXPECT_EQ(*out.at(0, c.height - 1), 100) << "not seen by the other";
    }
}

/// Tiles that show a part of the camera's picture, smaller and somewhere in the atlas.
TEST(ViewBlend, TilesMayShowAPartAtAnotherScale) {
  const auto painted = [](Vec2d camera_px) { return 60 + 0.25 * camera_px.x + 0.15 * camera_px.y; };
  for (const bool keep_detail : {false, true}) {
    BlendRoom room;
    for (const int brighter : {0, 40}) {
      room.add(0, plain({0, 0, 0}));
      View& v = room.views.back();
      v.image_rect = brighter ? Rect{0, 0, 320, 240} : Rect{40, 24, 200, 160};
      v.atlas_rect = brighter ? Rect{64, 30, 240, 180} : Rect{19, 11, 100, 120};
      for (int y = 0; y < v.atlas_rect.height; ++y)
        for (int x = 0; x < v.atlas_rect.width; ++x) {
          const Vec2d at{
              (x + 0.5) * v.image_rect.width / v.atlas_rect.width - 0.5 + v.image_rect.x,
              (y + 0.5) * v.image_rect.height / v.atlas_rect.height - 0.5 + v.image_rect.y};
          std::fill_n(room.pictures.back().at(v.atlas_rect.x + x, v.atlas_rect.y + y), 3,
                      static_cast<std::uint8_t>(std::lround(painted(at) + brighter)));
        }
    }
    const ViewBlend blend(room.sources(), {1, keep_detail});
    const ImageRgb out = blend.picture(0, nullptr, &room.depths[0]);
    const Rect& tile = room.views[0].atlas_rect;
    for (int y = 0; y < 240; ++y)
      for (int x = 0; x < 320; ++x) {
        const int change = *out.at(x, y) - *room.pictures[0].at(x, y);
        const int inside = std::min(
            {x - tile.x, y - tile.y, tile.x + tile.width - 1 - x, tile.y + tile.height - 1 - y});
        if (inside < 0) {
          ASSERT_EQ(change, 0) << x << " " << y;
        } else if (inside >= 24) {  // where both count fully
          ASSERT_NEAR(change, 20, 2) << x << " " << y;
        }
      }
  }
}

TEST(ViewBlend, TilesMayBeOnePixelOrOneBlockWide) {
  for (const bool keep_detail : {false, true})
    for (const auto& [width, height] :
         {std::pair{1, 1}, {1, 40}, {40, 1}, {8, 8}, {5, 120}, {120, 5}, {9, 17}}) {
      BlendRoom room;
      room.add(0, plain({100, 100, 100}, width, height));
      room.add(0, plain({200, 200, 200}, width, height));
      for (View& view : room.views) view.atlas_rect = {0, 0, width, height};
      const ViewBlend blend(room.sources(), {1, keep_detail});
      const ImageRgb out = blend.picture(0, nullptr, &room.depths[0]);
      EXPECT_NEAR(*out.at(width / 2, height / 2), 150, 2) << width << "x" << height;
      for (const std::uint8_t value : out.data) EXPECT_TRUE(value >= 99 && value <= 151);
    }
}

TEST(ViewBlend, OnlyValidAndUsedPixelsAreTaken) {
  BlendRoom room;
  room.add(0, plain({100, 100, 100})), room.add(0.1, plain({200, 200, 200}));
  auto sources = room.sources();
  const TileMask none{16, 20, 15, std::vector<std::uint8_t>(300, 0)};
  sources[1].valid = &none;
  EXPECT_EQ(ViewBlend(sources, kMean).picture(0, nullptr, &room.depths[0]), room.pictures[0]);
  sources[1].valid = nullptr;
  ImageMask used(320, 240);
  *used.at(150, 120) = 1;
  const ImageRgb out = ViewBlend(sources, kMean).picture(0, &used, &room.depths[0]);
  EXPECT_GT(*out.at(150, 120), 120);
  EXPECT_EQ(*out.at(151, 120), 100);
}

TEST(ViewBlend, WeightsFallToNothingOverATileBesideInvalidOnes) {
  BlendRoom room;
  room.add(0, plain({100, 100, 100})), room.add(0, plain({200, 200, 200}));
  auto sources = room.sources();
  TileMask valid{16, 20, 15, {}};
  for (int tile = 0; tile < 300; ++tile) valid.tiles.push_back(tile % 20 < 10);
  sources[1].valid = &valid;
  const ImageRgb out = ViewBlend(sources, kMean).picture(0, nullptr, &room.depths[0]);
  for (int y = 60; y < 180; y += 10) {
    for (int x = 100; x < 143; ++x) ASSERT_EQ(*out.at(x, y), 150) << x;
    for (int x = 144; x < 160; ++x) {
      const double share = (160 - 0.5 - x) / 16;
      EXPECT_NEAR(*out.at(x, y), (100 + 200 * share) / (1 + share), 1) << x;
    }
    for (int x = 160; x < 200; ++x) ASSERT_EQ(*out.at(x, y), 100) << x;
  }
}

TEST(ViewBlend, PicturesAreCorrectedWithOrWithoutSurface) {
  BlendRoom room;
  room.add(0, plain({100, 120, 140})), room.add(0.1, plain({100, 120, 140}));
  auto sources = room.sources();
  const Vec3f gain{0.2f, 0, -0.3f}, exposure{0.1f, 0.1f, -0.2f};
  for (auto& s : sources)
    s.field.log_gain.assign(atlas::ColorField::kNodes, gain), s.log_exposure = exposure;
  const ViewBlend blend(sources, kMean);
  for (const ImageDepth* surface : {static_cast<const ImageDepth*>(nullptr),
                                    static_cast<const ImageDepth*>(room.depths.data())}) {
    const ImageRgb out = blend.picture(0, nullptr, surface);
    for (int c = 0; c < 3; ++c) {
      const int before = 100 + 20 * c;
      const int wanted = atlas::ToneCurves::of(gain[c] + exposure[c])[before];
      EXPECT_NEAR(out.at(160, 120)[c], wanted, 1);
    }
  }
}

TEST(ViewBlend, DetailIsKeptWhileColoursMeet) {
  ImageRgb striped = plain({100, 100, 100});
  for (int y = 0; y < striped.height; ++y)
    for (int x = 0; x < striped.width; ++x)
      if (x / 2 % 2) std::fill_n(striped.at(x, y), 3, 130);
  BlendRoom room;
  room.add(0, striped),
      room.add(0.1, plain({155, 155, 155}));  // 40 brighter than the mean of the first
  const ViewBlend blend(room.sources(), {1, true});
  const ImageRgb out = blend.picture(0, nullptr, &room.depths[0]);
  const int dark = *out.at(160, 120), bright = *out.at(162, 120);
  EXPECT_NEAR(bright - dark, 30, 1);
  EXPECT_NEAR((bright + dark) / 2, 135, 3);  // half way
  const ImageRgb mean = ViewBlend(room.sources(), kMean).picture(0, nullptr, &room.depths[0]);
  EXPECT_NEAR(*mean.at(162, 120) - *mean.at(160, 120), 15, 2);
}

TEST(ViewBlend, TheSmoothChangeGoesOnBesideTheSurface) {
  BlendRoom room;
  room.mesh = test::grid({-0.2f, 0.2f, 2}, {0.4f, 0, 0}, {0, -0.4f, 0}, 4, 4);
  room.add(0, plain({100, 100, 100})), room.add(0, plain({180, 180, 180}));
  const ViewBlend blend(room.sources(), {1, true});
  const ImageRgb out = blend.picture(0, nullptr, &room.depths[0]);
  EXPECT_EQ(*out.at(160, 120), 140);
  const int right = 185;  // the last column with surface
  ASSERT_TRUE(*room.depths[0].at(right, 120) > 0 && !(*room.depths[0].at(right + 1, 120) > 0));
  for (int x = right - 2; x < 319; ++x) {
    EXPECT_LE(*out.at(x + 1, 120), *out.at(x, 120)) << x;
    EXPECT_GE(*out.at(x + 1, 120), *out.at(x, 120) - 6) << x;
  }
  EXPECT_EQ(*out.at(right + 25, 120), 100);

  ImageMask used(320, 240);
  for (int y = 0; y < 240; ++y) std::fill_n(used.at(0, y), right + 8, 1);
  const ImageRgb some = blend.picture(0, &used, &room.depths[0]);
  for (int x = 100; x < right + 8; ++x) EXPECT_EQ(*some.at(x, 120), *out.at(x, 120)) << x;
  for (int x = right + 8; x < 320; ++x) EXPECT_EQ(*some.at(x, 120), 100) << x;
}

TEST(ViewBlend, TheSameOnAnyNumberOfThreads) {
  BlendRoom room;
  room.add(-0.2, plain({90, 100, 110})), room.add(0.1, plain({100, 130, 140}));
  room.add(0.3, plain({120, 110, 100})), room.add(0, 643, 361, 620, {110, 90, 100});
  for (const atlas::BlendConfig& config : {kMean, {1, true}})
    for (const std::size_t own : {1u, 3u}) {
      const auto on = [&](int threads) {
        std::optional<ImageRgb> out;
        Arena(threads).run([&] {
          const ViewBlend blend(room.sources(), config);
          out = blend.picture(own, nullptr, &room.depths[own]);
        });
        return *out;
      };
      const ImageRgb alone = on(1);
      EXPECT_NE(alone, room.pictures[own]);
      EXPECT_EQ(alone, on(4));
    }
}

TEST(ViewBlend, PanoramasAreLeftApart) {
  BlendRoom room;
  room.add(0, plain({100, 100, 100})), room.add(0.1, plain({200, 200, 200}));
  const auto sources = room.sources();
  room.views[1].kind = View::Kind::equirectangular;
  EXPECT_EQ(ViewBlend(sources, kMean).picture(0, nullptr, &room.depths[0]), room.pictures[0]);
  EXPECT_EQ(ViewBlend(sources, kMean).picture(1, nullptr, nullptr), room.pictures[1]);
}

}  // namespace
}  // namespace mr
