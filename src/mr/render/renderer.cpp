#include "mr/render/renderer.h"

#include <epoxy/gl.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <string>
#include <utility>

#include "mr/render/egl_context.h"
#include "mr/render/gl_program.h"
#include "mr/render/scene_geometry.h"

namespace mr::render {
namespace {

using Shade = RenderOptions::Shade;
using Color = std::array<std::uint8_t, 3>;
using Matrix4f = std::array<float, 16>;  // row-major

constexpr double kNear_m = 0.05;
constexpr Color kEdge{24, 24, 24};

Error invalid(std::string message) { return {Error::Cause::invalid, std::move(message)}; }

Status check(const Camera& c, const Pose& T_world_camera) {
  if (c.model != CameraModel::pinhole || c.distortion != DistortionModel::none)
    return invalid("rendering needs a pinhole camera without distortion");
  if (c.width < 1 || c.height < 1)
    return invalid("rendering needs a picture of at least one pixel");
  for (const double v : {c.fx, c.fy, c.cx, c.cy})
    if (!std::isfinite(v)) return invalid("render camera holds a number that is not finite");
  if (c.fx <= 0 || c.fy <= 0) return invalid("render camera needs positive focal lengths");
  for (const double v : T_world_camera.matrix())
    if (!std::isfinite(v)) return invalid("render camera's pose holds a number that is not finite");
  return {};
}

/// From metres-from-the-eye to clip space: pixel (u, v) is window position (u + 0.5, v + 0.5), so
/// row 0 is read back first; the far plane is at infinity.
Matrix4f clip_from_eye(const Camera& c, const Pose& T_world_camera) {
  const Mat3& R = T_world_camera.rotation;
  const Vec3d x = R.column(0), y = R.column(1), z = R.column(2);
  const Vec3d right = (x * c.fx + z * (c.cx + 0.5)) * (2.0 / c.width) - z;
  const Vec3d down = (y * c.fy + z * (c.cy + 0.5)) * (2.0 / c.height) - z;
  Matrix4f out{};
  int row = 0;
  for (const Vec3d v : {right, down, z, z}) {
    for (int i = 0; i < 3; ++i) out[row * 4 + i] = static_cast<float>(v[i]);
    ++row;
  }
  out[11] = static_cast<float>(-2 * kNear_m);
  return out;
}

Matrix4f view_from_eye(const View& view, Vec3d eye) {
  Matrix4f out{};
  const auto m = (view.T_world_camera.inverse() * Pose{{}, eye}).matrix();
  std::transform(m.begin(), m.end(), out.begin(), [](double v) { return static_cast<float>(v); });
  return out;
}

/// A colour that differs from those of the neighbouring ids: hues in golden-ratio steps.
Color color_of(ViewId view) {
  const double hue = std::fmod(view * 0.6180339887498949 + 0.02, 1.0) * 6;
  Color out{};
  for (int i = 0; i < 3; ++i) {
    const double away = std::abs(std::fmod(hue + (i == 0 ? 3 : i == 1 ? 1 : 5), 6.0) - 3) - 1;
    out[i] = static_cast<std::uint8_t>(std::lround(255 * (0.25 + 0.7 * std::clamp(away, 0., 1.))));
  }
  return out;
}

const View* find_view(const DecodedScene& scene, ViewId id) {
  for (const View& view : scene.views)
    if (view.id == id) return &view;
  return nullptr;
}

/// The view's tile must lie in the picture that the scene holds for it.
Status check(const View& view, const DecodedScene& scene) {
  const std::string name = "view " + std::to_string(view.id);
  const auto found = scene.textures.find(view.stream);
  if (found == scene.textures.end() || !found->second || found->second->empty())
    return invalid(name + " has no picture: texture stream " + std::to_string(view.stream) +
                   " is missing");
  const Rect &tile = view.atlas_rect, &source = view.image_rect;
  const ImageRgb& picture = *found->second;
  if (view.width < 1 || view.height < 1 || source.empty() || tile.empty() || tile.x < 0 ||
      tile.y < 0 || tile.width > picture.width - tile.x || tile.height > picture.height - tile.y)
    return invalid(name + " has a tile outside the picture of texture stream " +
                   std::to_string(view.stream));
  return {};
}

struct Texture {
  GLuint name = 0;
  std::weak_ptr<const ImageRgb> image;  ///< what was uploaded; pictures never change
};

}  // namespace

struct Renderer::Impl {
  EglContext context;  // its end frees everything below
  std::array<GLuint, kPaints> programs{};
  GLuint program = 0, vertices = 0, colors = 0, indices = 0, framebuffer = 0, color = 0, depth = 0;
  int width = 0, height = 0, max_size = 0;
  std::map<std::uint32_t, Texture> textures;  // by stream
  Matrix4f T_clip_eye{};                      // of the present picture

