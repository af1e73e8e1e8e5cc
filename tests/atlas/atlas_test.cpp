#include <gtest/gtest.h>

#include "mr/atlas/compose.h"
#include "mr/atlas/layout.h"
#include "support/meshes.h"

namespace mr {
namespace {

View view(std::uint32_t number, int w, int h) {
  View v;
  v.id = ViewId{number}, v.width = w, v.height = h, v.fx = v.fy = w, v.cx = w / 2.0, v.cy = h / 2.0;
  v.image_rect = v.atlas_rect = {0, 0, w, h};
  v.stream = StreamId{number};
  return v;
}

TEST(Layout, TilesDoNotShareMacroblocksAndFit) {
  std::vector<View> views;
  for (std::uint32_t i = 0; i < 11; ++i)
    views.push_back(view(i, 300 + 10 * static_cast<int>(i), 203));
  atlas::AtlasConfig config;
  config.width = 1000, config.height = 800;
  const atlas::Layout layout = *atlas::make_layout(views, config, 1.0, 4);
  EXPECT_LE(layout.width, 1000);
  EXPECT_LE(layout.height, 800);
  ImageMask taken(layout.width / 16, layout.height / 16);
  for (const View& v : layout.views) {
    EXPECT_EQ(v.layout, 4u);
    const Rect& r = v.atlas_rect;
    EXPECT_LE(r.x + r.width, layout.width);
    EXPECT_LE(r.y + r.height, layout.height);
    for (int y = r.y / 16; y <= (r.y + r.height - 1) / 16; ++y)
      for (int x = r.x / 16; x <= (r.x + r.width - 1) / 16; ++x) {
        EXPECT_EQ(*taken.at(x, y), 0);
        *taken.at(x, y) = 1;
      }
  }
}

TEST(Layout, ScaleShrinksTiles) {
  const atlas::Layout half = *atlas::make_layout({view(0, 640, 480)}, {}, 0.5, 1);
  EXPECT_EQ(half.views[0].atlas_rect, (Rect{0, 0, 320, 240}));
  EXPECT_TRUE(atlas::make_layout({}, {}, 1, 1)->views.empty());
}

TEST(Layout, TooManyViewsAreRefused) {
  atlas::AtlasConfig tiny;
  tiny.width = tiny.height = 16;
  const auto layout = atlas::make_layout({view(0, 640, 480), view(1, 640, 480)}, tiny, 1, 1);
  ASSERT_FALSE(layout);
  EXPECT_EQ(layout.error().cause, Error::Cause::too_large);
}

TEST(Compose, TilesAreCopiedExactlyAtFullScale) {
  auto picture = std::make_shared<ImageRgb>(64, 32);
  for (std::size_t i = 0; i < picture->data.size(); ++i)
    picture->data[i] = static_cast<std::uint8_t>(i * 7);
  const atlas::Layout layout = *atlas::make_layout({view(0, 64, 32), view(1, 64, 32)}, {}, 1, 1);
  const ImageRgb atlas_picture = atlas::compose_atlas(
      layout, {.children = {{ViewId{1}, view(1, 64, 32)}}, .pictures = {{StreamId{1}, picture}}});
  const Rect at = layout.views[1].atlas_rect;
  for (int y = 0; y < 32; ++y)
    for (int x = 0; x < 64; ++x)
      for (int c = 0; c < 3; ++c)
        ASSERT_EQ(atlas_picture.at(at.x + x, at.y + y)[c], picture->at(x, y)[c]);
  const Rect black = layout.views[0].atlas_rect;  // the child lacks it
  EXPECT_EQ(*atlas_picture.at(black.x + 5, black.y + 5), 0);
}

TEST(Compose, PixelsOfNoUseAreBlack) {
  auto picture = std::make_shared<ImageRgb>(100, 100, 200);
  Mesh mesh = test::grid({-0.2f, 0.2f, 1}, {0.4f, 0, 0}, {0, -0.4f, 0}, 1, 1);
  set_triangle_views(mesh, {ViewId{0}, ViewId{0}});
  View v = view(0, 100, 100);
  const ImageMask used = atlas::used_pixels(mesh, v, 3);
  const atlas::Layout layout = *atlas::make_layout({v}, {}, 1, 1);
  const ImageRgb masked = atlas::compose_atlas(layout, {.children = {{ViewId{0}, v}},
                                                        .pictures = {{StreamId{0}, picture}},
                                                        .used = {{ViewId{0}, used}},
                                                        .mask = true});
  EXPECT_EQ(*masked.at(50, 50), 200);
  EXPECT_EQ(*masked.at(28, 50), 200);  // inside the margin: the square covers 30..70
  EXPECT_EQ(*masked.at(20, 50), 0);
  const ImageRgb whole = atlas::compose_atlas(layout, {.children = {{ViewId{0}, v}},
                                                       .pictures = {{StreamId{0}, picture}},
                                                       .used = {{ViewId{0}, used}}});
  EXPECT_EQ(*whole.at(20, 50), 200);
}

TEST(Compose, BlocksOfNoUseShowWhatIsBehind) {
  const auto picture = std::make_shared<ImageRgb>(40, 40, 200);
  const ImageRgb plate(40, 40, 50);
  const View v = view(0, 40, 40);
  const atlas::Layout layout = *atlas::make_layout({v}, {}, 1, 1);
  ImageMask used(40, 40);
  *used.at(17, 15) = 1;
  *used.at(39, 39) = 1;
  const ImageRgb out = atlas::compose_atlas(layout, {.children = {{ViewId{0}, v}},
                                                     .pictures = {{StreamId{0}, picture}},
                                                     .used = {{ViewId{0}, used}},
                                                     .mask = true,
                                                     .behind = {{ViewId{0}, &plate}}});
  for (int y = 0; y < 40; ++y)
    for (int x = 0; x < 40; ++x) {
      const bool is_live = (x / 16 == 1 && y / 16 == 0) || (x / 16 == 2 && y / 16 == 2);
      ASSERT_EQ(out.at(x, y)[1], is_live ? 200 : 50) << x << " " << y;
    }
}

TEST(Compose, AlphaIsArrangedAsThePictureIs) {
  const std::map<ViewId, View> children = {{ViewId{0}, view(0, 64, 32)},
                                           {ViewId{1}, view(1, 64, 32)}};
  View shown = children.at(ViewId{1});
  shown.image_rect = {16, 8, 32, 16};  // a window
  const atlas::Layout layout = *atlas::make_layout({children.at(ViewId{0}), shown}, {}, 1, 1);
  auto alpha = std::make_shared<Alpha>(Alpha{2, ImageMask(32, 16, 1)});
  for (int y = 6; y < 10; ++y) *alpha->plane.at(10, y) = 0;
  const auto plane = atlas::compose_alpha(layout, {children, {{StreamId{1}, alpha}}, {}});
  ASSERT_TRUE(plane);
  EXPECT_EQ(plane->step_px, 2);
  ASSERT_EQ(plane->plane.width, layout.width / 2);
  ASSERT_EQ(plane->plane.height, layout.height / 2);
  const Rect at = layout.views[1].atlas_rect;
  for (int y = 0; y < plane->plane.height; ++y)
    for (int x = 0; x < plane->plane.width; ++x) {
      const bool is_cut = x == at.x / 2 + 10 - 8 && y >= at.y / 2 + 6 - 4 && y < at.y / 2 + 10 - 4;
      EXPECT_EQ(*plane->plane.at(x, y), !is_cut) << x << ' ' << y;
    }
  // Beside the window nothing is cut: no plane.
  for (int y = 6; y < 10; ++y) *alpha->plane.at(10, y) = 1, *alpha->plane.at(30, y) = 0;
  EXPECT_FALSE(atlas::compose_alpha(layout, {children, {{StreamId{1}, alpha}}, {}}));
  EXPECT_FALSE(atlas::compose_alpha(layout, {children, {}, {}}));
}

TEST(Compose, AlphaIsScaledWithThePicture) {
  const View v = view(0, 64, 32);
  const atlas::Layout layout = *atlas::make_layout({v}, {}, 0.5, 1);
  auto alpha = std::make_shared<Alpha>(Alpha{2, ImageMask(32, 16, 1)});
  for (int y = 0; y < 16; ++y)
    for (int x = 0; x < 16; ++x) *alpha->plane.at(x, y) = 0;  // the left half
  const auto plane = atlas::compose_alpha(layout, {{{ViewId{0}, v}}, {{StreamId{0}, alpha}}, {}});
  ASSERT_TRUE(plane);
  const Rect at = layout.views[0].atlas_rect;
  for (int y = 0; y < at.height / 2; ++y)
    for (int x = 0; x < at.width / 2; ++x)
      EXPECT_EQ(*plane->plane.at(at.x / 2 + x, at.y / 2 + y), x >= at.width / 4) << x << ' ' << y;
}

TEST(Compose, AlphaIsKeptOnlyWhereItMatters) {
  const View v = view(0, 64, 32);
  const std::map<ViewId, View> children = {{ViewId{0}, v}};
  const atlas::Layout layout = *atlas::make_layout({v}, {}, 1, 1);
  auto alpha = std::make_shared<Alpha>(Alpha{2, ImageMask(32, 16, 1)});
  for (int y = 0; y < 16; ++y)
    for (int x = 0; x < 32; ++x) *alpha->plane.at(x, y) = x % 8 < 4;
  const AlphaByStream planes = {{StreamId{0}, alpha}};
  ImageMask used(64, 32);
  *used.at(2, 2) = 1;                     // of the first block a one
  *used.at(16 + 14, 2) = 1;               // of the second a zero
  *used.at(32, 2) = *used.at(46, 2) = 1;  // of the third both; of the fourth nothing
  const auto plane = atlas::compose_alpha(layout, {children, planes, {{ViewId{0}, used}}});
  ASSERT_TRUE(plane);
  for (int y = 0; y < 8; ++y)
    for (int x = 0; x < 32; ++x) {
      const int expected = x < 8 ? 1 : x < 16 ? 0 : x < 24 ? x % 8 < 4 : 1;
      EXPECT_EQ(*plane->plane.at(x, y), expected) << x << ' ' << y;
    }
}

}  // namespace
}  // namespace mr
