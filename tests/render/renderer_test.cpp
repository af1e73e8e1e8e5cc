#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <limits>

#include "render/render_scenes.h"

namespace mr::render {
namespace {

TEST(Renderer, FindsADevice) {
  const auto made = Renderer::create();
  ASSERT_TRUE(made.ok()) << made.error().message;
  EXPECT_FALSE(made->device().empty());
  std::printf("device: %s\n", made->device().c_str());
}

TEST(Renderer, TwoLiveSideBySideAndCanBeMoved) {
  auto first = Renderer::create(), second = Renderer::create();
  ASSERT_TRUE(first.ok() && second.ok());
  Renderer moved = std::move(*first);
  EXPECT_TRUE(moved.draw({}, kCamera, {}).ok());
  EXPECT_TRUE(second->draw({}, kCamera, {}).ok());
  moved = std::move(*second);
  EXPECT_TRUE(moved.draw({}, kCamera, {}).ok());
}

TEST(Renderer, EmptySceneGivesTheBackground) {
  const ImageRgb image = draw({}, kCamera);
  EXPECT_EQ(image.width, 96);
  EXPECT_EQ(image.height, 64);
  for (std::size_t i = 0; i < image.data.size(); ++i) ASSERT_EQ(image.data[i], kBackground[i % 3]);
}

TEST(Renderer, TellsWhereASurfaceIs) {
  DecodedScene scene;
  Chunk chunk;
  chunk.mesh = test::box({-0.5f, -0.5f, 2}, {0.5f, 0.5f, 3});
  scene.chunks.push_back(std::make_shared<const Chunk>(chunk));
  const Camera camera = pinhole(80, 60, 50, 50, 39.5, 29.5);
  const ImageRgb image = draw(scene, camera);
  const ImageMask covered = renderer().covered();
  ASSERT_EQ(covered.data.size(), image.data.size() / 3);
  int inside = 0;
  for (int y = 0; y < image.height; ++y)
    for (int x = 0; x < image.width; ++x) {
      EXPECT_EQ(*covered.at(x, y) == 1, at(image, x, y) == kNeutral) << x << ' ' << y;
      inside += *covered.at(x, y);
    }
  EXPECT_NEAR(inside, 25 * 25, 60);  // 1 m at 2 m, 50 pixels focal length
}

TEST(Renderer, ReadsBackTheDepthThatItDrew) {
  DecodedScene scene;
  Chunk chunk;  // a floor 1 m below, from 1 to 9 m, and a wall before a part of it
  chunk.mesh = test::grid({-1, 1, 1}, {2, 0, 0}, {0, 0, 8}, 8, 8);
  append(chunk.mesh, test::grid({-0.5f, -1, 3}, {1, 0, 0}, {0, 1.5f, 0}, 2, 2));
  scene.chunks.push_back(std::make_shared<const Chunk>(chunk));
  const Camera camera = pinhole(90, 70, 60, 60, 44.5, 20);
  draw(scene, camera);
  const auto depth = renderer().depth();
  ASSERT_TRUE(depth) << depth.error().message;
  const ImageMask covered = renderer().covered();
  int floor = 0, wall = 0;
  for (int y = 0; y < depth->height; ++y)
    for (int x = 0; x < depth->width; ++x) {
      const float z = *depth->at(x, y);
      EXPECT_EQ(z > 0, *covered.at(x, y) == 1) << x << ' ' << y;
      if (z <= 0) continue;
      const Vec3d p = unproject(camera, {double(x), double(y)}) * double{z};
      const bool on_wall = std::abs(p.x) < 0.51 && p.y < 0.51 && std::abs(p.z - 3) < 1e-4;
      EXPECT_TRUE(on_wall || std::abs(p.y - 1) < 1e-4) << x << ' ' << y;
      ++(on_wall ? wall : floor);
    }
  EXPECT_GT(floor, 300);
  EXPECT_GT(wall, 300);
  // What is culled is not there.
  RenderOptions culled;
  culled.cull_back_faces = true;
  ASSERT_TRUE(renderer().draw(scene, camera, {}, culled));
  const auto rest = renderer().depth();
  ASSERT_TRUE(rest);
  EXPECT_NE(rest->data, depth->data);
}

TEST(Renderer, APanoramaHasNoDepthBuffer) {
  Camera camera;
  camera.model = CameraModel::equirectangular;
  camera.width = 64, camera.height = 32;
  draw({}, camera);
  EXPECT_FALSE(renderer().depth());
  draw({}, kCamera);
  EXPECT_TRUE(renderer().depth());
}

TEST(Renderer, PicturesOfAnySizeHaveNoPadding) {
  for (const int width : {1, 2, 3, 5, 97}) {
    const ImageRgb image = draw({}, pinhole(width, 3, 50, 50, 0, 0));
    ASSERT_EQ(image.data.size(), static_cast<std::size_t>(width) * 9);
    EXPECT_EQ(at(image, width - 1, 2), kBackground);
  }
}

TEST(Renderer, APointLightsUpThePixelThatProjectNames) {
  for (const Vec2i pixel :
       {Vec2i{0, 0}, Vec2i{95, 0}, Vec2i{0, 63}, Vec2i{95, 63}, Vec2i{41, 37}, Vec2i{13, 50}}) {
    Mesh dot;  // covers the pixel's centre, not its neighbours'
    for (const Vec2d off : {Vec2d{-0.4, 0.3}, Vec2d{0.4, 0.3}, Vec2d{0, -0.45}}) {
      const Vec3d p = unproject(kCamera, {pixel.x + off.x, pixel.y + off.y}) * 2.7;
      dot.positions.push_back(vec_cast<float>(kPose * p));
    }
    dot.triangles = {{0, 1, 2}};
    DecodedScene scene;
    add(scene, dot, kNoView);
    const ImageRgb image = draw(scene, kCamera, kPose);
    for (int y = 0; y < image.height; ++y)
      for (int x = 0; x < image.width; ++x)
        ASSERT_EQ(at(image, x, y), x == pixel.x && y == pixel.y ? kNeutral : kBackground)
            << x << " " << y << ", wanted " << pixel.x << " " << pixel.y;
  }
}

TEST(Renderer, NearerSurfacesHideFartherOnes) {
  const Camera camera = pinhole(60, 40, 40, 40, 29.5, 19.5);
  DecodedScene scene;
  scene.views.push_back(view_of(0, camera, {}, {0, 0, 60, 40}));
  set_texture(scene, plain_picture(60, 40, {0, 255, 0}));
  add(scene, wall_before({}, 1.0, 0.2), ViewId{0});
  add(scene, wall_before({}, 1.002, 3), kNoView);  // drawn later, 2 mm behind
  const ImageRgb image = draw(scene, camera);
  EXPECT_EQ(at(image, 30, 20), (Color{0, 255, 0}));
  EXPECT_EQ(at(image, 5, 5), kNeutral);
}

TEST(Renderer, CullsWhatIsSeenFromBehindOnly) {
  const Camera camera = pinhole(60, 40, 40, 40, 29.5, 19.5);
  RenderOptions culled = kOptions;
  culled.cull_back_faces = true;
  const Mesh front = wall_before(kPose, 2, 4);
  Mesh back = front;
  for (Triangle& t : back.triangles) std::swap(t[1], t[2]);
  DecodedScene facing, averted;
  add(facing, front, kNoView);
  add(averted, back, kNoView);
  EXPECT_EQ(at(draw(facing, camera, kPose, culled), 30, 20), kNeutral);
  EXPECT_EQ(at(draw(averted, camera, kPose, culled), 30, 20), kBackground);
  EXPECT_EQ(at(draw(averted, camera, kPose), 30, 20), kNeutral);
}

TEST(Renderer, ABoxIsClosedFromOutsideAndOpenFromInsideWhenCulled) {
  DecodedScene scene;
  add(scene, test::box({-1, -1, -1}, {1, 1, 1}), kNoView);
  RenderOptions culled = kOptions;
  culled.cull_back_faces = true;
  const Camera camera = pinhole(60, 40, 40, 40, 29.5, 19.5);
  for (const Vec3d eye : {Vec3d{3, 2, 2}, Vec3d{-3, 1, -2}, Vec3d{0.5, -4, 0.3}}) {
    const ImageRgb image = draw(scene, camera, look_at(eye, {}, {0, 0, 1}), culled);
    EXPECT_EQ(at(image, 30, 20), kNeutral);
  }
  EXPECT_EQ(at(draw(scene, camera, {}, culled), 30, 20), kBackground);
  EXPECT_EQ(at(draw(scene, camera), 30, 20), kNeutral);
}

/// A rough ball and a wall with an asymmetric picture, moved by `offset`.
DecodedScene rough_scene(Vec3d offset, unsigned seed = 1) {
  Pose pose = kPose;
  pose.translation += offset;
  const Vec3d right = kPose.rotation.column(0), down = kPose.rotation.column(1);
  const Vec3d origin = kPose * Vec3d{-2, 2, 3};
  Mesh mesh = test::grid(vec_cast<float>(origin), vec_cast<float>(right * 4.0),
                         vec_cast<float>(down * -4.0), 40, 40, 0.05f, seed);
  append(mesh, test::sphere(vec_cast<float>(kPose * Vec3d{0.3, 0.2, 2}), 0.4f, 12));
  for (Vec3f& p : mesh.positions) {  // as on a lattice, so that moving it is exact
    for (int i = 0; i < 3; ++i) p[i] = std::round(p[i] * 1024) / 1024;
    p = vec_cast<float>(vec_cast<double>(p) + offset);
  }
  DecodedScene scene;
  scene.views.push_back(view_of(0, kCamera, pose, {0, 0, 96, 64}));
  set_texture(scene, asymmetric_picture(96, 64));
  add(scene, mesh, ViewId{0});
  return scene;
}

TEST(Renderer, FiveHundredMetresFromTheOriginThePictureIsTheSame) {
  const Camera camera = pinhole(320, 240, 260, 260, 159.5, 119.5);
  const Pose eye = look_at({2.7, -1.8, 1.9}, {-1, 2, 0.4}, {0, 0, 1});
  const ImageRgb near = draw(rough_scene({}), camera, eye);
  for (const Vec3d offset : {Vec3d{500, 0, 0}, Vec3d{-288, 288, -288}, Vec3d{0.25, 499.5, 3}}) {
    Pose moved = eye;
    moved.translation += offset;
    const ImageRgb far = draw(rough_scene(offset), camera, moved);
    int apart = 0;
    for (int y = 0; y < 240; ++y)
      for (int x = 0; x < 320; ++x)
        for (int c = 0; c < 3; ++c)
          if (std::abs(near.at(x, y)[c] - far.at(x, y)[c]) > 1) {
            ++apart;
            break;
          }
    EXPECT_LT(apart, 320 * 240 / 1000);
  }
}

TEST(Renderer, SameSceneAgainFromElsewhereOrWithOtherChunks) {
  const auto fresh = [](const DecodedScene& scene, const Pose& pose) {
    auto other = Renderer::create();
    return *other->draw(scene, kCamera, pose, kOptions);
  };
  const Pose elsewhere = look_at({3.4, -1.2, 1.1}, {-1, 2, 0.4}, {0, 0, 1});
  DecodedScene scene = rough_scene({});
  for (const unsigned seed : {1u, 2u, 3u}) {
    scene.chunks = rough_scene({}, seed).chunks;  // the old ones end; addresses may come again
    for (const Pose& pose : {kPose, elsewhere, kPose})
      ASSERT_EQ(draw(scene, kCamera, pose), fresh(scene, pose));
  }
  add(scene, wall_before(kPose, 0.5, 0.1), kNoView);
  EXPECT_EQ(draw(scene, kCamera, kPose), fresh(scene, kPose));
  EXPECT_EQ(at(draw(scene, kCamera, kPose), 40, 37), kNeutral);
  scene.chunks.pop_back();
  EXPECT_NE(at(draw(scene, kCamera, kPose), 40, 37), kNeutral);
  scene.chunks.clear();
  EXPECT_EQ(count(draw(scene, kCamera, kPose), kBackground), 96 * 64);
}

TEST(Renderer, NothingThatCanBeSeenIsLeftOut) {
  // Many small chunks all around: whatever is left out must lie outside of the picture.
  DecodedScene parts, whole;
  Mesh all;
  for (int i = 0; i < 200; ++i) {
    const Vec3d d = normalized(Vec3d{std::sin(i * 1.3), std::sin(i * 2.1 + 1), std::sin(i * 0.7)});
    const Mesh ball = test::sphere(vec_cast<float>(d * (1 + 0.01 * i)), 0.2f, 6);
    add(parts, ball, kNoView);
    append(all, ball);
  }
  add(whole, all, kNoView);
  RenderOptions options = kOptions;
  options.shade = Shade::normals;
  for (int i = 0; i < 12; ++i) {
    const Pose pose =
        look_at({0.1 * i - 0.6, 0.3, 0.2}, {std::sin(i), std::cos(i), 0.1 * i - 0.5}, {0, 0, 1});
    EXPECT_EQ(draw(parts, kCamera, pose, options), draw(whole, kCamera, pose, options));
  }
}

TEST(Renderer, WhatIsMissingIsAnError) {
  const Camera camera = pinhole(60, 40, 40, 40, 29.5, 19.5);
  DecodedScene scene;
  add(scene, wall_before({}, 2, 4), ViewId{5});
  const auto message = [&] {
    const auto image = renderer().draw(scene, camera, {}, kOptions);
    EXPECT_FALSE(image.ok());
    EXPECT_EQ(image.error().cause, Error::Cause::invalid);
    return image.error().message;
  };
  EXPECT_NE(message().find("view 5"), std::string::npos);
  scene.views.push_back(view_of(5, camera, {}, {0, 0, 60, 40}));
  scene.views[0].stream = StreamId{9};
  EXPECT_NE(message().find("stream 9"), std::string::npos);
  set_texture(scene, plain_picture(59, 40, {1, 1, 1}), StreamId{9});
  EXPECT_NE(message().find("outside"), std::string::npos);
  set_texture(scene, plain_picture(60, 40, {1, 1, 1}), StreamId{9});
  EXPECT_TRUE(renderer().draw(scene, camera, {}, kOptions).ok());
  Mesh broken = wall_before({}, 2, 4);
  broken.triangles[0][1] = 1000;
  add(scene, broken, ViewId{5});
  EXPECT_NE(message().find("vertex"), std::string::npos);
}

TEST(Renderer, ImpossibleCamerasAreErrors) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto refused = [](const Camera& camera, const Pose& pose = {}) {
    return !renderer().draw({}, camera, pose).ok();
  };
  EXPECT_TRUE(refused(pinhole(60, 40, nan, 40, 30, 20)));
  EXPECT_TRUE(refused(pinhole(60, 40, 40, 40, 30, nan)));
  EXPECT_TRUE(refused(pinhole(60, 40, 0, 40, 30, 20)));
  EXPECT_TRUE(refused(pinhole(0, 40, 40, 40, 30, 20)));
  EXPECT_TRUE(refused(pinhole(1 << 20, 40, 40, 40, 30, 20)));
  Camera bent = kCamera;
  bent.distortion = DistortionModel::brown;
  EXPECT_TRUE(refused(bent));
  bent = kCamera;
  bent.model = CameraModel::lidar;
  EXPECT_TRUE(refused(bent));
  EXPECT_FALSE(refused(panorama(64, 32)));
  EXPECT_TRUE(refused(panorama(0, 32)));
  EXPECT_TRUE(refused(panorama(64, -1)));
  EXPECT_TRUE(refused(panorama(1 << 20, 64)));
  EXPECT_TRUE(refused(panorama(std::numeric_limits<int>::max(), 64)));
  EXPECT_TRUE(refused(panorama(64, std::numeric_limits<int>::max())));
  Pose pose;
  pose.translation.y = nan;
  EXPECT_TRUE(refused(kCamera, pose));
  pose = {};
  pose.rotation.m[4] = nan;
  EXPECT_TRUE(refused(kCamera, pose));
  EXPECT_TRUE(refused(panorama(64, 32), pose));
  EXPECT_FALSE(refused(kCamera));
}

}  // namespace
}  // namespace mr::render
