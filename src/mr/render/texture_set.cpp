#include "mr/render/texture_set.h"

#include <epoxy/gl.h>

#include <algorithm>
#include <string>
#include <utility>

#include "mr/core/parallel.h"

namespace mr::render {
namespace {

Error invalid_view(std::string message) { return {Error::Cause::invalid, std::move(message)}; }

/// The view's tile must lie in the picture that the scene holds for it.
Status check(const View& view, const DecodedScene& scene) {
  const std::string name = "view " + std::to_string(number_of(view.id));
  const auto found = scene.textures.find(view.stream);
  if (found == scene.textures.end() || !found->second || found->second->empty())
    return invalid_view(name + " has no picture: texture stream " +
                        std::to_string(number_of(view.stream)) + " is missing");
  const Rect &tile = view.atlas_rect, &source = view.image_rect;
  const ImageRgb& picture = *found->second;
  if (view.width < 1 || view.height < 1 || source.empty() || tile.empty() || tile.x < 0 ||
      tile.y < 0 || tile.width > picture.width - tile.x || tile.height > picture.height - tile.y)
    return invalid_view(name + " has a tile outside the picture of texture stream " +
                        std::to_string(number_of(view.stream)));
  return {};
}

int largest_side() {
  GLint side = 0;
  glGetIntegerv(GL_MAX_TEXTURE_SIZE, &side);
  return side;
}

void create(unsigned& name) {
  glGenTextures(1, &name);
  glBindTexture(GL_TEXTURE_2D, name);
  for (const GLenum filter : {GL_TEXTURE_MIN_FILTER, GL_TEXTURE_MAG_FILTER})
    glTexParameteri(GL_TEXTURE_2D, filter, GL_LINEAR);
  for (const GLenum wrap : {GL_TEXTURE_WRAP_S, GL_TEXTURE_WRAP_T})
    glTexParameteri(GL_TEXTURE_2D, wrap, GL_CLAMP_TO_EDGE);
}

/// As the card keeps it; the driver does this on one thread only.
void widen(const ImageRgb& image, std::vector<std::uint8_t>& rgba) {
  const std::size_t pixels = image.data.size() / 3;
  rgba.resize(4 * pixels);
  parallel_for(pixels, 1 << 16, [&](std::size_t begin, std::size_t end) {
    const std::uint8_t* from = image.data.data() + 3 * begin;
    std::uint8_t* to = rgba.data() + 4 * begin;
    for (std::size_t i = begin; i < end; ++i, from += 3, to += 4)
      to[0] = from[0], to[1] = from[1], to[2] = from[2], to[3] = 255;
  });
}

/// Fills the fourth channel: bilinear between the middles of the plane's pixels.
void add_alpha(const Alpha& alpha, const ImageRgb& image, std::vector<std::uint8_t>& rgba) {
  const ImageMask& plane = alpha.plane;
  const auto place = [&](int pixel) { return (pixel + 0.5f) / alpha.step_px - 0.5f; };
  parallel_for(image.height, 16, [&](std::size_t begin, std::size_t end) {
    for (std::size_t y = begin; y < end; ++y) {
      const float v = std::clamp(place(static_cast<int>(y)), 0.0f, plane.height - 1.0f);
      const int v0 = static_cast<int>(v), v1 = std::min(v0 + 1, plane.height - 1);
      std::uint8_t* to = rgba.data() + 4 * y * image.width + 3;
      for (int x = 0; x < image.width; ++x, to += 4) {
        const float u = std::clamp(place(x), 0.0f, plane.width - 1.0f);
        const int u0 = static_cast<int>(u), u1 = std::min(u0 + 1, plane.width - 1);
        const float du = u - u0, dv = v - v0;
        const float above = *plane.at(u0, v0) * (1 - du) + *plane.at(u1, v0) * du;
        const float below = *plane.at(u0, v1) * (1 - du) + *plane.at(u1, v1) * du;
        *to = static_cast<std::uint8_t>(255 * (above * (1 - dv) + below * dv) + 0.5f);
      }
    }
  });
}

}  // namespace

Status TextureSet::keep(const DecodedScene& scene, const std::vector<ViewRange>& ranges) {
  std::erase_if(textures_, [&](const auto& entry) {
    if (scene.textures.contains(entry.first)) return false;
    glDeleteTextures(1, &entry.second.name);
    return true;
  });
  for (const ViewRange& range : ranges) {
    if (range.view == kNoView) continue;
    const View* view = texturing_view(scene.views, range.view, range.layer);
    if (!view)
      return invalid_view("triangles name view " + std::to_string(number_of(range.view)) +
                          ", which the scene does not have");
    if (auto ok = check(*view, scene); !ok) return ok.error();
    const auto& image = scene.textures.at(view->stream);
    if (std::max(image->width, image->height) > largest_side())
      return Error{Error::Cause::too_large, "texture stream " +
                                                std::to_string(number_of(view->stream)) +
                                                " is larger than this device takes"};
    const auto plane = scene.alpha.find(view->stream);
    const auto alpha = plane == scene.alpha.end() ? nullptr : plane->second;
    if (alpha && !alpha->fits(*image))
      return invalid_view("alpha of texture stream " + std::to_string(number_of(view->stream)) +
                          " is not of its picture's size");
    Texture& texture = textures_[view->stream];
    if (texture.name && texture.image.lock() == image && texture.alpha.lock() == alpha) continue;
    upload(texture, *image, alpha.get());
    texture.image = image, texture.alpha = alpha;
  }
  return {};
}

void TextureSet::upload(Texture& texture, const ImageRgb& image, const Alpha* alpha) {
  if (!texture.name) create(texture.name);
  glBindTexture(GL_TEXTURE_2D, texture.name);
  if (texture.width != image.width || texture.height != image.height)
    glTexImage2D(GL_TEXTURE_2D, 0, GL_RGBA8, image.width, image.height, 0, GL_RGBA,
                 GL_UNSIGNED_BYTE, nullptr);
  texture.width = image.width, texture.height = image.height;
  widen(image, rgba_);
  if (alpha) add_alpha(*alpha, image, rgba_);
  glTexSubImage2D(GL_TEXTURE_2D, 0, 0, 0, image.width, image.height, GL_RGBA, GL_UNSIGNED_BYTE,
                  rgba_.data());
}

Vec2i TextureSet::bind(StreamId stream) const {
  const Texture& texture = textures_.at(stream);
  glBindTexture(GL_TEXTURE_2D, texture.name);
  return {texture.width, texture.height};
}

}  // namespace mr::render
