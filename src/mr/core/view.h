#pragma once

#include <span>

#include "mr/core/camera.h"
#include "mr/core/image.h"
#include "mr/core/layer.h"
#include "mr/core/mesh.h"
#include "mr/core/pose.h"

namespace mr {

/// A picture that textures triangles by projection (docs/conventions.md): a pinhole or an
/// equirectangular one. Colour is undistorted before it is coded, so clients know these two kinds
/// only. A sensor may have two views: its live picture textures chunks of the layer `moving`, its
/// clean plate (the picture of the room without moving people and things) those of the layer
/// `still`.
struct View {
  enum class Kind : std::uint8_t { pinhole, equirectangular };

  ViewId id{};
  Kind kind = Kind::pinhole;
  int width = 0, height = 0;  ///< pixels of the undistorted camera picture
  double fx = 0, fy = 0, cx = 0, cy = 0;
  Pose T_world_camera;
  Rect image_rect;              ///< camera pixels that the tile shows
  Rect atlas_rect;              ///< where the tile lies in the decoded picture of `stream`
  float gutter_px = 2;          ///< margin inside image_rect that no triangle may use
  StreamId stream{};            ///< texture stream that holds the tile
  std::uint32_t layout = 0;     ///< id of the arrangement of tiles; changes only with a key frame
  Layer layer = Layer::moving;  ///< of the chunks that it textures
  Vec3f gain{1, 1, 1};          ///< per channel: shown sRGB value / decoded sRGB value

  friend bool operator==(const View&, const View&) = default;

  /// The view's camera: pinhole without distortion, or equirectangular.
  Camera camera() const {
    Camera c;
    c.model = kind == Kind::pinhole ? CameraModel::pinhole : CameraModel::equirectangular;
    c.width = width, c.height = height;
    c.fx = fx, c.fy = fy, c.cx = cx, c.cy = cy;
    return c;
  }
};

/// The view that textures the triangles labelled `id` in a chunk of `layer`: the view of that
/// layer, or if there is none, of the other layer. nullptr: no view has the id.
inline const View* texturing_view(std::span<const View> views, ViewId id, Layer layer) {
  const View* other = nullptr;
  for (const View& view : views) {
    if (view.id != id) continue;
    if (view.layer == layer) return &view;
    if (!other) other = &view;
  }
  return other;
}

/// Where a camera pixel lies in the picture of the view's stream, pixel centres at whole numbers.
inline Vec2d stream_pixel(const View& view, Vec2d camera_pixel) {
  const double sx = static_cast<double>(view.atlas_rect.width) / view.image_rect.width;
  const double sy = static_cast<double>(view.atlas_rect.height) / view.image_rect.height;
  return {(camera_pixel.x + 0.5 - view.image_rect.x) * sx + view.atlas_rect.x - 0.5,
          (camera_pixel.y + 0.5 - view.image_rect.y) * sy + view.atlas_rect.y - 0.5};
}

/// The camera pixel at a place in the picture of the view's stream: the inverse of stream_pixel().
inline Vec2d camera_pixel(const View& view, Vec2d stream_pixel) {
  const double sx = static_cast<double>(view.image_rect.width) / view.atlas_rect.width;
  const double sy = static_cast<double>(view.image_rect.height) / view.atlas_rect.height;
  return {(stream_pixel.x + 0.5 - view.atlas_rect.x) * sx + view.image_rect.x - 0.5,
          (stream_pixel.y + 0.5 - view.atlas_rect.y) * sy + view.image_rect.y - 0.5};
}

/// Texture coordinate of a camera pixel in the stream's picture of the given size:
/// uv = (p + 0.5) / size, v from the top.
inline Vec2d atlas_uv(const View& view, Vec2d camera_pixel, int atlas_width, int atlas_height) {
  const Vec2d p = stream_pixel(view, camera_pixel);
  return {(p.x + 0.5) / atlas_width, (p.y + 0.5) / atlas_height};
}

}  // namespace mr