  explicit Impl(EglContext c) : context(std::move(c)) {}

  Status set_up();
  Status resize(int w, int h);
  Status set_textures(const DecodedScene& scene, const std::vector<ViewRange>& ranges);
  void upload(const SceneGeometry& geometry);
  void use_view(const View& view, Vec3d eye, Color otherwise);
  void paint(Paint how, Color c);
  void draw_ranges(const DecodedScene& scene, const SceneGeometry& geometry, Vec3d eye,
                   const RenderOptions& options);
  Result<ImageRgb> read_back();

  GLint at(const char* uniform) const { return glGetUniformLocation(program, uniform); }
};

Status Renderer::Impl::set_up() {
  for (int i = 0; i < kPaints; ++i) {
    auto made = make_scene_program(static_cast<Paint>(i));
    if (!made) return made.error();
    programs[i] = *made;
  }
  GLint sizes[2]{};
  glGetIntegerv(GL_MAX_RENDERBUFFER_SIZE, &sizes[0]);
  glGetIntegerv(GL_MAX_TEXTURE_SIZE, &sizes[1]);
  max_size = std::min(sizes[0], sizes[1]);
  GLuint array = 0;
  glGenVertexArrays(1, &array);
  glBindVertexArray(array);
  glGenBuffers(1, &vertices);
  glGenBuffers(1, &colors);
  glGenBuffers(1, &indices);
  glBindBuffer(GL_ARRAY_BUFFER, vertices);
  glBindBuffer(GL_ELEMENT_ARRAY_BUFFER, indices);
  glEnableVertexAttribArray(0);
  glVertexAttribPointer(0, 3, GL_FLOAT, GL_FALSE, sizeof(Vec3f), nullptr);
  glBindBuffer(GL_ARRAY_BUFFER, colors);
  glVertexAttribPointer(1, 3, GL_UNSIGNED_BYTE, GL_TRUE, sizeof(Color), nullptr);
  glGenFramebuffers(1, &framebuffer);
  glGenRenderbuffers(1, &color);
  glGenRenderbuffers(1, &depth);
  glBindFramebuffer(GL_FRAMEBUFFER, framebuffer);
  glPixelStorei(GL_PACK_ALIGNMENT, 1);
  glPixelStorei(GL_UNPACK_ALIGNMENT, 1);
  glEnable(GL_DEPTH_TEST);
  glDisable(GL_DITHER);
  glFrontFace(GL_CW);  // rows go down in the window, which mirrors every triangle
  glCullFace(GL_BACK);
  return {};
}

Status Renderer::Impl::resize(int w, int h) {
  if (w > max_size || h > max_size)
    return Error{Error::Cause::too_large,
                 "this device draws at most " + std::to_string(max_size) + " pixels a side"};
  if (w == width && h == height) return {};
  width = height = 0;
  glBindRenderbuffer(GL_RENDERBUFFER, color);
  glRenderbufferStorage(GL_RENDERBUFFER, GL_RGBA8, w, h);
  glBindRenderbuffer(GL_RENDERBUFFER, depth);
  glRenderbufferStorage(GL_RENDERBUFFER, GL_DEPTH_COMPONENT24, w, h);
  glFramebufferRenderbuffer(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_RENDERBUFFER, color);
  glFramebufferRenderbuffer(GL_FRAMEBUFFER, GL_DEPTH_ATTACHMENT, GL_RENDERBUFFER, depth);
  if (glCheckFramebufferStatus(GL_FRAMEBUFFER) != GL_FRAMEBUFFER_COMPLETE)
    return Error{Error::Cause::unsupported, "this device cannot draw into a picture"};
  glViewport(0, 0, w, h);
  width = w, height = h;
  return {};
}

/// Uploads the pictures that the ranges need and that changed; forgets those of streams that ended.
Status Renderer::Impl::set_textures(const DecodedScene& scene,
                                    const std::vector<ViewRange>& ranges) {
  std::erase_if(textures, [&](const auto& entry) {
    if (scene.textures.contains(entry.first)) return false;
    glDeleteTextures(1, &entry.second.name);
    return true;
  });
  for (const ViewRange& range : ranges) {
    if (range.view == kNoView) continue;
    const View* view = find_view(scene, range.view);
    if (!view)
      return invalid("triangles name view " + std::to_string(range.view) +
                     ", which the scene does not have");
    if (auto ok = check(*view, scene); !ok) return ok.error();
    const auto& image = scene.textures.at(view->stream);
    if (image->width > max_size || image->height > max_size)
      return Error{Error::Cause::too_large, "texture stream " + std::to_string(view->stream) +
                                                " is larger than this device takes"};
    Texture& texture = textures[view->stream];
    if (texture.name && texture.image.lock() == image) continue;
    if (!texture.name) glGenTextures(1, &texture.name);
    glBindTexture(GL_TEXTURE_2D, texture.name);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_LINEAR);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_S, GL_CLAMP_TO_EDGE);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_T, GL_CLAMP_TO_EDGE);
    glTexImage2D(GL_TEXTURE_2D, 0, GL_RGB8, image->width, image->height, 0, GL_RGB,
                 GL_UNSIGNED_BYTE, image->data.data());
    texture.image = image;
  }
  return {};
}

