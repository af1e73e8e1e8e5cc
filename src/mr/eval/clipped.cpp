#include "mr/eval/clipped.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>

#include "mr/atlas/compose.h"

namespace mr::eval {
namespace {

constexpr int kClippedLevel = 254;  // of 255

using Surfaces = std::map<Layer, Mesh>;

Surfaces surfaces_of(const DecodedScene& shown) {
  Surfaces out;
  for (const auto& chunk : shown.chunks) append(out[chunk->key.id.layer], chunk->mesh);
  return out;
}

/// The pixels of a view's camera picture that some triangle shows.
ImageMask shown_pixels(const Surfaces& surfaces, std::span<const View> views, const View& view) {
  ImageMask out(view.width, view.height);
  for (const auto& [layer, mesh] : surfaces) {
    if (texturing_view(views, view.id, layer) != &view) continue;
    const ImageMask used = atlas::used_pixels(mesh, view, 0);
    for (std::size_t i = 0; i < used.data.size(); ++i) out.data[i] |= used.data[i];
  }
  return out;
}

bool clips_as_shown(const View& view, const ImageRgb& texture, int x, int y) {
  const Vec2d uv = atlas_uv(view, {double(x), double(y)}, texture.width, texture.height);
  const int u = std::clamp(static_cast<int>(uv.x * texture.width), 0, texture.width - 1);
  const int v = std::clamp(static_cast<int>(uv.y * texture.height), 0, texture.height - 1);
  for (int c = 0; c < 3; ++c)
    if (static_cast<float>(texture.at(u, v)[c]) * view.gain[c] >= kClippedLevel) return true;
  return false;
}

bool clips(const std::uint8_t* rgb) { return std::max({rgb[0], rgb[1], rgb[2]}) >= kClippedLevel; }

/// Of one view; nothing where no pixel is used. `own`: the sensor's picture.
std::optional<double> clipped_share(const ImageMask& used, const View& view,
                                    const ImageRgb& texture, const ImageRgb& own) {
  const Rect& tile = view.image_rect;
  std::uint64_t all = 0, clipped = 0;
  for (int y = tile.y; y < tile.y + tile.height; ++y)
    for (int x = tile.x; x < tile.x + tile.width; ++x) {
      if (*used.at(x, y) == 0) continue;
      ++all;
      clipped += !clips(own.at(x, y)) && clips_as_shown(view, texture, x, y);
    }
  if (all == 0) return std::nullopt;
  return static_cast<double>(clipped) / static_cast<double>(all);
}

}  // namespace

std::optional<double> clipped_ratio(const DecodedScene& shown, std::span<const Frame> capture) {
  const Surfaces surfaces = surfaces_of(shown);
  std::optional<double> worst;
  for (const View& view : shown.views) {
    const auto frame = std::ranges::find(capture, sensor_of(view.id), &Frame::sensor);
    const auto texture = shown.textures.find(view.stream);
    if (frame == capture.end() || texture == shown.textures.end()) continue;
    if (frame->color.width != view.width || frame->color.height != view.height) continue;
    const auto share = clipped_share(shown_pixels(surfaces, shown.views, view), view,
                                     *texture->second, frame->color);
    if (share) worst = std::max(worst.value_or(0), *share);
  }
  return worst;
}

}  // namespace mr::eval
