#include "mr/render/renderer.h"

#include <epoxy/gl.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "mr/render/egl_context.h"
#include "mr/render/gl_program.h"
#include "mr/render/panorama.h"
#include "mr/render/scene_buffers.h"
#include "mr/render/targets.h"
#include "mr/render/texture_set.h"

namespace mr::render {
namespace {

using Shade = RenderOptions::Shade;
using Color = std::array<std::uint8_t, 3>;
using Matrix4d = std::array<double, 16>;  // row-major

constexpr double kNear_m = 0.05;
constexpr double kLeastPointRadius_px = 0.7072;  // covers a pixel's centre wherever it lies
constexpr Color kEdge{24, 24, 24};

Error invalid_camera(std::string message) { return {Error::Cause::invalid, std::move(message)}; }

Status check(const Camera& c, const Pose& T_world_camera) {
  const bool pinhole = c.model == CameraModel::pinhole;
  if (!pinhole && c.model != CameraModel::equirectangular)
    return invalid_camera("rendering needs a pinhole or an equirectangular camera");
  if (pinhole && c.distortion != DistortionModel::none)
    return invalid_camera("rendering needs a pinhole camera without distortion");
  if (c.width < 1 || c.height < 1)
    return invalid_camera("rendering needs a picture of at least one pixel");
  for (const double v : T_world_camera.matrix())
    if (!std::isfinite(v))
      return invalid_camera("render camera's pose holds a number that is not finite");
  if (!pinhole) return {};
  for (const double v : {c.fx, c.fy, c.cx, c.cy})
    if (!std::isfinite(v)) return invalid_camera("render camera holds a number that is not finite");
  if (c.fx <= 0 || c.fy <= 0) return invalid_camera("render camera needs positive focal lengths");
  return {};
}

/// From metres-from-the-eye to clip space: pixel (u, v) is window position (u + 0.5, v + 0.5), so
/// row 0 is read back first; the far plane is at infinity.
Matrix4d clip_from_eye(const Camera& c, const Mat3& R_world_camera) {
  const Mat3& R = R_world_camera;
  const Vec3d x = R.column(0), y = R.column(1), z = R.column(2);
  const Vec3d right = (x * c.fx + z * (c.cx + 0.5)) * (2.0 / c.width) - z;
  const Vec3d down = (y * c.fy + z * (c.cy + 0.5)) * (2.0 / c.height) - z;
  Matrix4d out{};
  int row = 0;
  for (const Vec3d v : {right, down, z, z}) {
    for (int i = 0; i < 3; ++i) out[row * 4 + i] = v[i];
    ++row;
  }
  out[11] = -2 * kNear_m;
  return out;
}

/// Applies the view's intrinsics, then `scale` and `offset`, to rows 0 and 1 of a matrix to camera
/// space: the result gives picture coordinates times depth.
Matrix4d picture_from_camera(const View& view, Vec2d scale, Vec2d offset, const Matrix4d& m) {
  Matrix4d out = m;
  for (int i = 0; i < 4; ++i) {
    out[i] = view.fx * scale.x * m[i] + (view.cx * scale.x + offset.x) * m[8 + i];
    out[4 + i] = view.fy * scale.y * m[4 + i] + (view.cy * scale.y + offset.y) * m[8 + i];
  }
  return out;
}

/// A colour that differs from those of the neighbouring ids: hues in golden-ratio steps.
Color color_of(ViewId view) {
  const double hue = std::fmod(number_of(view) * 0.6180339887498949 + 0.02, 1.0) * 6;
  Color out{};
  for (int i = 0; i < 3; ++i) {
    const double away = std::abs(std::fmod(hue + (i == 0 ? 3 : i == 1 ? 1 : 5), 6.0) - 3) - 1;
    out[i] = static_cast<std::uint8_t>(std::lround(255 * (0.25 + 0.7 * std::clamp(away, 0., 1.))));
  }
  return out;
}

/// What a camera may see, as planes through the eye; a pixel more on each side.
struct Frustum {
  struct Plane {
    Vec3d inward;
    double least = 0;
  };
  std::array<Plane, 5> planes;

  Frustum(const Matrix4d& T_clip_eye, int width, int height) {
    const auto row = [&](int r) {
      return Vec3d{T_clip_eye[4 * r], T_clip_eye[4 * r + 1], T_clip_eye[4 * r + 2]};
    };
    const Vec3d across = row(3) * (1 + 2.0 / width), along = row(3) * (1 + 2.0 / height);
    planes = {{{across + row(0)}, {across - row(0)}, {along + row(1)}, {along - row(1)}, {row(3)}}};
    planes[4].least = kNear_m;
  }

