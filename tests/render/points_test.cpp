#include <gtest/gtest.h>

#include <limits>
#include <numbers>

#include "render/render_scenes.h"

namespace mr::render {
namespace {

TEST(RendererPoints, PointsAreDiscsOfTheirSizeAndColour) {
  const Camera camera = pinhole(200, 160, 300, 300, 99.5, 79.5);
  const Color red{250, 10, 20}, green{10, 250, 30};
  const Pose pose = look_at({500.3, 20, -3}, {501, 23, -2.6}, {0, 0, 1});
  const Vec3d left{-0.2, 0.05, 1.5}, right{0.3, -0.1, 2.5};
  DecodedScene scene;
  scene.chunks = {
      points_of({vec_cast<float>(pose * left), vec_cast<float>(pose * right)}, {red, green}, 0.1f)};
  const ImageRgb image = draw(scene, camera, pose);
  const auto check = [&](Vec3d p, Color color) {
    const double radius_px = 300 * 0.05 / p.z;
    const Vec2d middle = *project(camera, p);
    for (int y = 0; y < image.height; ++y)
      for (int x = 0; x < image.width; ++x) {
        const double away = std::hypot(x - middle.x, y - middle.y);
        const bool inside = away<radius_px - 0.7, beside = away> radius_px + 0.7;
        if (!inside && (!beside || away > radius_px + 8)) continue;
        ASSERT_EQ(at(image, x, y), inside ? color : kBackground) << x << " " << y;
      }
    EXPECT_NEAR(count(image, color), std::numbers::pi * radius_px * radius_px, 0.1 * 300);
  };
  check(left, red);
  check(right, green);
  RenderOptions culled = kOptions;
  culled.cull_back_faces = true;
  EXPECT_EQ(draw(scene, camera, pose, culled), image) << "discs face the eye";
}

TEST(RendererPoints, APointCoversAtLeastAPixelAndHidesWhatIsBehindIt) {
  const Camera camera = pinhole(64, 48, 50, 50, 31.5, 23.5);
  const Color blue{0, 20, 255};
  for (const double x : {0.0, 0.013, 0.027, -0.31, 0.502}) {
    DecodedScene scene;
    scene.chunks = {points_of({vec_cast<float>(Vec3d{x, 0.011, 3})}, {blue}, 0.0001f)};
    add(scene, wall_before({}, 3.01, 6), kNoView);
    const int seen = count(draw(scene, camera), blue);
    EXPECT_TRUE(seen >= 1 && seen <= 4) << seen;
    add(scene, wall_before({}, 2.99, 6), kNoView);
    EXPECT_EQ(count(draw(scene, camera), blue), 0);
  }
}

TEST(RendererPoints, PointsOfSeveralSizesBesideTriangles) {
  const Camera camera = pinhole(90, 60, 60, 60, 44.5, 29.5);
  const Color small{1, 2, 250}, large{250, 2, 1}, wall{5, 200, 5};
  DecodedScene scene;
  const Mesh grid = wall_before({}, 2, 4);
  auto coarse = points_of({{-0.5f, 0, 1.5f}}, {large}, 0.3f);
  auto fine = points_of({{0.5f, 0, 1.5f}, {0.5f, 0.3f, 1.5f}}, {small, small}, 0.1f);
  auto plain = points_of({{0, 0.4f, 1.5f}}, {}, 0.2f);  // no colours: neutral
  scene.chunks = {coarse, background_of(grid, std::vector<Color>(grid.positions.size(), wall)),
                  fine, plain};
  const ImageRgb image = draw(scene, camera);
  EXPECT_NEAR(count(image, large), std::numbers::pi * 36, 12);
  EXPECT_NEAR(count(image, small), 2 * std::numbers::pi * 4, 10);
  EXPECT_NEAR(count(image, kNeutral), std::numbers::pi * 16, 10);
  EXPECT_EQ(count(image, wall) + count(image, large) + count(image, small) + count(image, kNeutral),
            90 * 60);
  for (const Shade shade : {Shade::normals, Shade::views, Shade::wireframe}) {
    RenderOptions options = kOptions;
    options.shade = shade;
    scene.chunks = {coarse};
    const ImageRgb other = draw(scene, camera, {}, options);
    EXPECT_NEAR(90 * 60 - count(other, kBackground), std::numbers::pi * 36, 12);
  }
}

TEST(RendererPoints, PointsLookAlikeInAllDirectionsOfAPanorama) {
  const Camera camera = panorama(512, 256);
  const Color red{255, 0, 0};
  for (const Vec3d d : {Vec3d{0, 0, 1}, Vec3d{1, 0, 1}, Vec3d{0, 0, -1}, Vec3d{-1, 0, -1},
                        Vec3d{1, 0.98, 1}, Vec3d{0, 1, 0}, Vec3d{0.02, -1, 0}}) {
    DecodedScene scene;
    scene.chunks = {points_of({vec_cast<float>(normalized(d) * 2.0)}, {red}, 0.4f)};
    const ImageRgb image = draw(scene, camera);
    double area_sr = 0;  // of a cone
    for (int y = 0; y < 256; ++y)
      for (int x = 0; x < 512; ++x)
        if (at(image, x, y)[0] > 132)
          area_sr +=
              std::cos((y - 127.5) / 256 * std::numbers::pi) * std::pow(std::numbers::pi / 256, 2);
    const double half_angle = std::atan(0.2 / 2.0);
    const double cone_sr = 2 * std::numbers::pi * (1 - std::cos(half_angle));
    EXPECT_NEAR(area_sr, cone_sr, 0.08 * cone_sr) << d.x << " " << d.y << " " << d.z;
  }
}

TEST(RendererPoints, BrokenPointsAreErrors) {
  DecodedScene scene;
  auto both = points_of({{0, 0, 1}, {1, 0, 1}, {0, 1, 1}}, {}, 0.1f);
  both->mesh.triangles = {{0, 1, 2}};
  const auto endless = points_of({{0, 0, 1}}, {}, std::numeric_limits<float>::infinity());
  const auto nowhere = points_of({{0, std::numeric_limits<float>::quiet_NaN(), 1}}, {}, 0.1f);
  for (const auto& chunk : {both, endless, nowhere}) {
    scene.chunks = {chunk};
    for (int again = 0; again < 2; ++again) {
      const auto image = renderer().draw(scene, kCamera, {}, kOptions);
      ASSERT_FALSE(image);
      EXPECT_EQ(image.error().cause, Error::Cause::invalid);
    }
  }
}

}  // namespace
}  // namespace mr::render
