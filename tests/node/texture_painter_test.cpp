#include "mr/node/texture_painter.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <map>
#include <memory>
#include <utility>
#include <vector>

#include "support/meshes.h"

namespace mr {
namespace {

using node::RootColors;
using node::TexturePainter;

constexpr std::uint8_t kDark = 100, kBright = 180;

/// A wall square to z, `depth_m` away.
Mesh wall_at(float depth_m) { return test::grid({-4, 4, depth_m}, {8, 0, 0}, {0, -8, 0}, 8, 8); }

/// Two cameras in one place with plain pictures of other brightness: where both see a surface, each
/// shows the mean.
struct Painted {
  std::vector<View> views;
  atlas::Pictures pictures;
  TexturePainter painter;
  RootColors colors{false};

  Painted() {
    for (const std::uint32_t id : {0u, 1u}) {
      View& view = views.emplace_back();
      view.id = ViewId{id}, view.stream = StreamId{id + 7}, view.width = 320, view.height = 240;
      view.fx = view.fy = 260, view.cx = 159.5, view.cy = 119.5;
      view.image_rect = view.atlas_rect = {0, 0, 320, 240};
      pictures[view.stream] = std::make_shared<const ImageRgb>(320, 240, id ? kBright : kDark);
    }
  }
  /// The live pictures' value in the middle, of both cameras.
  std::pair<int, int> live(const Mesh& moving, const Mesh* still,
                           std::map<ViewId, TileMask> seeing = {}) {
    const auto out = painter.live({views, pictures, std::move(seeing)}, {}, moving, still, colors);
    return {*out.at(StreamId{7})->at(160, 120), *out.at(StreamId{8})->at(160, 120)};
  }
  /// Plates that show the pictures.
  RootColors::Plates plates() const {
    const TileMask all{16, 20, 15, std::vector<std::uint8_t>(300, 1)};
    RootColors::Plates out;
    for (const View& view : views)
      for (int i = 0; i < 5; ++i) out[view.id].update(*pictures.at(view.stream), all);
    return out;
  }
};

constexpr std::pair<int, int> kMeans{140, 140}, kApart{kDark, kBright};

TEST(TexturePainter, LivePicturesBecomeTheMeanOnWhatMoves) {
  Painted scene;
  EXPECT_EQ(scene.live(wall_at(2), nullptr), kMeans);
}

TEST(TexturePainter, WithoutMovingSurfacePicturesAreAsTheyCome) {
  Painted scene;
  const Mesh still = wall_at(2);
  const auto out =
      scene.painter.live({scene.views, scene.pictures, {}}, {}, {}, &still, scene.colors);
  EXPECT_EQ(out, scene.pictures) << "the very same";
}

TEST(TexturePainter, StillSurfaceInFrontHidesAViewFromWhatMoves) {
  Painted scene;
  const Mesh moving = wall_at(2), behind = wall_at(3);
  EXPECT_EQ(scene.live(moving, &behind), kMeans);
  const Mesh before = wall_at(1);
  EXPECT_EQ(scene.live(moving, &before), kApart);
  EXPECT_EQ(scene.live(moving, &behind), kMeans) << "another still surface is drawn anew";
}

TEST(TexturePainter, ACameraThatMovesSeesTheStillSurfaceAnew) {
  Painted scene;
  const Mesh moving = wall_at(2);
  const Mesh board = test::grid({-0.2f, 0.2f, 1}, {0.4f, 0, 0}, {0, -0.4f, 0}, 2, 2);
  scene.views[1].T_world_camera.translation = {1, 0, 0};
  EXPECT_GT(scene.live(moving, nullptr).first, kDark);
  scene.views[0].T_world_camera.translation = {0.8, 0, 0};  // both look past the board
  const auto aside = scene.live(moving, &board);
  EXPECT_GT(aside.first, kDark + 20);
  scene.views[0].T_world_camera.translation = {0, 0, 0};
  Painted fresh;
  fresh.views = scene.views;
  EXPECT_EQ(scene.live(moving, &board), fresh.live(moving, &board));
}

TEST(TexturePainter, BlindTilesGiveNoColour) {
  Painted scene;
  const TileMask none{16, 20, 15, std::vector<std::uint8_t>(300, 0)};
  const auto [first, second] = scene.live(wall_at(2), nullptr, {{ViewId{1}, none}});
  EXPECT_EQ(first, kDark);
  EXPECT_LT(second, kDark + 5) << "its own is replaced";
}

TEST(TexturePainter, AViewWithoutAPictureIsLeftOut) {
  Painted scene;
  scene.pictures.erase(StreamId{8});
  const auto out =
      scene.painter.live({scene.views, scene.pictures, {}}, {}, wall_at(2), nullptr, scene.colors);
  ASSERT_EQ(out.size(), 1u);
  EXPECT_EQ(*out.at(StreamId{7})->at(160, 120), kDark);
}

TEST(TexturePainter, PlatesBecomeTheMeanOnWhatIsStill) {
  Painted scene;
  const Mesh still = wall_at(2);
  auto plates = scene.plates();
  auto out = scene.painter.plates(scene.views, plates, {}, still, scene.colors);
  ASSERT_EQ(out.size(), 2u);
  for (const auto& [stream, picture] : out) EXPECT_EQ(*picture->at(160, 120), 140);

  // Only used pixels and, of other plates, only those that were learnt.
  ImageMask used(320, 240);
  out = scene.painter.plates(scene.views, plates, {{ViewId{0}, used}}, still, scene.colors);
  EXPECT_EQ(*out.at(StreamId{7})->at(160, 120), kDark);
  EXPECT_EQ(*out.at(StreamId{8})->at(160, 120), 140);
  plates.erase(ViewId{1});
  out = scene.painter.plates(scene.views, plates, {}, still, scene.colors);
  ASSERT_EQ(out.size(), 1u);
  EXPECT_EQ(*out.at(StreamId{7})->at(160, 120), kDark);
}

TEST(TexturePainter, InvalidBlocksOfPlatesGiveNoColour) {
  Painted scene;
  auto plates = scene.plates();
  plates[ViewId{1}] = {};
  plates[ViewId{1}].update(*scene.pictures.at(StreamId{8}),
                           {16, 20, 15, std::vector<std::uint8_t>(300, 1)});  // not yet valid
  const auto out = scene.painter.plates(scene.views, plates, {}, wall_at(2), scene.colors);
  EXPECT_EQ(*out.at(StreamId{7})->at(160, 120), kDark);
}

}  // namespace
}  // namespace mr