  /// Whether a box whose middle lies at `middle` from the eye may be seen.
  bool sees(Vec3d middle, Vec3d half) const {
    return std::all_of(planes.begin(), planes.end(), [&](const Plane& plane) {
      const Vec3d n = plane.inward, size{std::abs(n.x), std::abs(n.y), std::abs(n.z)};
      return dot(n, middle) + dot(size, half) >= plane.least;
    });
  }
};

/// Which chunks of a scene a camera at `eye` (from the scene's origin) may see.
std::vector<std::uint8_t> visible_chunks(const SceneGeometry& geometry, const Frustum& frustum,
                                         Vec3d eye) {
  std::vector<double> grow_m(geometry.boxes.size(), 0.0);  // points stand out of their box
  for (const ViewRange& range : geometry.ranges)
    for (std::size_t i = range.first_part; i < range.first_part + range.parts; ++i)
      grow_m[geometry.parts[i].chunk] = 0.5 * range.point_m;
  std::vector<std::uint8_t> out(geometry.boxes.size());
  for (std::size_t i = 0; i < out.size(); ++i) {
    const Vec3d low = vec_cast<double>(geometry.boxes[i].low);
    const Vec3d high = vec_cast<double>(geometry.boxes[i].high);
    const Vec3d grow{grow_m[i], grow_m[i], grow_m[i]};
    out[i] = frustum.sees((low + high) * 0.5 - eye, (high - low) * 0.5 + grow);
  }
  return out;
}

/// A list for glMultiDrawElements: the parts of a range that may be seen, neighbours joined.
struct DrawList {
  std::vector<GLsizei> counts;
  std::vector<const void*> offsets;

  DrawList(const SceneGeometry& geometry, const ViewRange& range,
           const std::vector<std::uint8_t>& visible) {
    std::size_t end = 0;
    for (std::size_t i = range.first_part; i < range.first_part + range.parts; ++i) {
      const ScenePart& part = geometry.parts[i];
      if (!visible[part.chunk]) continue;
      if (counts.empty() || part.first_index != end) {
        counts.push_back(0);
        offsets.push_back(reinterpret_cast<const void*>(part.first_index * sizeof(GLuint)));
      }
      counts.back() += static_cast<GLsizei>(part.indices);
      end = part.first_index + part.indices;
    }
  }

  void draw() const {
    if (!counts.empty())
      glMultiDrawElements(GL_TRIANGLES, counts.data(), GL_UNSIGNED_INT, offsets.data(),
                          static_cast<GLsizei>(counts.size()));
  }
};

Vec3d in_floats(Vec3d v) { return vec_cast<double>(vec_cast<float>(v)); }

}  // namespace

struct Renderer::Impl {
  EglContext context;                                           // its end frees everything below
  std::array<std::array<GLuint, 2>, kShadingModes> programs{};  // of triangles, of points
  GLuint panorama_program = 0, program = 0;
  SceneBuffers buffers;
  TextureSet textures;
  PictureTarget picture;
  FacesTarget faces;
  bool has_depth = false;  ///< the depth buffer is that of the last picture

  /// Of the picture, or the face, that is being drawn.
  struct CameraState {
    Vec3d world;        ///< metres
    Vec3d from_origin;  ///< of the scene's geometry
    Matrix4d T_clip_eye{};
    double least_radius = 0;  ///< of points, per metre of distance
  } eye;

  explicit Impl(EglContext c) : context(std::move(c)) {}

  Status set_up();
  Status draw(const DecodedScene& scene, const Camera& camera, const Pose& T_world_camera,
              const RenderOptions& options);
  Status draw_equirectangular(const DecodedScene& scene, const Camera& camera,
                              const Pose& T_world_camera, const RenderOptions& options);
  void draw_pinhole(const DecodedScene& scene, const Camera& camera, const Pose& T_world_camera,
                    const RenderOptions& options);
  void draw_range(const DecodedScene& scene, const ViewRange& range, const DrawList& list,
                  const RenderOptions& options);
  void draw_edges(const std::vector<std::uint8_t>& visible);
  void use_view_of(const DecodedScene& scene, const ViewRange& range, Color otherwise);
  void use_view(const View& view, bool has_alpha, Color otherwise);
  void paint(ShadingMode how, Color c, float point_m = 0);