void Renderer::Impl::upload(const SceneGeometry& geometry) {
  const auto& [positions, list, ranges, tints] = geometry;
  glBindBuffer(GL_ARRAY_BUFFER, vertices);
  glBufferData(GL_ARRAY_BUFFER, static_cast<GLsizeiptr>(positions.size() * sizeof(Vec3f)),
               positions.data(), GL_STREAM_DRAW);
  glBufferData(GL_ELEMENT_ARRAY_BUFFER, static_cast<GLsizeiptr>(list.size() * sizeof(GLuint)),
               list.data(), GL_STREAM_DRAW);
  (tints.empty() ? glDisableVertexAttribArray : glEnableVertexAttribArray)(1);
  glBindBuffer(GL_ARRAY_BUFFER, colors);
  glBufferData(GL_ARRAY_BUFFER, static_cast<GLsizeiptr>(tints.size() * sizeof(Color)), tints.data(),
               GL_STREAM_DRAW);
}

void Renderer::Impl::paint(Paint how, Color c) {
  program = programs[static_cast<int>(how)];
  glUseProgram(program);
  glUniformMatrix4fv(at("T_clip_eye"), 1, GL_TRUE, T_clip_eye.data());
  glUniform3f(at("color"), c[0] / 255.0f, c[1] / 255.0f, c[2] / 255.0f);
}

/// Paints by projection into a view, as atlas_uv() in core/view.h maps it; `otherwise`: the colour
/// of what lies behind its camera.
void Renderer::Impl::use_view(const View& view, Vec3d eye, Color otherwise) {
  paint(view.kind == View::Kind::pinhole ? Paint::pinhole : Paint::equirectangular, otherwise);
  const auto set = [&](const char* name, double x, double y) {
    glUniform2f(at(name), static_cast<float>(x), static_cast<float>(y));
  };
  const Rect &tile = view.atlas_rect, &source = view.image_rect;
  const double sx = static_cast<double>(tile.width) / source.width;
  const double sy = static_cast<double>(tile.height) / source.height;
  glUniformMatrix4fv(at("T_view_eye"), 1, GL_TRUE, view_from_eye(view, eye).data());
  set("view_size", view.width, view.height);
  set("focal", view.fx, view.fy);
  set("center", view.cx, view.cy);
  glUniform1f(at("tile_middle"), static_cast<float>(source.x + 0.5 * source.width - 0.5));
  set("scale", sx, sy);
  set("offset", (0.5 - source.x) * sx + tile.x, (0.5 - source.y) * sy + tile.y);
  set("tile_low", tile.x + 0.5, tile.y + 0.5);
  set("tile_high", tile.x + tile.width - 0.5, tile.y + tile.height - 0.5);
  glBindTexture(GL_TEXTURE_2D, textures.at(view.stream).name);
}

