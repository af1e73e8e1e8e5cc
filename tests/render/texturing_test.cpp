#include <gtest/gtest.h>

#include "render/render_scenes.h"

namespace mr::render {
namespace {

TEST(RendererTexturing, AViewSeenFromItsOwnCameraIsItsPicture) {
  const ImageRgb original = asymmetric_picture(96, 64);
  DecodedScene scene;
  scene.views.push_back(view_of(7, kCamera, kPose, {0, 0, 96, 64}));
  set_texture(scene, original);
  add(scene, wall_before(kPose, 2, 4), ViewId{7});
  const ImageRgb image = draw(scene, kCamera, kPose);
  const auto off = difference(image, [&](int x, int y) { return as_vec(original.at(x, y)); });
  EXPECT_LT(off.mean, 0.5);
  EXPECT_LE(off.max, 4);
  const auto mirrored =
      difference(image, [&](int x, int y) { return as_vec(original.at(95 - x, y)); });
  EXPECT_GT(mirrored.mean, 20);
}

TEST(RendererTexturing, OnlyPartOfAPictureScaledIntoAnAtlas) {
  DecodedScene scene;
  View view = view_of(0, kCamera, kPose, {20, 7, 33, 50});
  view.image_rect = {10, 4, 66, 50};
  view.stream = StreamId{3};
  scene.views.push_back(view);
  set_texture(scene, asymmetric_picture(75, 61),
              StreamId{3});  // odd width: rows are not 4-byte aligned
  const Mesh wall = wall_before(kPose, 2, 4);
  add(scene, wall, ViewId{0});
  const Camera eye = pinhole(80, 60, 60, 60, 39.5, 29.5);
  const Pose pose = look_at({2.6, -2.1, 1.6}, {-1, 2, 0.4}, {0, 0.1, 1});
  const ImageRgb image = draw(scene, eye, pose);
  const Vec3d normal = kPose.rotation.column(2), origin = vec_cast<double>(wall.positions[0]);
  const auto off = difference(image, [&](int x, int y) {
    const Vec3d ray = pose.rotation * unproject(eye, {x + 0., y + 0.});
    const double t = dot(origin - pose.translation, normal) / dot(ray, normal);
    return expected_color(view, *scene.textures[StreamId{3}], pose.translation + ray * t);
  });
  EXPECT_LT(off.mean, 0.6);
  EXPECT_LE(off.max, 3);
}

TEST(RendererTexturing, NeighboursInAnAtlasDoNotBleed) {
  const Color red{255, 0, 0}, blue{0, 0, 255};
  ImageRgb atlas = plain_picture(40, 20, blue);
  for (int y = 0; y < 20; ++y)
    for (int x = 0; x < 20; ++x) std::copy(red.begin(), red.end(), atlas.at(x, y));
  const Camera small = pinhole(20, 20, 20, 20, 9.5, 9.5);
  DecodedScene scene;
  scene.views = {view_of(0, small, {}, {0, 0, 20, 20}), view_of(1, small, {}, {20, 0, 20, 20})};
  set_texture(scene, atlas);
  const Camera wide = pinhole(200, 60, 50, 50, 99.5, 29.5);
  for (const ViewId view :
       {ViewId{0}, ViewId{1}}) {  // the wall is wider than the pictures: the rim is repeated
    scene.chunks.clear();
    add(scene, wall_before({}, 2, 8), view);
    const ImageRgb image = draw(scene, wide);
    for (int y = 0; y < 60; ++y)
      for (int x = 0; x < 200; ++x) ASSERT_EQ(at(image, x, y), view == ViewId{0} ? red : blue);
  }
}

TEST(RendererTexturing, RunsOfSeveralChunksUseTheirOwnViewsAndStreams) {
  DecodedScene scene;
  const Camera camera = pinhole(60, 40, 40, 40, 29.5, 19.5);
  const std::array<Color, 3> colors{{{255, 0, 0}, {0, 255, 0}, {0, 0, 255}}};
  for (const std::uint32_t id : {0u, 1u, 2u}) {
    scene.views.push_back(view_of(id, camera, {}, {0, 0, 60, 40}));
    scene.views.back().stream = StreamId{10 + id};
    set_texture(scene, plain_picture(60, 40, colors[id]), StreamId{10 + id});
  }
  Mesh wall = test::grid({-1.5f, 2, 2}, {3, 0, 0}, {0, -4, 0}, 4, 1);  // 15 pixels a column
  set_triangle_views(
      wall, {ViewId{2}, ViewId{2}, ViewId{0}, ViewId{0}, kNoView, kNoView, ViewId{1}, ViewId{1}});
  auto chunk = std::make_shared<Chunk>();
  chunk->mesh = wall;
  scene.chunks = {chunk, chunk};
  const ImageRgb image = draw(scene, camera);
  EXPECT_EQ(at(image, 7, 20), colors[2]);
  EXPECT_EQ(at(image, 22, 20), colors[0]);
  EXPECT_EQ(at(image, 37, 20), kNeutral);
  EXPECT_EQ(at(image, 52, 20), colors[1]);
}

TEST(RendererTexturing, AChunksLayerPicksTheLivePictureOrThePlate) {
  const Camera camera = pinhole(60, 40, 40, 40, 29.5, 19.5);
  const Color live{200, 0, 0}, plate{0, 100, 40};
  DecodedScene scene;
  scene.views = {view_of(0, camera, {}, {0, 0, 60, 40}), view_of(0, camera, {}, {0, 0, 60, 40})};
  scene.views[1].layer = Layer::still, scene.views[1].stream = StreamId{1};
  scene.views[1].gain = {1, 2, 3};
  set_texture(scene, plain_picture(60, 40, live), StreamId{0});
  set_texture(scene, plain_picture(60, 40, plate), StreamId{1});
  const auto half = [](float x, Layer layer) {
    auto chunk = std::make_shared<Chunk>();
    chunk->key.id.layer = layer;
    chunk->mesh = test::grid({x, 2, 2}, {1.5f, 0, 0}, {0, -4, 0}, 1, 1);
    set_triangle_views(chunk->mesh, {ViewId{0}, ViewId{0}});
    return chunk;
  };
  scene.chunks = {half(-1.5f, Layer::moving), half(0, Layer::still)};
  const auto shown = [&] {
    const ImageRgb image = draw(scene, camera);
    return std::pair(at(image, 10, 20), at(image, 50, 20));
  };
  EXPECT_EQ(shown(), std::pair(live, (Color{0, 200, 120})));
  EXPECT_EQ(overview(scene, {0, -1, 0}).front().name, "view_0");
  EXPECT_NE(overview(scene, {0, -1, 0})[1].name, "view_0");
  scene.views.pop_back();  // as before there were layers
  EXPECT_EQ(shown(), std::pair(live, live));
  scene.views[0].layer = Layer::still;
  EXPECT_EQ(shown(), std::pair(live, live));
}

TEST(RendererTexturing, GainMultipliesWhatThePictureShowsAndIsClamped) {
  for (const bool panoramic : {false, true}) {
    DecodedScene scene;
    View view = view_of(0, kCamera, kPose, {0, 0, 96, 64});
    if (panoramic) view.kind = View::Kind::equirectangular;
    scene.views.push_back(view);
    set_texture(scene, asymmetric_picture(96, 64));
    add(scene, wall_before(kPose, 2, 4), ViewId{0});
    const ImageRgb plain = draw(scene, kCamera, kPose);
    scene.views[0].gain = {0.25f, 1.5f, 4};
    const auto off = difference(draw(scene, kCamera, kPose), [&](int x, int y) {
      const auto* p = plain.at(x, y);
      return Vec3d{p[0] * 0.25, std::min(255.0, p[1] * 1.5), std::min(255.0, p[2] * 4.0)};
    });
    EXPECT_LE(off.max, 2.6);  // half a level of the plain picture, times the gain, and half a level
  }
}

TEST(RendererTexturing, ABackgroundShowsItsColours) {
  const Camera camera = pinhole(60, 40, 40, 40, 29.5, 19.5);
  const Mesh wall = test::grid({-3, 3, 2}, {6, 0, 0}, {0, -6, 0}, 1, 1);
  DecodedScene scene;
  const Color plain{12, 130, 250};
  scene.chunks = {background_of(wall, std::vector<Color>(4, plain))};
  EXPECT_EQ(at(draw(scene, camera), 30, 20), plain);
  EXPECT_EQ(at(draw(scene, camera), 0, 0), plain);
  scene.chunks = {background_of(wall, {{0, 10, 20}, {240, 10, 20}, {0, 10, 20}, {240, 10, 20}})};
  const ImageRgb image = draw(scene, camera);
  for (int x = 0; x < 60; ++x) {  // red grows along x, linearly in the bytes
    const double along = ((x - 29.5) / 40 * 2 + 3) / 6;
    EXPECT_NEAR(at(image, x, 20)[0], 240 * along, 1.5);
    EXPECT_EQ(at(image, x, 20)[1], 10);
  }
  auto broken = background_of(wall, std::vector<Color>(3, plain));
  scene.chunks = {broken};
  EXPECT_FALSE(renderer().draw(scene, camera, {}, kOptions));
}

TEST(RendererTexturing, ABackgroundHidesAndIsHidden) {
  const Camera camera = pinhole(60, 40, 40, 40, 29.5, 19.5);
  const Color green{0, 255, 0}, blue{5, 60, 250};
  for (const bool background_first : {true, false})
    for (const double background_m : {0.9, 1.1}) {
      DecodedScene scene;
      scene.views.push_back(view_of(0, camera, {}, {0, 0, 60, 40}));
      set_texture(scene, plain_picture(60, 40, green));
      add(scene, wall_before({}, 1.0, 0.2), ViewId{0});
      const Mesh wall = wall_before({}, background_m, background_m < 1 ? 0.05 : 3);
      auto background = background_of(wall, std::vector<Color>(wall.positions.size(), blue));
      scene.chunks.insert(background_first ? scene.chunks.begin() : scene.chunks.end(), background);
      add(scene, test::grid({-0.19f, 0.05f, 0.95f}, {0.05f, 0, 0}, {0, -0.05f, 0}, 1, 1), kNoView);
      const ImageRgb image = draw(scene, camera);
      EXPECT_EQ(at(image, 30, 20), background_m < 1 ? blue : green);
      EXPECT_EQ(at(image, 34, 20), green);
      EXPECT_EQ(at(image, 22, 20), kNeutral) << "a chunk of no view beside them";
      EXPECT_EQ(at(image, 2, 2), background_m < 1 ? kBackground : blue);
    }
}

TEST(RendererTexturing, SameSceneAgainWithAnotherPictureShowsThatPicture) {
  const Camera camera = pinhole(60, 40, 40, 40, 29.5, 19.5);
  DecodedScene scene;
  scene.views.push_back(view_of(0, camera, {}, {0, 0, 60, 40}));
  add(scene, wall_before({}, 2, 4), ViewId{0});
  for (const Color color : {Color{1, 2, 3}, Color{90, 80, 70}, Color{255, 254, 0}}) {
    set_texture(scene, plain_picture(60, 40, color));
    EXPECT_EQ(at(draw(scene, camera), 30, 20), color);
    EXPECT_EQ(at(draw(scene, camera), 30, 20), color);
  }
}

TEST(RendererTexturing, FarFromTheOriginNothingMoves) {
  const Vec3d far{400, -300, 250};
  Pose pose = kPose;
  pose.translation += far;
  const ImageRgb original = asymmetric_picture(96, 64);
  DecodedScene scene;
  scene.views.push_back(view_of(0, kCamera, pose, {0, 0, 96, 64}));
  set_texture(scene, original);
  add(scene, wall_before(pose, 2, 4), ViewId{0});
  const auto off = difference(draw(scene, kCamera, pose),
                              [&](int x, int y) { return as_vec(original.at(x, y)); });
  EXPECT_LT(off.mean, 0.5);
}

}  // namespace
}  // namespace mr::render