  GLint at(const char* uniform) const { return glGetUniformLocation(program, uniform); }
  void set(const char* uniform, Vec2d v) {
    glUniform2f(at(uniform), static_cast<float>(v.x), static_cast<float>(v.y));
  }
  void set(const char* uniform, Vec3d v) {
    glUniform3f(at(uniform), static_cast<float>(v.x), static_cast<float>(v.y),
                static_cast<float>(v.z));
  }
  void set(const char* uniform, double v) { glUniform1f(at(uniform), static_cast<float>(v)); }
  void set(const char* uniform, const Matrix4d& m) {
    std::array<float, 16> out{};
    std::transform(m.begin(), m.end(), out.begin(), [](double v) { return static_cast<float>(v); });
    glUniformMatrix4fv(at(uniform), 1, GL_TRUE, out.data());
  }
};

Status Renderer::Impl::set_up() {
  for (int i = 0; i < kShadingModes; ++i)
    for (const bool points : {false, true}) {
      auto made = make_scene_program(static_cast<ShadingMode>(i), points);
      if (!made) return made.error();
      programs[i][points] = *made;
    }
  auto made = make_panorama_program();
  if (!made) return made.error();
  panorama_program = *made;
  buffers.set_up();
  glPixelStorei(GL_PACK_ALIGNMENT, 1);
  glPixelStorei(GL_UNPACK_ALIGNMENT, 1);
  glEnable(GL_DEPTH_TEST);
  glDisable(GL_DITHER);
  glFrontFace(GL_CW);  // rows go down in the window, which mirrors every triangle
  glCullFace(GL_BACK);
  return {};
}

/// Points of a diameter over 0, else triangles.
void Renderer::Impl::paint(ShadingMode how, Color c, float point_m) {
  program = programs[static_cast<int>(how)][point_m > 0];
  glUseProgram(program);
  const Vec3d place = in_floats(eye.from_origin);
  set("eye", place);
  set("eye_rest", eye.from_origin - place);
  set("T_clip_eye", eye.T_clip_eye);
  set("color", Vec3d{c[0] / 255.0, c[1] / 255.0, c[2] / 255.0});
  if (point_m <= 0) return;
  glUniform1i(at("first_point"), static_cast<GLint>(buffers.geometry().first_point));
  set("radius_m", 0.5 * point_m);
  set("least_radius", eye.least_radius);
}

/// Paints by projection into a view, as atlas_uv() in core/view.h maps it; `otherwise`: the colour
/// of what lies behind its camera.
void Renderer::Impl::use_view(const View& view, bool has_alpha, Color otherwise) {
  const bool pinhole = view.kind == View::Kind::pinhole;
  paint(!pinhole    ? ShadingMode::equirectangular
        : has_alpha ? ShadingMode::pinhole_alpha
                    : ShadingMode::pinhole,
        otherwise);
  const auto [width, height] = textures.bind(view.stream);
  const Rect &tile = view.atlas_rect, &source = view.image_rect;
  const Vec2d scale{static_cast<double>(tile.width) / source.width / width,
                    static_cast<double>(tile.height) / source.height / height};
  const Vec2d offset{(0.5 - source.x) * scale.x + static_cast<double>(tile.x) / width,
                     (0.5 - source.y) * scale.y + static_cast<double>(tile.y) / height};
  const auto in_view = (view.T_world_camera.inverse() * Pose{{}, eye.world}).matrix();
  set("T_view_eye", pinhole ? picture_from_camera(view, scale, offset, in_view) : in_view);
  set("tile_low", Vec2d{(tile.x + 0.5) / width, (tile.y + 0.5) / height});
  set("tile_high",
      Vec2d{(tile.x + tile.width - 0.5) / width, (tile.y + tile.height - 0.5) / height});
  set("gain", vec_cast<double>(view.gain));
  if (pinhole) return;
  set("view_size", Vec2d{view.width + 0.0, view.height + 0.0});
  set("tile_middle", source.x + 0.5 * source.width - 0.5);
  set("scale", scale);
  set("offset", offset);
  set("far_side", source.width == view.width ? width : 0.0);
}

/// Prepares to draw a range with its view's picture. Alpha is of what moves.
void Renderer::Impl::use_view_of(const DecodedScene& scene, const ViewRange& range,
                                 Color otherwise) {
  const View& view = *texturing_view(scene.views, range.view, range.layer);
  use_view(view, range.layer == Layer::moving && scene.alpha.contains(view.stream), otherwise);
}

void Renderer::Impl::draw_range(const DecodedScene& scene, const ViewRange& range,
                                const DrawList& list, const RenderOptions& options) {
  const Color plain = options.no_view;
  switch (options.shade) {
    case Shade::texture:
      if (range.view == kNoView)
        paint(range.colored ? ShadingMode::vertex_colors : ShadingMode::flat, plain, range.point_m);
      else
        use_view_of(scene, range, plain);
      break;
    case Shade::normals:
      paint(ShadingMode::normals, plain, range.point_m);
      break;
    case Shade::views:
      paint(ShadingMode::headlight, range.view == kNoView ? plain : color_of(range.view),
            range.point_m);
      break;
    case Shade::wireframe:
      paint(ShadingMode::headlight, plain, range.point_m);
      break;
  }
  list.draw();
}

void Renderer::Impl::draw_edges(const std::vector<std::uint8_t>& visible) {
  paint(ShadingMode::flat, kEdge);
  glPolygonMode(GL_FRONT_AND_BACK, GL_LINE);
  for (const ViewRange& range : buffers.geometry().ranges)
    if (range.point_m <= 0) DrawList(buffers.geometry(), range, visible).draw();
  glPolygonMode(GL_FRONT_AND_BACK, GL_FILL);
}

/// Into the target in use.
void Renderer::Impl::draw_pinhole(const DecodedScene& scene, const Camera& camera,
                                  const Pose& T_world_camera, const RenderOptions& options) {
  const SceneGeometry& geometry = buffers.geometry();
  eye.world = T_world_camera.translation;
  eye.from_origin = eye.world - geometry.origin;
  eye.T_clip_eye = clip_from_eye(camera, T_world_camera.rotation);
  eye.least_radius = kLeastPointRadius_px / std::min(camera.fx, camera.fy);
  const auto [r, g, b] = options.background;
  glClearColor(r / 255.0f, g / 255.0f, b / 255.0f, 0);  // alpha: where a surface is
  glClear(GL_COLOR_BUFFER_BIT | GL_DEPTH_BUFFER_BIT);
  (options.cull_back_faces ? glEnable : glDisable)(GL_CULL_FACE);
  const bool edges = options.shade == Shade::wireframe;  // faces step back behind their edges
  (edges ? glEnable : glDisable)(GL_POLYGON_OFFSET_FILL);
  glPolygonOffset(1, 1);
  const Frustum frustum(eye.T_clip_eye, camera.width, camera.height);
  const auto visible = visible_chunks(geometry, frustum, eye.from_origin);
  for (const ViewRange& range : geometry.ranges)
    draw_range(scene, range, DrawList(geometry, range, visible), options);
  if (edges) draw_edges(visible);
}

Status Renderer::Impl::draw_equirectangular(const DecodedScene& scene, const Camera& camera,
                                            const Pose& T_world_camera,
                                            const RenderOptions& options) {
  const PanoramaFaces six = panorama_faces(camera);
  if (auto ok = faces.resize(six.camera.width); !ok) return ok;
  for (int i = 0; i < FacesTarget::kFaces; ++i) {
    faces.use(i);
    draw_pinhole(scene, six.camera, T_world_camera * Pose{six.R_camera_face[i], {}}, options);
  }
  if (auto ok = picture.use(camera.width, camera.height); !ok) return ok;
  draw_panorama(panorama_program, camera, six, faces);
  return {};
}

Status Renderer::Impl::draw(const DecodedScene& scene, const Camera& camera,
                            const Pose& T_world_camera, const RenderOptions& options) {
  if (auto ok = buffers.keep(scene); !ok) return ok;
  if (auto ok = picture.use(camera.width, camera.height); !ok) return ok;
  if (options.shade == Shade::texture)
    if (auto ok = textures.keep(scene, buffers.geometry().ranges); !ok) return ok;
  if (camera.model == CameraModel::equirectangular)
    return draw_equirectangular(scene, camera, T_world_camera, options);
  draw_pinhole(scene, camera, T_world_camera, options);
  return {};
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
  if (auto ok = impl_->context.make_current(); !ok) return ok.error();
  impl_->has_depth = false;
  if (auto ok = impl_->draw(scene, camera, T_world_camera, options); !ok) return ok.error();
  impl_->has_depth = camera.model == CameraModel::pinhole;
  return impl_->picture.read_back();
}

ImageMask Renderer::covered() const { return impl_->picture.covered(); }

Result<ImageDepth> Renderer::depth() const {
  if (!impl_->has_depth)
    return Error{Error::Cause::unsupported, "the last picture was not of a pinhole camera"};
  if (auto ok = impl_->context.make_current(); !ok) return ok.error();
  auto depth = impl_->picture.read_depth();
  if (!depth) return depth.error();
  for (float& v : depth->data) v = v < 1 ? static_cast<float>(kNear_m / (1.0 - double{v})) : 0.0f;
  return depth;
}

}  // namespace mr::render
