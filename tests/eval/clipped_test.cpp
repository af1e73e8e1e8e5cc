#include "mr/eval/clipped.h"

#include <gtest/gtest.h>

#include <memory>
#include <utility>

#include "support/meshes.h"

namespace mr::eval {
namespace {

/// Two layers before one camera of 80x60: the left half shows the moving layer, the right half the
/// still one. Pictures are the tiles.
struct TwoLayers {
  DecodedScene shown;
  std::vector<Frame> capture;
  ImageRgb live{80, 60, 100}, plate{80, 60, 100};

  TwoLayers() {
    View view;
    view.id = view_of(sensor_at(0));
    view.width = 80, view.height = 60, view.fx = view.fy = 40, view.cx = 39.5, view.cy = 29.5;
    view.image_rect = view.atlas_rect = {0, 0, 80, 60};
    for (const Layer layer : {Layer::moving, Layer::still}) {
      view.layer = layer, view.stream = StreamId{layer == Layer::moving ? 0u : 1u};
      shown.views.push_back(view);
      Chunk chunk;
      chunk.key.id.layer = layer;
      chunk.mesh =
          test::grid({layer == Layer::moving ? -4.0f : 0.0f, 3, 2}, {4, 0, 0}, {0, -6, 0}, 4, 4);
      set_view(chunk.mesh, view.id);
      shown.chunks.push_back(std::make_shared<const Chunk>(std::move(chunk)));
    }
    capture.emplace_back().color = ImageRgb(80, 60, 100);
  }
  std::optional<double> ratio() {
    shown.textures[StreamId{0}] = std::make_shared<const ImageRgb>(live);
    shown.textures[StreamId{1}] = std::make_shared<const ImageRgb>(plate);
    return clipped_ratio(shown, capture);
  }
};

/// One channel of the columns [first, end) of the upper half.
void set_columns(ImageRgb& image, int first, int end, std::uint8_t value) {
  for (int y = 0; y < 30; ++y)
    for (int x = first; x < end; ++x) image.at(x, y)[1] = value;
}

TEST(ClippedRatio, IsTheWorstViewsShareOfUsedPixels) {
  TwoLayers setup;
  EXPECT_EQ(setup.ratio(), 0);
  set_columns(setup.live, 0, 10, 254);  // an eighth of the left half's 40 columns, half the rows
  EXPECT_NEAR(setup.ratio().value(), 0.125, 0.01);
  set_columns(setup.plate, 60, 80, 255);
  EXPECT_NEAR(setup.ratio().value(), 0.25, 0.01);
  set_columns(setup.live, 40, 80, 255);  // nobody sees that of the live picture
  EXPECT_NEAR(setup.ratio().value(), 0.25, 0.01);
}

TEST(ClippedRatio, CountsTheGainAndNotWhatTheCameraClips) {
  TwoLayers setup;
  set_columns(setup.plate, 60, 80, 210);
  EXPECT_EQ(setup.ratio(), 0);
  setup.shown.views[1].gain = {1, 1.21f, 1};  // 210 * 1.21 = 254.1
  EXPECT_NEAR(setup.ratio().value(), 0.25, 0.01);
  setup.shown.views[1].gain = {1, 1.2f, 1};
  EXPECT_EQ(setup.ratio(), 0);
  set_columns(setup.plate, 60, 80, 255);
  set_columns(setup.capture[0].color, 60, 70, 254);
  EXPECT_NEAR(setup.ratio().value(), 0.125, 0.01)
      << "half of it is clipped in the camera's picture";
}

TEST(ClippedRatio, ReadsScaledAndMovedTiles) {
  TwoLayers setup;
  setup.plate = ImageRgb(100, 100, 100);
  setup.shown.views[1].atlas_rect = {50, 20, 40, 30};
  for (int y = 20; y < 35; ++y)
    for (int x = 80; x < 90; ++x) setup.plate.at(x, y)[0] = 255;  // camera columns 60 to 80
  EXPECT_NEAR(setup.ratio().value(), 0.25, 0.01);
}

TEST(ClippedRatio, NothingWithoutPictures) {
  TwoLayers setup;
  EXPECT_EQ(clipped_ratio(setup.shown, setup.capture), std::nullopt);
  setup.capture[0].sensor = sensor_at(7);
  EXPECT_EQ(setup.ratio(), std::nullopt);
}

}  // namespace
}  // namespace mr::eval
