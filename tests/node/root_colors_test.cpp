#include "mr/node/root_colors.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <vector>

#include "support/meshes.h"

namespace mr {
namespace {

using node::RootColors;

ImageRgb grey(int level) { return ImageRgb(64, 48, static_cast<std::uint8_t>(level)); }

/// Two cameras whose plates are learnt, then see other light.
struct Cameras {
  RootColors::Plates plates;
  std::vector<View> views;
  Mesh nothing;
  atlas::Pictures live;

  Cameras() {
    for (const std::uint32_t id : {0u, 1u}) {
      View& view = views.emplace_back();
      view.id = ViewId{id}, view.stream = StreamId{id}, view.width = 64, view.height = 48;
      see(id, 120, 40);
    }
  }
  void see(std::uint32_t camera, int level, int captures) {
    const TileMask all{16, 4, 3, std::vector<std::uint8_t>(12, 1)};
    for (int i = 0; i < captures; ++i) plates[ViewId{camera}].update(grey(level), all);
  }
  RootColors colors() {
    RootColors out(false);
    out.update({views, live, {}, nothing, nullptr, plates, 0});
    return out;
  }
};

TEST(RootColors, ExposureOfOneCameraIsTakenOutOfItsLivePicture) {
  Cameras cameras;
  EXPECT_EQ(cameras.colors().exposure(), (Vec3f{1, 1, 1}));
  cameras.see(0, 84, 12);  // 0.7 of before
  const RootColors colors = cameras.colors();
  for (int c = 0; c < 3; ++c) {
    EXPECT_FLOAT_EQ(colors.exposure()[c], 1);
    const auto live = colors.live();
    const auto& curve = atlas::ToneCurves::of(live.at(ViewId{0}).log_exposure[c]);
    EXPECT_NEAR(curve[84], 120, 3);  // as on the plate
    EXPECT_EQ(live.at(ViewId{1}).log_exposure[c], 0);
  }
  for (const auto& [id, plate] : colors.plates()) EXPECT_EQ(plate.log_exposure, Vec3f{});
}

TEST(RootColors, LightThatAllCamerasSeeChangeIsShown) {
  Cameras cameras;
  cameras.see(0, 84, 12), cameras.see(1, 96, 12);  // 0.7 and 0.8
  const RootColors colors = cameras.colors();
  EXPECT_NEAR(colors.exposure().y, 0.8, 0.02);
  EXPECT_NEAR(colors.live().at(ViewId{1}).log_exposure.y, 0, 0.01);
  const auto& curve = atlas::ToneCurves::of(colors.live().at(ViewId{0}).log_exposure.y);
  EXPECT_NEAR(curve[84], 96, 3);
}

TEST(RootColors, ACameraWithoutPlateIsLeftOut) {
  Cameras cameras;
  cameras.see(0, 84, 12);
  cameras.plates.erase(ViewId{1});
  cameras.plates[ViewId{1}];  // nothing learnt yet
  EXPECT_NEAR(cameras.colors().exposure().y, 0.7, 0.02);
}

/// Two cameras before a wall that is grey; something dark, in no mesh, is before most of the
/// second.
TEST(RootColors, BlindTilesAreNoEvidence) {
  const Mesh wall = test::grid({-3, 3, 2}, {6, 0, 0}, {0, -6, 0}, 12, 12);
  std::vector<View> views;
  atlas::Pictures live;
  for (const std::uint32_t id : {0u, 1u}) {
    View& view = views.emplace_back();
    view.id = ViewId{id}, view.stream = StreamId{id}, view.width = 320, view.height = 240;
    view.fx = view.fy = 260, view.cx = 159.5, view.cy = 119.5;
    view.image_rect = view.atlas_rect = {0, 0, 320, 240};
    view.T_world_camera.translation = {0.1 * id, 0, 0};
    auto picture = std::make_shared<ImageRgb>(320, 240, std::uint8_t{120});
    for (int y = 0; id == 1 && y < 240; ++y) std::fill_n(picture->at(80, y), 3 * 240, 60);
    live[view.stream] = std::move(picture);
  }
  TileMask seeing{16, 20, 15, {}};
  for (int tile = 0; tile < 300; ++tile) seeing.tiles.push_back(tile % 20 < 5);
  const auto gain = [&](const atlas::ValidTiles& tiles) {
    RootColors colors;
    colors.update({views, live, tiles, wall, nullptr, {}, 0});
    const auto corrections = colors.live();
    float most = 0;
    for (const auto& [id, correction] : corrections)
      for (const Vec3f& log_gain : correction.field.log_gain)
        most = std::max(most, std::abs(log_gain.y));
    return most;
  };
  EXPECT_GT(gain({}), 0.5f) << "the occluder's colour is taken for the wall's";
  EXPECT_EQ(gain({{ViewId{1}, seeing}}), 0);
}

}  // namespace
}  // namespace mr
