#include "mr/node/root_colors.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

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
    out.update({views, live, nothing, nullptr, plates, 0});
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

}  // namespace
}  // namespace mr
