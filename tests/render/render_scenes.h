#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <functional>
#include <memory>
#include <utility>
#include <vector>

#include "mr/render/renderer.h"
#include "support/meshes.h"

/// Small scenes and cameras, and what must be seen of them.
namespace mr::render {

using Color = std::array<std::uint8_t, 3>;
using Shade = RenderOptions::Shade;

inline constexpr Color kBackground{10, 20, 30};
inline constexpr Color kNeutral{200, 100, 50};
inline const RenderOptions kOptions{kBackground, kNeutral, false, Shade::texture};

/// Mesa's llvmpipe is always there (scripts/setup), so no device is a failure.
inline Renderer& renderer() {
  static Result<Renderer> made = Renderer::create();
  if (!made) {
    ADD_FAILURE() << made.error().message;
    std::abort();
  }
  return *made;
}

inline ImageRgb draw(const DecodedScene& scene, const Camera& camera, const Pose& pose = {},
                     const RenderOptions& options = kOptions) {
  auto image = renderer().draw(scene, camera, pose, options);
  if (image) return *image;
  ADD_FAILURE() << image.error().message;
  return ImageRgb(camera.width, camera.height);
}

inline Camera pinhole(int width, int height, double fx, double fy, double cx, double cy) {
  Camera c;
  c.width = width, c.height = height;
  c.fx = fx, c.fy = fy, c.cx = cx, c.cy = cy;
  return c;
}

inline Camera panorama(int width, int height) {
  Camera c;
  c.model = CameraModel::equirectangular;
  c.width = width, c.height = height;
  return c;
}

inline Color at(const ImageRgb& image, int x, int y) {
  const auto* p = image.at(x, y);
  return {p[0], p[1], p[2]};
}

/// A picture from a formula that gives channels in 0..1.
inline ImageRgb picture(int width, int height,
                        const std::function<Vec3d(double, double)>& formula) {
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
inline ImageRgb asymmetric_picture(int width, int height) {
  return picture(width, height, [&](double x, double y) {
    return Vec3d{x / width, y / height, 0.5 + 0.4 * std::sin(0.3 * x + 0.5 * y)};
  });
}

inline ImageRgb plain_picture(int width, int height, Color color) {
  return picture(width, height, [&](double, double) {
    return Vec3d{color[0] / 255., color[1] / 255., color[2] / 255.};
  });
}

inline View view_of(std::uint32_t number, const Camera& camera, const Pose& T_world_camera,
                    Rect atlas_rect) {
  View view;
  view.id = ViewId{number};
  view.width = camera.width, view.height = camera.height;
  view.fx = camera.fx, view.fy = camera.fy, view.cx = camera.cx, view.cy = camera.cy;
  view.T_world_camera = T_world_camera;
  view.image_rect = {0, 0, camera.width, camera.height};
  view.atlas_rect = atlas_rect;
  return view;
}

inline void add(DecodedScene& scene, Mesh mesh, ViewId view) {
  set_view(mesh, view);
  auto chunk = std::make_shared<Chunk>();
  chunk->mesh = std::move(mesh);
  scene.chunks.push_back(std::move(chunk));
}

inline void set_texture(DecodedScene& scene, ImageRgb image, StreamId stream = {}) {
  scene.textures[stream] = std::make_shared<const ImageRgb>(std::move(image));
}

/// A wall across the line of sight of a camera at `pose`, facing it.
inline Mesh wall_before(const Pose& pose, double distance_m, double half_m, int cells = 3) {
  const auto point = [&](double x, double y) {
    return vec_cast<float>(pose * Vec3d{x, y, distance_m});
  };
  const Vec3f origin = point(-half_m, half_m);  // lower left as the camera sees it
  return test::grid(origin, point(half_m, half_m) - origin, point(-half_m, -half_m) - origin, cells,
                    cells);
}

/// The colour that texturing by projection must give a point of a view's surface: the sample of the
/// view's tile at the point's projection. A tile that covers 360° wraps around.
inline Vec3d expected_color(const View& view, const ImageRgb& atlas, Vec3d p_world) {
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
inline Difference difference(const ImageRgb& image,
                             const std::function<Vec3d(int, int)>& expected) {
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

inline Vec3d as_vec(const std::uint8_t* p) { return {p[0] + 0., p[1] + 0., p[2] + 0.}; }

inline const Camera kCamera = pinhole(96, 64, 70, 82, 40.3, 37.6);  // off-centre, pixels not square
inline const Pose kPose = look_at({3, -2, 1.5}, {-1, 2, 0.4}, {0, 0, 1});

inline std::shared_ptr<Chunk> background_of(Mesh mesh, std::vector<Color> colors) {
  auto chunk = std::make_shared<Chunk>();
  chunk->key.id.source = kBackgroundSource;
  set_triangle_views(mesh, std::vector<ViewId>(mesh.triangles.size(), kNoView));
  chunk->mesh = std::move(mesh);
  chunk->colors = std::move(colors);
  return chunk;
}

inline std::shared_ptr<Chunk> points_of(std::vector<Vec3f> positions, std::vector<Color> colors,
                                        float point_m) {
  auto chunk = std::make_shared<Chunk>();
  chunk->mesh.positions = std::move(positions);
  chunk->colors = std::move(colors);
  chunk->point_m = point_m;
  return chunk;
}

inline int count(const ImageRgb& image, Color color) {
  int out = 0;
  for (int y = 0; y < image.height; ++y)
    for (int x = 0; x < image.width; ++x) out += at(image, x, y) == color;
  return out;
}

}  // namespace mr::render
