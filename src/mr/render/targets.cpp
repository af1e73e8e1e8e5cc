#include "mr/render/targets.h"

#include <epoxy/gl.h>

#include <algorithm>
#include <string>

#include "mr/core/parallel.h"

namespace mr::render {
namespace {

Status check_size(int longest) {
  if (const int most = largest_picture_side(); longest > most)
    return Error{Error::Cause::too_large,
                 "this device draws at most " + std::to_string(most) + " pixels a side"};
  return {};
}

Status check_complete() {
  if (glCheckFramebufferStatus(GL_FRAMEBUFFER) != GL_FRAMEBUFFER_COMPLETE)
    return Error{Error::Cause::unsupported, "this device cannot draw into a picture"};
  return {};
}

void set_storage(unsigned renderbuffer, GLenum format, int width, int height) {
  glBindRenderbuffer(GL_RENDERBUFFER, renderbuffer);
  glRenderbufferStorage(GL_RENDERBUFFER, format, width, height);
}

Status check_read() {
  if (const GLenum code = glGetError(); code != GL_NO_ERROR)
    return Error{Error::Cause::unsupported,
                 "OpenGL failed with error " + std::to_string(code) +
                     (code == GL_OUT_OF_MEMORY ? " (out of memory)" : "")};
  return {};
}

ImageRgb without_alpha(const std::vector<std::uint8_t>& rgba, int width, int height) {
  ImageRgb out(width, height);
  parallel_for(rgba.size() / 4, 1 << 16, [&](std::size_t begin, std::size_t end) {
    const std::uint8_t* from = rgba.data() + 4 * begin;
    std::uint8_t* to = out.data.data() + 3 * begin;
    for (std::size_t i = begin; i < end; ++i, from += 4, to += 3)
      to[0] = from[0], to[1] = from[1], to[2] = from[2];
  });
  return out;
}

}  // namespace

int largest_picture_side() {
  GLint most[2]{};
  glGetIntegerv(GL_MAX_RENDERBUFFER_SIZE, &most[0]);
  glGetIntegerv(GL_MAX_TEXTURE_SIZE, &most[1]);
  return std::min(most[0], most[1]);
}

Status PictureTarget::use(int width, int height) {
  if (auto ok = check_size(std::max(width, height)); !ok) return ok;
  if (!framebuffer_) {
    glGenFramebuffers(1, &framebuffer_);
    glGenRenderbuffers(1, &color_);
    glGenRenderbuffers(1, &depth_);
  }
  glBindFramebuffer(GL_FRAMEBUFFER, framebuffer_);
  glViewport(0, 0, width, height);
  if (width_ == width && height_ == height) return {};
  width_ = height_ = 0;
  set_storage(color_, GL_RGBA8, width, height);
  set_storage(depth_, GL_DEPTH_COMPONENT24, width, height);
  glFramebufferRenderbuffer(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_RENDERBUFFER, color_);
  glFramebufferRenderbuffer(GL_FRAMEBUFFER, GL_DEPTH_ATTACHMENT, GL_RENDERBUFFER, depth_);
  if (auto ok = check_complete(); !ok) return ok;
  width_ = width, height_ = height;
  return {};
}

Result<ImageRgb> PictureTarget::read_back() {
  rgba_.resize(std::size_t{4} * width_ * height_);  // four channels: nothing for the driver to do
  glReadPixels(0, 0, width_, height_, GL_RGBA, GL_UNSIGNED_BYTE, rgba_.data());
  if (const Status ok = check_read(); !ok) return ok.error();
  return without_alpha(rgba_, width_, height_);
}

Result<ImageDepth> PictureTarget::read_depth() {
  glBindFramebuffer(GL_FRAMEBUFFER, framebuffer_);
  ImageDepth out(width_, height_);
  glReadPixels(0, 0, width_, height_, GL_DEPTH_COMPONENT, GL_FLOAT, out.data.data());
  if (const Status ok = check_read(); !ok) return ok.error();
  return out;
}

ImageMask PictureTarget::covered() const {
  ImageMask out(width_, height_);
  for (std::size_t i = 0; i < out.data.size(); ++i) out.data[i] = rgba_[4 * i + 3] >= 128 ? 1 : 0;
  return out;
}

Status FacesTarget::resize(int side) {
  if (auto ok = check_size(side); !ok) return ok;
  if (side_ == side) return {};
  if (!framebuffer_) {
    glGenFramebuffers(1, &framebuffer_);
    glGenRenderbuffers(1, &depth_);
    glGenTextures(1, &colors_);
    bind();
    for (const GLenum filter : {GL_TEXTURE_MIN_FILTER, GL_TEXTURE_MAG_FILTER})
      glTexParameteri(GL_TEXTURE_2D_ARRAY, filter, GL_LINEAR);
    for (const GLenum wrap : {GL_TEXTURE_WRAP_S, GL_TEXTURE_WRAP_T})
      glTexParameteri(GL_TEXTURE_2D_ARRAY, wrap, GL_CLAMP_TO_EDGE);
  }
  side_ = 0;
  bind();
  glTexImage3D(GL_TEXTURE_2D_ARRAY, 0, GL_RGBA8, side, side, kFaces, 0, GL_RGBA, GL_UNSIGNED_BYTE,
               nullptr);
  set_storage(depth_, GL_DEPTH_COMPONENT24, side, side);
  glBindFramebuffer(GL_FRAMEBUFFER, framebuffer_);
  glFramebufferRenderbuffer(GL_FRAMEBUFFER, GL_DEPTH_ATTACHMENT, GL_RENDERBUFFER, depth_);
  glFramebufferTextureLayer(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, colors_, 0, 0);
  if (auto ok = check_complete(); !ok) return ok;
  side_ = side;
  return {};
}

void FacesTarget::use(int face) {
  glBindFramebuffer(GL_FRAMEBUFFER, framebuffer_);
  glFramebufferTextureLayer(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, colors_, 0, face);
  glViewport(0, 0, side_, side_);
}

void FacesTarget::bind() const { glBindTexture(GL_TEXTURE_2D_ARRAY, colors_); }

}  // namespace mr::render
