#include "mr/render/renderer.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <functional>
#include <limits>
#include <numbers>

#include "support/meshes.h"

namespace mr::render {
namespace {

using Color = std::array<std::uint8_t, 3>;
using Shade = RenderOptions::Shade;

constexpr Color kBackground{10, 20, 30};
constexpr Color kNeutral{200, 100, 50};
const RenderOptions kOptions{kBackground, kNeutral, false, Shade::texture};

/// Mesa's llvmpipe is always there (scripts/setup), so no device is a failure.
Renderer& renderer() {
  static Result<Renderer> made = Renderer::create();
  if (!made) {
    ADD_FAILURE() << made.error().message;
    std::abort();
  }
  return *made;
}

ImageRgb draw(const DecodedScene& scene, const Camera& camera, const Pose& pose = {},
              const RenderOptions& options = kOptions) {
  auto image = renderer().draw(scene, camera, pose, options);
  if (image) return *image;
  ADD_FAILURE() << image.error().message;
  return ImageRgb(camera.width, camera.height);
}

Camera pinhole(int width, int height, double fx, double fy, double cx, double cy) {
  Camera c;
  c.width = width, c.height = height;
  c.fx = fx, c.fy = fy, c.cx = cx, c.cy = cy;
  return c;
}

Camera panorama(int width, int height) {
  Camera c;
  c.model = CameraModel::equirectangular;
  c.width = width, c.height = height;
  return c;
}

Color at(const ImageRgb& image, int x, int y) {
  const auto* p = image.at(x, y);
  return {p[0], p[1], p[2]};
}

/// A picture from a formula that gives channels in 0..1.
ImageRgb picture(int width, int height, const std::function<Vec3d(double, double)>& formula) {
  ImageRgb image(width, height);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      const Vec3d c = formula(x, y);
      for (int i = 0; i < 3; ++i)
        image.at(x, y)[i] = static_cast<std::uint8_t>(std::lround(255 * std::clamp(c[i], 0., 1.)));
    }
  return image;
}

/// No two places alike, no symmetry: red grows to the right, green down, with waves.
ImageRgb asymmetric_picture(int width, int height) {
  return picture(width, height, [&](double x, double y) {
    return Vec3d{x / width, y / height, 0.5 + 0.4 * std::sin(0.3 * x + 0.5 * y)};
  });
}

ImageRgb plain_picture(int width, int height, Color color) {
  return picture(width, height, [&](double, double) {
    return Vec3d{color[0] / 255., color[1] / 255., color[2] / 255.};
  });
}

View view_of(ViewId id, const Camera& camera, const Pose& T_world_camera, Rect atlas_rect) {
  View view;
  view.id = id;
  view.width = camera.width, view.height = camera.height;
  view.fx = camera.fx, view.fy = camera.fy, view.cx = camera.cx, view.cy = camera.cy;
  view.T_world_camera = T_world_camera;
  view.image_rect = {0, 0, camera.width, camera.height};
  view.atlas_rect = atlas_rect;
  return view;
}

void add(DecodedScene& scene, Mesh mesh, ViewId view) {
  set_triangle_views(mesh, std::vector<ViewId>(mesh.triangles.size(), view));
  auto chunk = std::make_shared<Chunk>();
  chunk->mesh = std::move(mesh);
  scene.chunks.push_back(std::move(chunk));
}

void set_texture(DecodedScene& scene, ImageRgb image, std::uint32_t stream = 0) {
  scene.textures[stream] = std::make_shared<const ImageRgb>(std::move(image));
}

/// A wall across the line of sight of a camera at `pose`, facing it.
Mesh wall_before(const Pose& pose, double distance_m, double half_m, int cells = 3) {
  const auto point = [&](double x, double y) {
    return vec_cast<float>(pose * Vec3d{x, y, distance_m});
  };
  const Vec3f origin = point(-half_m, half_m);  // lower left as the camera sees it
  return test::grid(origin, point(half_m, half_m) - origin, point(-half_m, -half_m) - origin, cells,
                    cells);
}

/// What DESIGN section 4 says a point of a view's surface looks like; a tile that is the whole turn
/// goes on with its other side.
Vec3d expected_color(const View& view, const ImageRgb& atlas, Vec3d p_world) {
  Vec2d pixel = *project(view.camera(), view.T_world_camera.inverse() * p_world);
  if (view.kind == View::Kind::equirectangular) {
    const double middle = view.image_rect.x + 0.5 * view.image_rect.width - 0.5;
    pixel.x -= view.width * std::round((pixel.x - middle) / view.width);
  }
  const Vec2d uv = atlas_uv(view, pixel, atlas.width, atlas.height);
  const Rect& tile = view.atlas_rect;
  const bool turn = view.kind == View::Kind::equirectangular && view.image_rect.width == view.width;
  const double last = tile.x + tile.width - 1.;
  const double wide = uv.x * atlas.width - 0.5;
  const double x = turn ? wide : std::clamp(wide, tile.x + 0., last);
  const double y = std::clamp(uv.y * atlas.height - 0.5, tile.y + 0., tile.y + tile.height - 1.);
  int x0 = static_cast<int>(std::floor(x)), x1 = x0 + 1;
  x0 = x0 < tile.x ? tile.x + tile.width - 1 : x0;
  x1 = x1 <= last ? x1 : turn ? tile.x : static_cast<int>(last);
  const double across = x - std::floor(x);
  const int y0 = static_cast<int>(y), y1 = std::min(y0 + 1, atlas.height - 1);
  Vec3d out;
  for (int i = 0; i < 3; ++i) {
    const double up = std::lerp(atlas.at(x0, y0)[i], atlas.at(x1, y0)[i], across);
    const double down = std::lerp(atlas.at(x0, y1)[i], atlas.at(x1, y1)[i], across);
    out[i] = std::lerp(up, down, y - y0);
  }
  return out;
}

/// Mean and largest difference of the interior of two pictures, in levels.
struct Difference {
  double mean = 0, max = 0;
};
Difference difference(const ImageRgb& image, const std::function<Vec3d(int, int)>& expected) {
  Difference out;
  int count = 0;
  for (int y = 1; y + 1 < image.height; ++y)
    for (int x = 1; x + 1 < image.width; ++x) {
      const Vec3d want = expected(x, y);
      for (int i = 0; i < 3; ++i) {
        const double off = std::abs(image.at(x, y)[i] - want[i]);
        out.mean += off, out.max = std::max(out.max, off), ++count;
      }
    }
  out.mean /= count;
  return out;
}

Vec3d as_vec(const std::uint8_t* p) { return {p[0] + 0., p[1] + 0., p[2] + 0.}; }

const Camera kCamera = pinhole(96, 64, 70, 82, 40.3, 37.6);  // off-centre, pixels not square
const Pose kPose = look_at({3, -2, 1.5}, {-1, 2, 0.4}, {0, 0, 1});

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

TEST(Renderer, AViewSeenFromItsOwnCameraIsItsPicture) {
  const ImageRgb original = asymmetric_picture(96, 64);
  DecodedScene scene;
  scene.views.push_back(view_of(7, kCamera, kPose, {0, 0, 96, 64}));
  set_texture(scene, original);
  add(scene, wall_before(kPose, 2, 4), 7);
  const ImageRgb image = draw(scene, kCamera, kPose);
  const auto off = difference(image, [&](int x, int y) { return as_vec(original.at(x, y)); });
  EXPECT_LT(off.mean, 0.5);
  EXPECT_LE(off.max, 4);
  const auto mirrored =
      difference(image, [&](int x, int y) { return as_vec(original.at(95 - x, y)); });
  EXPECT_GT(mirrored.mean, 20);
}

TEST(Renderer, OnlyPartOfAPictureScaledIntoAnAtlas) {
  DecodedScene scene;
  View view = view_of(0, kCamera, kPose, {20, 7, 33, 50});
  view.image_rect = {10, 4, 66, 50};
  view.stream = 3;
  scene.views.push_back(view);
  set_texture(scene, asymmetric_picture(75, 61), 3);  // odd width: rows are not 4-byte aligned
  const Mesh wall = wall_before(kPose, 2, 4);
  add(scene, wall, 0);
  const Camera eye = pinhole(80, 60, 60, 60, 39.5, 29.5);
  const Pose pose = look_at({2.6, -2.1, 1.6}, {-1, 2, 0.4}, {0, 0.1, 1});
  const ImageRgb image = draw(scene, eye, pose);
  const Vec3d normal = kPose.rotation.column(2), origin = vec_cast<double>(wall.positions[0]);
  const auto off = difference(image, [&](int x, int y) {
    const Vec3d ray = pose.rotation * unproject(eye, {x + 0., y + 0.});
    const double t = dot(origin - pose.translation, normal) / dot(ray, normal);
    return expected_color(view, *scene.textures[3], pose.translation + ray * t);
  });
  EXPECT_LT(off.mean, 0.6);
  EXPECT_LE(off.max, 3);
}

TEST(Renderer, NeighboursInAnAtlasDoNotBleed) {
  const Color red{255, 0, 0}, blue{0, 0, 255};
  ImageRgb atlas = plain_picture(40, 20, blue);
  for (int y = 0; y < 20; ++y)
    for (int x = 0; x < 20; ++x) std::copy(red.begin(), red.end(), atlas.at(x, y));
  const Camera small = pinhole(20, 20, 20, 20, 9.5, 9.5);
  DecodedScene scene;
  scene.views = {view_of(0, small, {}, {0, 0, 20, 20}), view_of(1, small, {}, {20, 0, 20, 20})};
  set_texture(scene, atlas);
  const Camera wide = pinhole(200, 60, 50, 50, 99.5, 29.5);
  for (const ViewId view : {0u, 1u}) {  // the wall is wider than the pictures: the rim is repeated
    scene.chunks.clear();
    add(scene, wall_before({}, 2, 8), view);
    const ImageRgb image = draw(scene, wide);
    for (int y = 0; y < 60; ++y)
      for (int x = 0; x < 200; ++x) ASSERT_EQ(at(image, x, y), view == 0 ? red : blue);
  }
}

TEST(Renderer, RunsOfSeveralChunksUseTheirOwnViewsAndStreams) {
  DecodedScene scene;
  const Camera camera = pinhole(60, 40, 40, 40, 29.5, 19.5);
  const std::array<Color, 3> colors{{{255, 0, 0}, {0, 255, 0}, {0, 0, 255}}};
  for (const std::uint32_t id : {0u, 1u, 2u}) {
    scene.views.push_back(view_of(id, camera, {}, {0, 0, 60, 40}));
    scene.views.back().stream = 10 + id;
    set_texture(scene, plain_picture(60, 40, colors[id]), 10 + id);
  }
  Mesh wall = test::grid({-1.5f, 2, 2}, {3, 0, 0}, {0, -4, 0}, 4, 1);  // 15 pixels a column
  set_triangle_views(wall, {2, 2, 0, 0, kNoView, kNoView, 1, 1});
  auto chunk = std::make_shared<Chunk>();
  chunk->mesh = wall;
  scene.chunks = {chunk, chunk};
  const ImageRgb image = draw(scene, camera);
  EXPECT_EQ(at(image, 7, 20), colors[2]);
  EXPECT_EQ(at(image, 22, 20), colors[0]);
  EXPECT_EQ(at(image, 37, 20), kNeutral);
  EXPECT_EQ(at(image, 52, 20), colors[1]);
}

TEST(Renderer, AChunksLayerPicksTheLivePictureOrThePlate) {
  const Camera camera = pinhole(60, 40, 40, 40, 29.5, 19.5);
  const Color live{200, 0, 0}, plate{0, 100, 40};
  DecodedScene scene;
  scene.views = {view_of(0, camera, {}, {0, 0, 60, 40}), view_of(0, camera, {}, {0, 0, 60, 40})};
  scene.views[1].layer = Layer::still, scene.views[1].stream = 1;
  scene.views[1].gain = {1, 2, 3};
  set_texture(scene, plain_picture(60, 40, live), 0);
  set_texture(scene, plain_picture(60, 40, plate), 1);
  const auto half = [](float x, Layer layer) {
    auto chunk = std::make_shared<Chunk>();
    chunk->key.id.layer = layer;
    chunk->mesh = test::grid({x, 2, 2}, {1.5f, 0, 0}, {0, -4, 0}, 1, 1);
    set_triangle_views(chunk->mesh, {0, 0});
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

TEST(Renderer, GainMultipliesWhatThePictureShowsAndIsClamped) {
  for (const bool panoramic : {false, true}) {
    DecodedScene scene;
    View view = view_of(0, kCamera, kPose, {0, 0, 96, 64});
    if (panoramic) view.kind = View::Kind::equirectangular;
    scene.views.push_back(view);
    set_texture(scene, asymmetric_picture(96, 64));
    add(scene, wall_before(kPose, 2, 4), 0);
    const ImageRgb plain = draw(scene, kCamera, kPose);
    scene.views[0].gain = {0.25f, 1.5f, 4};
    const auto off = difference(draw(scene, kCamera, kPose), [&](int x, int y) {
      const auto* p = plain.at(x, y);
      return Vec3d{p[0] * 0.25, std::min(255.0, p[1] * 1.5), std::min(255.0, p[2] * 4.0)};
    });
    EXPECT_LE(off.max, 2.6);  // half a level of the plain picture, times the gain, and half a level
  }
}

TEST(Renderer, NearerSurfacesHideFartherOnes) {
  const Camera camera = pinhole(60, 40, 40, 40, 29.5, 19.5);
  DecodedScene scene;
  scene.views.push_back(view_of(0, camera, {}, {0, 0, 60, 40}));
  set_texture(scene, plain_picture(60, 40, {0, 255, 0}));
  add(scene, wall_before({}, 1.0, 0.2), 0);
  add(scene, wall_before({}, 1.002, 3), kNoView);  // drawn later, 2 mm behind
  const ImageRgb image = draw(scene, camera);
  EXPECT_EQ(at(image, 30, 20), (Color{0, 255, 0}));
  EXPECT_EQ(at(image, 5, 5), kNeutral);
}

std::shared_ptr<Chunk> background_of(Mesh mesh, std::vector<Color> colors) {
  auto chunk = std::make_shared<Chunk>();
  chunk->key.id.source = kBackgroundSource;
  set_triangle_views(mesh, std::vector<ViewId>(mesh.triangles.size(), kNoView));
  chunk->mesh = std::move(mesh);
  chunk->colors = std::move(colors);
  return chunk;
}

TEST(Renderer, ABackgroundShowsItsColours) {
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

TEST(Renderer, ABackgroundHidesAndIsHidden) {
  const Camera camera = pinhole(60, 40, 40, 40, 29.5, 19.5);
  const Color green{0, 255, 0}, blue{5, 60, 250};
  for (const bool background_first : {true, false})
    for (const double background_m : {0.9, 1.1}) {
      DecodedScene scene;
      scene.views.push_back(view_of(0, camera, {}, {0, 0, 60, 40}));
      set_texture(scene, plain_picture(60, 40, green));
      add(scene, wall_before({}, 1.0, 0.2), 0);
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
  add(scene, room, 0);
  return scene;
}

TEST(Renderer, APanoramaShowsEveryDirectionAndItsSeam) {
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
      return expected_color(view, *scene.textures.at(0), pose.translation + ray);
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

TEST(Renderer, APanoramasTileMayLieAcrossTheSeam) {
  DecodedScene scene = panorama_scene();
  View& view = scene.views[0];
  const ImageRgb& whole = *scene.textures[0];
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

TEST(Renderer, AWholeTurnWithoutPaddingHasNoSeam) {
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

TEST(Renderer, AnEquirectangularPictureOfATexturedBox) {
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

TEST(Renderer, AnEquirectangularPictureShowsPlacesWhereProjectPutsThem) {
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

TEST(Renderer, AllShadesDrawEquirectangularPicturesToo) {
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

std::shared_ptr<Chunk> points_of(std::vector<Vec3f> positions, std::vector<Color> colors,
                                 float point_m) {
  auto chunk = std::make_shared<Chunk>();
  chunk->mesh.positions = std::move(positions);
  chunk->colors = std::move(colors);
  chunk->point_m = point_m;
  return chunk;
}

int count(const ImageRgb& image, Color color) {
  int out = 0;
  for (int y = 0; y < image.height; ++y)
    for (int x = 0; x < image.width; ++x) out += at(image, x, y) == color;
  return out;
}

TEST(Renderer, PointsAreDiscsOfTheirSizeAndColour) {
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

TEST(Renderer, APointCoversAtLeastAPixelAndHidesWhatIsBehindIt) {
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

TEST(Renderer, PointsOfSeveralSizesBesideTriangles) {
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

TEST(Renderer, PointsLookAlikeInAllDirectionsOfAPanorama) {
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

TEST(Renderer, BrokenPointsAreErrors) {
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
  add(scene, mesh, 0);
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

TEST(Renderer, NormalsAreColoursAndBackFacesAreDarkRed) {
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

TEST(Renderer, ViewsHaveColoursOfTheirOwnAndNeedNoTextures) {
  const Camera camera = pinhole(60, 40, 40, 40, 29.5, 19.5);
  RenderOptions options = kOptions;
  options.shade = Shade::views;
  std::vector<Color> seen;
  for (const ViewId view : {0u, 1u, 2u, 3u, 4u, 5u, 6u, 7u, kNoView}) {
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

TEST(Renderer, WireframeHasEdgesOverFaces) {
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

TEST(Renderer, SameSceneAgainWithAnotherPictureShowsThatPicture) {
  const Camera camera = pinhole(60, 40, 40, 40, 29.5, 19.5);
  DecodedScene scene;
  scene.views.push_back(view_of(0, camera, {}, {0, 0, 60, 40}));
  add(scene, wall_before({}, 2, 4), 0);
  for (const Color color : {Color{1, 2, 3}, Color{90, 80, 70}, Color{255, 254, 0}}) {
    set_texture(scene, plain_picture(60, 40, color));
    EXPECT_EQ(at(draw(scene, camera), 30, 20), color);
    EXPECT_EQ(at(draw(scene, camera), 30, 20), color);
  }
}

TEST(Renderer, FarFromTheOriginNothingMoves) {
  const Vec3d far{400, -300, 250};
  Pose pose = kPose;
  pose.translation += far;
  const ImageRgb original = asymmetric_picture(96, 64);
  DecodedScene scene;
  scene.views.push_back(view_of(0, kCamera, pose, {0, 0, 96, 64}));
  set_texture(scene, original);
  add(scene, wall_before(pose, 2, 4), 0);
  const auto off = difference(draw(scene, kCamera, pose),
                              [&](int x, int y) { return as_vec(original.at(x, y)); });
  EXPECT_LT(off.mean, 0.5);
}

TEST(Renderer, WhatIsMissingIsAnError) {
  const Camera camera = pinhole(60, 40, 40, 40, 29.5, 19.5);
  DecodedScene scene;
  add(scene, wall_before({}, 2, 4), 5);
  const auto message = [&] {
    const auto image = renderer().draw(scene, camera, {}, kOptions);
    EXPECT_FALSE(image.ok());
    EXPECT_EQ(image.error().cause, Error::Cause::invalid);
    return image.error().message;
  };
  EXPECT_NE(message().find("view 5"), std::string::npos);
  scene.views.push_back(view_of(5, camera, {}, {0, 0, 60, 40}));
  scene.views[0].stream = 9;
  EXPECT_NE(message().find("stream 9"), std::string::npos);
  set_texture(scene, plain_picture(59, 40, {1, 1, 1}), 9);
  EXPECT_NE(message().find("outside"), std::string::npos);
  set_texture(scene, plain_picture(60, 40, {1, 1, 1}), 9);
  EXPECT_TRUE(renderer().draw(scene, camera, {}, kOptions).ok());
  Mesh broken = wall_before({}, 2, 4);
  broken.triangles[0][1] = 1000;
  add(scene, broken, 5);
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