void Renderer::Impl::draw_ranges(const DecodedScene& scene, const SceneGeometry& geometry,
                                 Vec3d eye, const RenderOptions& options) {
  for (const auto& [view, colored, first, count] : geometry.ranges) {
    switch (options.shade) {
      case Shade::texture:
        if (view == kNoView)
          paint(colored ? Paint::vertex_colors : Paint::flat, options.no_view);
        else
          use_view(*find_view(scene, view), eye, options.no_view);
        break;
      case Shade::normals:
        paint(Paint::normals, options.no_view);
        break;
      case Shade::views:
        paint(Paint::headlight, view == kNoView ? options.no_view : color_of(view));
        break;
      case Shade::wireframe:
        paint(Paint::headlight, options.no_view);
        break;
    }
    glDrawElements(GL_TRIANGLES, static_cast<GLsizei>(count), GL_UNSIGNED_INT,
                   reinterpret_cast<const void*>(first * sizeof(GLuint)));
  }
  if (options.shade != Shade::wireframe) return;
  paint(Paint::flat, kEdge);
  glPolygonMode(GL_FRONT_AND_BACK, GL_LINE);
  glDrawElements(GL_TRIANGLES, static_cast<GLsizei>(geometry.indices.size()), GL_UNSIGNED_INT,
                 nullptr);
  glPolygonMode(GL_FRONT_AND_BACK, GL_FILL);
}

Result<ImageRgb> Renderer::Impl::read_back() {
  ImageRgb image(width, height);
  glReadPixels(0, 0, width, height, GL_RGB, GL_UNSIGNED_BYTE, image.data.data());
  if (const GLenum code = glGetError(); code != GL_NO_ERROR)
    return Error{Error::Cause::unsupported,
                 "OpenGL failed with error " + std::to_string(code) +
                     (code == GL_OUT_OF_MEMORY ? " (out of memory)" : "")};
  return image;
}

Result<Renderer> Renderer::create() {
  auto context = EglContext::create();
  if (!context) return context.error();
  auto impl = std::make_unique<Impl>(std::move(*context));
  if (auto ok = impl->set_up(); !ok) return ok.error();
  return Renderer(std::move(impl));
}

Renderer::Renderer(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Renderer::Renderer(Renderer&&) noexcept = default;
Renderer& Renderer::operator=(Renderer&&) noexcept = default;
Renderer::~Renderer() = default;

std::string Renderer::device() const {
  if (!impl_->context.make_current()) return "lost";
  const GLubyte* name = glGetString(GL_RENDERER);
  return name ? reinterpret_cast<const char*>(name) : "unknown";
}

Result<ImageRgb> Renderer::draw(const DecodedScene& scene, const Camera& camera,
                                const Pose& T_world_camera, const RenderOptions& options) {
  if (auto ok = check(camera, T_world_camera); !ok) return ok.error();
  const Vec3d eye = T_world_camera.translation;
  const auto geometry = gather(scene, eye);
  if (!geometry) return geometry.error();
  if (auto ok = impl_->context.make_current(); !ok) return ok.error();
  if (auto ok = impl_->resize(camera.width, camera.height); !ok) return ok.error();
  if (options.shade == Shade::texture)
    if (auto ok = impl_->set_textures(scene, geometry->ranges); !ok) return ok.error();
  impl_->upload(*geometry);

  const auto [r, g, b] = options.background;
  glClearColor(r / 255.0f, g / 255.0f, b / 255.0f, 1);
  glClear(GL_COLOR_BUFFER_BIT | GL_DEPTH_BUFFER_BIT);
  (options.cull_back_faces ? glEnable : glDisable)(GL_CULL_FACE);
  const bool edges = options.shade == Shade::wireframe;  // faces step back behind their edges
  (edges ? glEnable : glDisable)(GL_POLYGON_OFFSET_FILL);
  glPolygonOffset(1, 1);
  impl_->T_clip_eye = clip_from_eye(camera, T_world_camera);
  impl_->draw_ranges(scene, *geometry, eye, options);
  return impl_->read_back();
}

}  // namespace mr::render
