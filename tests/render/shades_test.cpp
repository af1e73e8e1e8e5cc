#include <gtest/gtest.h>

#include "render/render_scenes.h"

namespace mr::render {
namespace {

TEST(RendererShades, NormalsAreColoursAndBackFacesAreDarkRed) {
  const Camera camera = pinhole(60, 40, 40, 40, 29.5, 19.5);
  RenderOptions options = kOptions;
  options.shade = Shade::normals;
  Mesh wall = wall_before({}, 2, 4);
  DecodedScene scene, averted;
  add(scene, wall, kNoView);
  for (Triangle& t : wall.triangles) std::swap(t[1], t[2]);
  add(averted, wall, kNoView);
  const Color front = at(draw(scene, camera, {}, options), 30, 20);
  const Color back = at(draw(averted, camera, {}, options), 30, 20);
  EXPECT_NEAR(front[0], 127, 1);
  EXPECT_NEAR(front[1], 127, 1);
  EXPECT_EQ(front[2], 0);  // towards the camera: -z
  EXPECT_TRUE(back[0] > 60 && back[0] < 140 && back[1] == 0 && back[2] == 0);
}

TEST(RendererShades, ViewsHaveColoursOfTheirOwnAndNeedNoTextures) {
  const Camera camera = pinhole(60, 40, 40, 40, 29.5, 19.5);
  RenderOptions options = kOptions;
  options.shade = Shade::views;
  std::vector<Color> seen;
  for (const std::uint32_t number : {0u, 1u, 2u, 3u, 4u, 5u, 6u, 7u, number_of(kNoView)}) {
    const ViewId view{number};
    DecodedScene scene;
    add(scene, wall_before({}, 2, 4), view);
    seen.push_back(at(draw(scene, camera, {}, options), 30, 20));
  }
  for (std::size_t i = 0; i < seen.size(); ++i)
    for (std::size_t j = 0; j < i; ++j) {
      int apart = 0;
      for (int c = 0; c < 3; ++c) apart += std::abs(seen[i][c] - seen[j][c]);
      EXPECT_GT(apart, 30) << i << " and " << j;
    }
  EXPECT_EQ(seen.back(), kNeutral);
}

TEST(RendererShades, WireframeHasEdgesOverFaces) {
  const Camera camera = pinhole(90, 90, 60, 60, 44.5, 44.5);
  RenderOptions options = kOptions;
  options.shade = Shade::wireframe;
  DecodedScene scene;
  add(scene, wall_before({}, 2, 1.2, 2), kNoView);
  const ImageRgb image = draw(scene, camera, {}, options);
  int edges = 0, faces = 0;
  for (int y = 20; y < 70; ++y)
    for (int x = 20; x < 70; ++x) (image.at(x, y)[0] < 60 ? edges : faces) += 1;
  EXPECT_GT(edges, 100);
  EXPECT_GT(faces, 1500);
}

}  // namespace
}  // namespace mr::render
