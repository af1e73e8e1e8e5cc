#include "mr/eval/geometry_buffer.h"

#include <algorithm>
#include <cmath>

#include "mr/core/parallel.h"
#include "mr/kit/raster.h"

namespace mr::eval {
namespace {

constexpr float kBackground = 128, kNeutral = 176;  // as render::RenderOptions has them
constexpr double kNearest_m = 1e-6;                 // in front of a view's camera

/// The triangles that face the eye, and the place of each one's view.
struct FrontFaces {
  Mesh mesh;
  std::vector<std::uint16_t> view;  // [T]
};

FrontFaces front_faces(const baseline::Geometry& geometry, Vec3d eye) {
  FrontFaces out;
  const Vec3f from = vec_cast<float>(eye);
  for (const auto& chunk : geometry.chunks) {
    const Mesh& mesh = chunk->mesh;
    const auto base = static_cast<std::uint32_t>(out.mesh.positions.size());
    out.mesh.positions.insert(out.mesh.positions.end(), mesh.positions.begin(),
                              mesh.positions.end());
    const std::vector<ViewId> views = triangle_views(mesh);
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
      if (dot(mesh.area_normal(t), from - mesh.corner(t, 0)) <= 0) continue;
      const View* view = texturing_view(geometry.views, views[t], chunk->key.id.layer);
      out.view.push_back(view ? static_cast<std::uint16_t>(view - geometry.views.data())
                              : GeometryBuffer::kUntextured);
      const Triangle& corners = mesh.triangles[t];
      out.mesh.triangles.push_back({base + corners[0], base + corners[1], base + corners[2]});
    }
  }
  return out;
}

/// Columns of an equirectangular view wrap to the turn whose middle is the tile's.
double wrapped(double column, const View& view) {
  const double middle = view.image_rect.x + 0.5 * view.image_rect.width - 0.5;
  const double turns = (column - middle) / view.width + 0.5;
  return middle + view.width * (turns - std::floor(turns) - 0.5);
}

/// Where a point falls in a view's camera picture; false behind a pinhole.
bool to_camera_pixel(const View& view, const Camera& camera, Vec3d p_view, float* pixel) {
  if (view.kind == View::Kind::pinhole) {
    if (p_view.z <= kNearest_m) return false;
    pixel[0] = static_cast<float>(view.fx * p_view.x / p_view.z + view.cx);
    pixel[1] = static_cast<float>(view.fy * p_view.y / p_view.z + view.cy);
    return true;
  }
  const auto at = project(camera, p_view);
  if (!at) return false;
  pixel[0] = static_cast<float>(wrapped(at->x, view)), pixel[1] = static_cast<float>(at->y);
  return true;
}

/// A tile's mapping from camera pixels to the pixels of its picture.
struct Tile {
  const ImageLuma* picture = nullptr;
  float scale_x = 0, scale_y = 0, offset_x = 0, offset_y = 0;  // to pixel centres
  float left = 0, top = 0, right = 0, bottom = 0;              // of the tile's pixel centres
};

Tile tile_of(const View& view, const LumaTexture& texture) {
  const View* found = texturing_view(texture.views, view.id, view.layer);
  if (!found) return {};
  const auto picture = texture.pictures.find(found->stream);
  if (picture == texture.pictures.end()) return {};
  const Rect &tile = found->atlas_rect, &source = found->image_rect;
  Tile out;
  out.picture = &picture->second;
  out.scale_x = static_cast<float>(tile.width) / static_cast<float>(source.width);
  out.scale_y = static_cast<float>(tile.height) / static_cast<float>(source.height);
  out.offset_x =
      (0.5f - static_cast<float>(source.x)) * out.scale_x + static_cast<float>(tile.x) - 0.5f;
  out.offset_y =
      (0.5f - static_cast<float>(source.y)) * out.scale_y + static_cast<float>(tile.y) - 0.5f;
  out.left = static_cast<float>(tile.x), out.right = static_cast<float>(tile.x + tile.width - 1);
  out.top = static_cast<float>(tile.y), out.bottom = static_cast<float>(tile.y + tile.height - 1);
  return out;
}

float sample(const Tile& tile, const float* camera_pixel) {
  const float x = std::clamp(camera_pixel[0] * tile.scale_x + tile.offset_x, tile.left, tile.right);
  const float y = std::clamp(camera_pixel[1] * tile.scale_y + tile.offset_y, tile.top, tile.bottom);
  const int x0 = static_cast<int>(x), y0 = static_cast<int>(y);
  const float fx = x - static_cast<float>(x0), fy = y - static_cast<float>(y0);
  const int right = x0 < static_cast<int>(tile.right) ? 1 : 0;
  const float* upper = tile.picture->at(x0, y0);
  const float* lower = y0 < static_cast<int>(tile.bottom) ? upper + tile.picture->width : upper;
  const float above = upper[0] + (upper[right] - upper[0]) * fx;
  const float below = lower[0] + (lower[right] - lower[0]) * fx;
  return above + (below - above) * fy;
}

/// The luma of a tile whose view has a gain. Each view has a tile of its own.
void apply_gain(const ImageRgb& picture, const View& view, ImageLuma& luma) {
  const Rect& tile = view.atlas_rect;
  const auto gained = [&](const std::uint8_t* rgb, int channel, float gain) {
    return std::min(gain * static_cast<float>(rgb[channel]), 255.0f);
  };
  const int right = std::min(tile.x + tile.width, picture.width);
  for (int y = tile.y; y < std::min(tile.y + tile.height, picture.height); ++y)
    for (int x = tile.x; x < right; ++x) {
      const std::uint8_t* rgb = picture.at(x, y);
      *luma.at(x, y) = 0.2126f * gained(rgb, 0, view.gain.x) +
                       0.7152f * gained(rgb, 1, view.gain.y) +
                       0.0722f * gained(rgb, 2, view.gain.z);
    }
}

}  // namespace

