#include <gtest/gtest.h>

#include <numbers>

#include "render/render_scenes.h"

namespace mr::render {
namespace {

/// A panorama whose colour follows the direction, padded by two columns of the far side.
DecodedScene panorama_scene() {
  const int width = 360, height = 180, pad = 2;
  Camera sphere;
  sphere.model = CameraModel::equirectangular;
  sphere.width = width, sphere.height = height;
  View view = view_of(0, sphere, look_at({0.2, 0.1, 0.3}, {1, -2, 0.5}, {0, 0, 1}),
                      {5, 3, width + 2 * pad, height});
  view.kind = View::Kind::equirectangular;
  view.image_rect = {-pad, 0, width + 2 * pad, height};
  DecodedScene scene;
  scene.views.push_back(view);
  set_texture(scene, picture(380, 190, [&](double x, double y) {
                const Vec3d d = unproject(sphere, {x - 5 - pad, y - 3});
                return Vec3d{0.5, 0.5, 0.5} + d * 0.5;
              }));
  Mesh room = test::box({-3, -3, -2}, {3, 3, 2});
  for (Triangle& t : room.triangles) std::swap(t[1], t[2]);
  add(scene, room, ViewId{0});
  return scene;
}

TEST(RendererPanorama, APanoramaShowsEveryDirectionAndItsSeam) {
  const DecodedScene scene = panorama_scene();
  const View& view = scene.views[0];
  const Camera camera = pinhole(80, 80, 40, 40, 39.5, 39.5);
  const Pose& T = view.T_world_camera;
  for (const Vec3d ahead : {Vec3d{0, 0, 1}, Vec3d{1, 0, 0}, Vec3d{0, 0, -1}, Vec3d{-1, 0.2, 0},
                            Vec3d{0, 1, 0.1}, Vec3d{0.1, -1, -0.1}}) {
    const Pose pose = look_at(T.translation, T * ahead, T.rotation * Vec3d{0.1, -0.7, 0.3});
    const ImageRgb image = draw(scene, camera, pose);
    const auto off = difference(image, [&](int x, int y) {
      const Vec3d ray = pose.rotation * unproject(camera, {x + 0., y + 0.});
      return expected_color(view, *scene.textures.at(StreamId{0}), pose.translation + ray);
    });
    EXPECT_LT(off.mean, 0.6);
    EXPECT_LE(off.max, 2);
    const auto truth = difference(image, [&](int x, int y) {  // independent of the atlas
      const Vec3d ray = pose.rotation * unproject(camera, {x + 0., y + 0.});
      const Vec3d d = normalized(transposed(T.rotation) * ray);
      return (Vec3d{0.5, 0.5, 0.5} + d * 0.5) * 255;
    });
    EXPECT_LT(truth.mean, 1);
    EXPECT_LE(truth.max, 3);
  }
}

TEST(RendererPanorama, APanoramasTileMayLieAcrossTheSeam) {
  DecodedScene scene = panorama_scene();
  View& view = scene.views[0];
  const ImageRgb& whole = *scene.textures[StreamId{0}];
  ImageRgb part(120, 180);  // columns 300 .. 419 of the turn
  for (int y = 0; y < 180; ++y)
    for (int x = 0; x < 120; ++x)
      std::copy_n(whole.at(7 + (300 + x) % 360, 3 + y), 3, part.at(x, y));
  view.image_rect = {300, 0, 120, 180};
  view.atlas_rect = {0, 0, 120, 180};
  set_texture(scene, part);
  const Camera camera = pinhole(60, 60, 60, 60, 29.5, 29.5);
  const Pose& T = view.T_world_camera;
  const Pose pose = look_at(T.translation, T * Vec3d{0, 0, -1}, T.rotation * Vec3d{0, -1, 0});
  const auto off = difference(draw(scene, camera, pose), [&](int x, int y) {
    const Vec3d d =
        normalized(transposed(T.rotation) * (pose.rotation * unproject(camera, {x + 0., y + 0.})));
    return (Vec3d{0.5, 0.5, 0.5} + d * 0.5) * 255;
  });
  EXPECT_LT(off.mean, 1);
  EXPECT_LE(off.max, 3);
}

TEST(RendererPanorama, AWholeTurnWithoutPaddingHasNoSeam) {
  DecodedScene scene = panorama_scene();
  View& view = scene.views[0];
  view.width = 24, view.height = 12;  // large texels: the seam is half of two
  view.image_rect = {0, 0, 24, 12};
  view.atlas_rect = {5, 3, 24, 12};
  ImageRgb atlas = plain_picture(40, 20, {255, 0, 255});  // nothing of this may be seen
  for (int y = 0; y < 12; ++y)
    for (int x = 0; x < 24; ++x)
      for (int c = 0; c < 3; ++c)
        atlas.at(5 + x, 3 + y)[c] = static_cast<std::uint8_t>((x * 67 + y * 41 + c * 89) % 256);
  set_texture(scene, atlas);
  const Camera camera = pinhole(120, 120, 130, 130, 59.5, 59.5);
  const Pose& T = view.T_world_camera;
  for (const Vec3d ahead : {Vec3d{0, 0, -1}, Vec3d{0, 0.3, -1}, Vec3d{0, 0, 1}}) {
    const Pose pose = look_at(T.translation, T * ahead, T.rotation * Vec3d{0, -1, 0});
    const auto off = difference(draw(scene, camera, pose), [&](int x, int y) {
      const Vec3d ray = pose.rotation * unproject(camera, {x + 0., y + 0.});
      return expected_color(view, atlas, pose.translation + ray);
    });
    EXPECT_LT(off.mean, 1.2);  // llvmpipe mixes in 1/256
    EXPECT_LE(off.max, 6);
  }
}

/// A colour for every direction in the world.
Color color_of_direction(Vec3d ray) {
  const Vec3d d = normalized(ray);
  Color out{};
  for (int i = 0; i < 3; ++i) out[i] = static_cast<std::uint8_t>(std::lround(127.5 + 127.5 * d[i]));
  return out;
}

TEST(RendererPanorama, AnEquirectangularPictureOfATexturedBox) {
  const DecodedScene scene = panorama_scene();  // as seen from its view: colour follows direction
  const View& view = scene.views[0];
  for (const Camera& camera : {panorama(256, 128), panorama(250, 90), panorama(96, 128)}) {
    const Pose turned = look_at(view.T_world_camera.translation, {-1, 4, -2}, {0.3, 0.2, 1});
    for (const Pose& pose : {view.T_world_camera, turned}) {
      const ImageRgb image = draw(scene, camera, pose);
      ASSERT_EQ(image.width, camera.width);
      ASSERT_EQ(image.height, camera.height);
      int most = 0;  // all rows and columns: poles and seam are among them
      for (int y = 0; y < image.height; ++y)
        for (int x = 0; x < image.width; ++x) {
          const Vec3d ray = pose.rotation * unproject(camera, {x + 0., y + 0.});
          const Color want = color_of_direction(transposed(view.T_world_camera.rotation) * ray);
          for (int c = 0; c < 3; ++c) most = std::max(most, std::abs(image.at(x, y)[c] - want[c]));
        }
      EXPECT_LE(most, 4) << camera.width << "x" << camera.height;
    }
  }
}

TEST(RendererPanorama, AnEquirectangularPictureShowsPlacesWhereProjectPutsThem) {
  // Nearer than the room and seen from elsewhere: small plates at known places, one across the
  // seam, one above, one below.
  const Camera camera = panorama(512, 256);
  const Pose pose = look_at({400.2, -299.7, 1.4}, {401, -298, 1.2}, {0, 0, 1});
  for (const Vec3d direction :
       {Vec3d{0, 0, 1}, Vec3d{0.01, 0.1, -1}, Vec3d{1, 0.2, 0.9}, Vec3d{0.2, 1, 0.1},
        Vec3d{-0.01, -1, -0.3}, Vec3d{-1, 0.6, -0.99}}) {
    const Vec3d middle = normalized(direction) * 2.5;
    DecodedScene scene;
    Mesh plate = test::sphere(vec_cast<float>(pose * middle), 0.12f, 12);
    add(scene, plate, kNoView);
    const ImageRgb image = draw(scene, camera, pose);
    int wrong = 0, inside = 0;
    for (int y = 0; y < image.height; ++y)
      for (int x = 0; x < image.width; ++x) {
        const double angle = std::acos(
            std::min(1.0, dot(unproject(camera, {x + 0., y + 0.}), normalized(direction))));
        const double radius = std::asin(0.12 / 2.5), pixel = std::numbers::pi / 256;
        if (std::abs(angle - radius) < 1.2 * pixel) continue;  // its rim
        wrong += at(image, x, y) != (angle < radius ? kNeutral : kBackground);
        inside += angle < radius;
      }
    EXPECT_EQ(wrong, 0) << direction.x << " " << direction.y << " " << direction.z;
    EXPECT_GT(inside, 20);
  }
}

TEST(RendererPanorama, AllShadesDrawEquirectangularPicturesToo) {
  const DecodedScene scene = panorama_scene();
  const Camera camera = panorama(64, 32);
  for (const Shade shade : {Shade::texture, Shade::normals, Shade::views, Shade::wireframe})
    for (const bool cull : {false, true}) {
      RenderOptions options = kOptions;
      options.shade = shade, options.cull_back_faces = cull;
      const ImageRgb image = draw(scene, camera, scene.views[0].T_world_camera, options);
      for (int y = 0; y < 32; ++y)
        for (int x = 0; x < 64; ++x) ASSERT_NE(at(image, x, y), kBackground);
    }
  for (const Camera& tiny : {panorama(1, 1), panorama(3, 1), panorama(1, 5)})
    EXPECT_EQ(at(draw({}, tiny), tiny.width - 1, tiny.height - 1), kBackground);
}

}  // namespace
}  // namespace mr::render