GeometryBuffer draw_geometry(const baseline::Geometry& geometry,
                             const render::Viewpoint& viewpoint) {
  const Camera& camera = viewpoint.camera;
  const FrontFaces surface = front_faces(geometry, viewpoint.T_world_camera.translation);
  const kit::Raster raster = kit::rasterize(surface.mesh, camera, viewpoint.T_world_camera);
  GeometryBuffer out;
  out.width = camera.width, out.height = camera.height;
  out.covered = ImageMask(camera.width, camera.height);
  out.views = geometry.views;
  out.view = Image<std::uint16_t, 1>(camera.width, camera.height, GeometryBuffer::kUntextured);
  out.camera_pixel = Image<float, 2>(camera.width, camera.height);
  std::vector<Pose> T_view_camera;
  std::vector<Camera> cameras;
  for (const View& view : geometry.views) {
    T_view_camera.push_back(view.T_world_camera.inverse() * viewpoint.T_world_camera);
    cameras.push_back(view.camera());
  }
  parallel_for(camera.height, 32, [&](std::size_t begin, std::size_t end) {
    for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y)
      for (int x = 0; x < camera.width; ++x) {
        const std::uint32_t triangle = *raster.triangle.at(x, y);
        if (triangle == kit::kNoTriangle) continue;
        *out.covered.at(x, y) = 1;
        const std::uint16_t v = surface.view[triangle];
        if (v == GeometryBuffer::kUntextured) continue;
        const Vec3d p = unproject(camera, {1.0 * x, 1.0 * y}) * *raster.depth.at(x, y);
        if (to_camera_pixel(geometry.views[v], cameras[v], T_view_camera[v] * p,
                            out.camera_pixel.at(x, y)))
          *out.view.at(x, y) = v;
      }
  });
  return out;
}

LumaTexture luma_texture(const baseline::Texture& texture) {
  LumaTexture out{texture.views, {}};
  for (const auto& [stream, picture] : texture.pictures) out.pictures[stream] = luma_of(*picture);
  for (const View& view : texture.views) {
    const auto picture = texture.pictures.find(view.stream);
    if (view.gain != Vec3f{1, 1, 1} && picture != texture.pictures.end())
      apply_gain(*picture->second, view, out.pictures[view.stream]);
  }
  return out;
}

ImageMask pixels_of(const GeometryBuffer& buffer, Layer layer) {
  ImageMask out(buffer.width, buffer.height);
  std::ranges::transform(buffer.view.data, out.data.begin(), [&](std::uint16_t v) {
    return v != GeometryBuffer::kUntextured && buffer.views[v].layer == layer;
  });
  return out;
}

ImageLuma shade(const GeometryBuffer& buffer, const LumaTexture& texture) {
  std::vector<Tile> tiles;
  for (const View& view : buffer.views) tiles.push_back(tile_of(view, texture));
  ImageLuma out(buffer.width, buffer.height);
  parallel_for(out.data.size(), 1 << 15, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const std::uint16_t v = buffer.view.data[i];
      if (v != GeometryBuffer::kUntextured && tiles[v].picture)
        out.data[i] = sample(tiles[v], &buffer.camera_pixel.data[2 * i]);
      else
        out.data[i] = buffer.covered.data[i] ? kNeutral : kBackground;
    }
  });
  return out;
}

}  // namespace mr::eval
