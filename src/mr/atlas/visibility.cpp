#include "mr/atlas/visibility.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "mr/atlas/morphology.h"
#include "mr/atlas/occluders.h"

namespace mr::atlas {
namespace {

constexpr double kLeastDirect = 0.75;  // below it, a neutral colour is better than wrong texture
constexpr float kLeastFacing = 0.1f;   // cosine; at a flatter angle the texture is smeared
constexpr float kFrontOfMargin_m = 0.05f;  // an occluder this much nearer needs a margin around it

/// Erosion: the smallest depth in a window of (2r + 1)²; empty pixels count as infinitely far.
ImageDepth nearest_around(const ImageDepth& depth, int r) {
  constexpr float kFar = std::numeric_limits<float>::infinity();
  const auto nearer = [](float a, float b) { return a < b ? a : b; };
  ImageDepth far_where_empty = depth;
  for (float& d : far_where_empty.data) d = d == 0 ? kFar : d;
  return reduce_neighbourhood(far_where_empty, r, kFar, nearer);
}

/// The 10th percentile of depth: margins must suffice for near occluders.
double near_depth(const ImageDepth& depth) {
  constexpr int kEvery_px = 3;
  std::vector<float> samples;
  for (int y = 0; y < depth.height; y += kEvery_px)
    for (int x = 0; x < depth.width; x += kEvery_px)
      if (const float d = *depth.at(x, y); d > 0) samples.push_back(d);
  if (samples.empty()) return 1;
  const auto tenth = samples.begin() + static_cast<std::ptrdiff_t>(samples.size() / 10);
  std::nth_element(samples.begin(), tenth, samples.end());
  return *tenth;
}

double margin_of(const Camera& camera, double geometry_error_m, double depth_m) {
  const Vec2d density = kit::pixels_per_rad(camera);
  return geometry_error_m * std::max(density.x, density.y) / std::max(depth_m, kit::kNearPlane_m) +
         2;
}

/// The pixel-wise nearer of two depth maps; of `others`, the part from (x0, y0) on is used.
ImageDepth nearer(ImageDepth depth, const ImageDepth* others, int x0, int y0) {
  if (!others) return depth;
  for (int y = 0; y < depth.height; ++y) {
    float* const row = depth.row(y);
    const float* const other = others->at(x0, y0 + y);
    for (int x = 0; x < depth.width; ++x)
      row[x] = other[x] > 0 && (row[x] == 0 || other[x] < row[x]) ? other[x] : row[x];
  }
  return depth;
}

/// A mesh in a pinhole's camera frame, and the columns and rows that each triangle covers.
struct Projected {
  struct Columns {
    int first = 0, last = -1;  ///< empty: outside the picture
    int top = 0, end = 0;      ///< rows
  };

  Projected(const Camera& camera, const Pose& T_world_camera, const Mesh& mesh) {
    const Pose T_camera_world = T_world_camera.inverse();
    std::vector<Vec3d> in_camera;
    for (const Vec3f& p : mesh.positions) in_camera.push_back(T_camera_world * vec_cast<double>(p));
    for (const Triangle& triangle : mesh.triangles) {
      Columns& columns = triangles.emplace_back();
      double left = camera.width, top = camera.height, right = -1, bottom = -1;
      int behind = 0;
      for (const std::uint32_t v : triangle) {
        behind += in_camera[v].z <= kit::kNearPlane_m;
        const kit::ScreenPoint s = kit::to_screen(camera, in_camera[v]);
        left = std::min(left, s.u), right = std::max(right, s.u);
        top = std::min(top, s.v), bottom = std::max(bottom, s.v);
      }
      is_cut |= behind > 0 && behind < 3;
      if (behind > 0) continue;
      columns = {kit::floor_within(left, 0, camera.width),
                 kit::ceil_within(right, -1, camera.width - 1),
                 kit::floor_within(top, 0, camera.height),
                 kit::ceil_within(bottom, -1, camera.height - 1) + 1};
      if (columns.first <= columns.last && columns.top < columns.end)
        for (const std::uint32_t v : triangle) nearest_m = std::min(nearest_m, in_camera[v].z);
    }
  }

  std::vector<Columns> triangles;  ///< [T]
  double nearest_m = std::numeric_limits<double>::infinity();
  bool is_cut = false;  ///< some triangle crosses the near plane
};

/// Vertical strips of a pinhole's picture that cover a mesh with a margin of `around_px` pixels;
/// each triangle lies inside one strip. Upright shapes such as people leave gaps between strips.
std::vector<Rect> strips_in(const Camera& camera, const Projected& mesh, int around_px) {
  struct Rows {
    int top = std::numeric_limits<int>::max(), end = 0;
  };
  std::vector<Rows> columns(static_cast<std::size_t>(camera.width));
  for (const auto& [first, last, top, end] : mesh.triangles)
    for (int x = first; x <= last; ++x)
      columns[x].top = std::min(columns[x].top, top),
      columns[x].end = std::max(columns[x].end, end);
  std::vector<Rect> out;
  for (int x = 0, gap = 0; x < camera.width; ++x) {
    const auto& [top, end] = columns[x];
    if (end <= top) {
      ++gap;
      continue;
    }
    if (out.empty() || gap >= 2 * around_px) out.push_back({x, top, 1, end - top});
    Rect& part = out.back();
    const int below = std::max(part.y + part.height, end);
    part.y = std::min(part.y, top);
    part.width = x + 1 - part.x, part.height = below - part.y;
    gap = 0;
  }
  for (Rect& part : out) {
    const int right = std::min(part.x + part.width + around_px, camera.width),
              below = std::min(part.y + part.height + around_px, camera.height);
    part.x = std::max(part.x - around_px, 0), part.y = std::max(part.y - around_px, 0);
    part.width = right - part.x, part.height = below - part.y;
  }
  return out;
}

/// How far outside the mesh's pixels an occluder may lie whose margin covers a part of the mesh.
int reach_px(const Camera& camera, const Projected& mesh, const ImageDepth& others,
             const LabelConfig& config) {
  constexpr int kMost_px = 64, kEvery_px = 4;
  auto nearest_m = static_cast<float>(mesh.nearest_m);
  for (const Rect& part : strips_in(camera, mesh, kMost_px))
    for (int y = part.y; y < part.y + part.height; y += kEvery_px)
      for (int x = part.x; x < part.x + part.width; x += kEvery_px)
        if (const float d = *others.at(x, y); d > 0) nearest_m = std::min(nearest_m, d);
  const double margin = std::ceil(margin_of(camera, config.geometry_error_m, nearest_m));
  return static_cast<int>(std::min<double>(margin, kMost_px));
}

/// The faces of a pinhole view: strips that cover the mesh, each with its triangles.
std::vector<Face> strip_faces(const Mesh& mesh, const View& view, const ImageDepth& others,
                              const LabelConfig& config) {
  const Camera camera = view.camera();
  const Projected projected(camera, view.T_world_camera, mesh);
  std::vector<Face> out;
  if (projected.is_cut) {
    out.emplace_back(mesh, camera, view.T_world_camera, 0, &others, 0, 0, config);
    return out;
  }
  for (const Rect& part :
       strips_in(camera, projected, reach_px(camera, projected, others, config))) {
    std::vector<std::uint8_t> keep;
    for (const auto& [first, last, top, end] : projected.triangles)
      keep.push_back(first <= last && first >= part.x && first < part.x + part.width);
    Camera cropped = camera;
    cropped.width = part.width, cropped.height = part.height;
    cropped.cx -= part.x, cropped.cy -= part.y;
    out.emplace_back(select_triangles(mesh, keep), cropped, view.T_world_camera, 0, &others, part.x,
                     part.y, config);
  }
  return out;
}

/// The faces of a view, cropped to what the mesh covers.
std::vector<Face> faces_of(const Mesh& mesh, const View& view, const LabelConfig& config) {
  std::vector<Face> out;
  const Camera camera = view.camera();
  const std::vector<ImageDepth>* const others =
      config.occluders ? config.occluders->faces(view) : nullptr;
  if (view.kind == View::Kind::pinhole) {
    if (others) return strip_faces(mesh, view, others->front(), config);
    out.emplace_back(mesh, camera, view.T_world_camera, 0, nullptr, 0, 0, config);
    return out;
  }
  const auto faces = panorama_faces(camera);
  for (std::size_t i = 0; i < faces.size(); ++i)
    out.emplace_back(mesh, faces[i].camera, view.T_world_camera * Pose{faces[i].R_camera_face, {}},
                     faces[i].ring_px, others ? &(*others)[i] : nullptr, 0, 0, config);
  return out;
}

ValidRegion valid_region(const View& view, const LabelConfig& config) {
  const auto found = config.valid.find(view.id);
  return ValidRegion(found == config.valid.end() ? nullptr : &found->second);
}

}  // namespace

double margin_px(const View& view, double geometry_error_m, double depth_m) {
  return margin_of(view.camera(), geometry_error_m, depth_m);
}

Face::Face(const Mesh& mesh, const Camera& camera, const Pose& T_world_face, int ring_px,
           const ImageDepth* others, int x, int y, const LabelConfig& config)
    : camera_(camera),
      T_face_world_(T_world_face.inverse()),
      ring_(ring_px),
      left_(x),
      error_m_(static_cast<float>(config.geometry_error_m + 2 * config.precision.base_m)),
      noise_per_m2_(static_cast<float>(2 * config.precision.per_m2)),
      pixel_(static_cast<float>(1 / camera.fx)),
      depth_(nearer(kit::rasterize_depth(mesh, camera, T_world_face), others, x, y)),
      margin_(static_cast<int>(
          std::ceil(margin_of(camera, config.geometry_error_m, near_depth(depth_))))),
      around_(nearest_around(depth_, margin_)) {}

void Face::count(const std::array<Vec3f, 3>& corners, Count& count) const {
  const std::array<Vec3d, 3> p = {in_face(corners[0]), in_face(corners[1]), in_face(corners[2])};
  kit::scan_polygon(kit::clip_to_screen(camera_, p), camera_.width, ring_, camera_.height - ring_,
                    [&](kit::ScreenSpan s) {
                      const int skipped = std::max(0, ring_ - s.first);
                      s.first += skipped;
                      s.inv_z += static_cast<float>(skipped) * s.inv_z_step;
                      s.last = std::min(s.last, camera_.width - 1 - ring_);
                      add(s, count);
                    });
}

void Face::count(Vec3f point, Count& count) const {
  const Vec3d p = in_face(point);
  if (p.z <= kit::kNearPlane_m) return;
  const kit::ScreenPoint s = kit::to_screen(camera_, p);
  const double most = std::max(camera_.width, camera_.height);
  if (!(std::abs(s.u) <= most && std::abs(s.v) <= most)) return;
  const int x = static_cast<int>(std::lround(s.u)), y = static_cast<int>(std::lround(s.v));
  if (x >= ring_ && y >= ring_ && x < camera_.width - ring_ && y < camera_.height - ring_)
    add({y, x, x, static_cast<float>(s.inv_z), 0}, count);
}

void Face::add(const kit::ScreenSpan& s, Count& count) const {
  const float* const nearest = depth_.row(s.y);
  const float* const around = around_.row(s.y);
  for (int x = s.first; x <= s.last; ++x) {
    const float z = 1 / (s.inv_z + static_cast<float>(x - s.first) * s.inv_z_step);
    // Tolerance: roughness within the geometry error, noise, and slopes of up to 72 degrees do not
    // occlude.
    const float in_front = z - (error_m_ + noise_per_m2_ * (z * z) + 3 * pixel_ * z);
    const float occluder =
        in_front - kFrontOfMargin_m - 3 * pixel_ * z * static_cast<float>(margin_ - 1);
    const int in_sight = nearest[x] >= in_front;
    count.direct += in_sight;
    count.clear += in_sight & (around[x] >= occluder);
  }
  count.pixels += std::max(0, s.last - s.first + 1);
}

ViewVisibility::ViewVisibility(const Mesh& mesh, const View& view, const LabelConfig& config)
    : view_(view),
      camera_(view.camera()),
      T_camera_world_(view.T_world_camera.inverse()),
      valid_(valid_region(view, config)),
      faces_(faces_of(mesh, view, config)) {}

TriangleVisibility ViewVisibility::of_triangle(const Mesh& mesh, std::size_t t,
                                               Vec3f normal_world) const {
  TriangleVisibility visibility;
  const Vec3d sight_line = vec_cast<double>(mesh.centroid(t)) - view_.T_world_camera.translation;
  visibility.facing =
      static_cast<float>(-dot(vec_cast<double>(normal_world), normalized(sight_line)));
  if (visibility.facing < kLeastFacing) return {};
  const std::array<Vec3f, 3> corners = {mesh.corner(t, 0), mesh.corner(t, 1), mesh.corner(t, 2)};
  const Face::Count count = count_pixels(corners, mesh.centroid(t));
  if (count.pixels == 0) return {};
  const ValidRegion::Share valid = valid_share(corners);
  if (valid == ValidRegion::Share::none) return {};
  visibility.touches = count.direct > 0;
  if (valid == ValidRegion::Share::some)
    return visibility;  // after cutting, its inner pieces may use the view
  const bool inside = is_inside(corners);
  // A triangle with a corner outside cannot use the view; after cutting, its inner pieces may. At
  // the seam of a panorama even a triangle too small to cut may use it.
  if (!inside && !is_whole_turn()) return visibility;
  if (inside)
    visibility.visible = static_cast<float>(count.clear) / static_cast<float>(count.pixels);
  if (count.direct > kLeastDirect * count.pixels)
    visibility.direct_px = static_cast<float>(count.direct);
  return visibility;
}

/// In a pinhole view, a triangle lies in the strips that contain its first corner's column.
Face::Count ViewVisibility::count_pixels(const std::array<Vec3f, 3>& corners, Vec3f middle) const {
  const bool are_strips = view_.kind == View::Kind::pinhole && faces_.size() > 1;
  const auto corner = are_strips ? pixel_of(corners[0]) : std::nullopt;
  const auto may_contain = [&](const Face& face) {
    return !corner || face.has_column(std::clamp(corner->x, 0.0, camera_.width - 1.0));
  };
  Face::Count count;
  for (const Face& face : faces_)
    if (may_contain(face)) face.count(corners, count);
  // A triangle that covers no pixel centre: tests the pixel at its centroid.
  for (std::size_t i = 0; i < faces_.size() && count.pixels == 0; ++i)
    if (may_contain(faces_[i])) faces_[i].count(middle, count);
  return count;
}

/// Share of a triangle's pixels that are valid.
ValidRegion::Share ViewVisibility::valid_share(const std::array<Vec3f, 3>& corners) const {
  if (valid_.is_whole()) return ValidRegion::Share::all;
  int valid = 0, invalid = 0;
  if (view_.kind == View::Kind::pinhole) {
    const auto in_camera = [&](int i) { return T_camera_world_ * vec_cast<double>(corners[i]); };
    kit::scan_polygon(kit::clip_to_screen(camera_, {in_camera(0), in_camera(1), in_camera(2)}),
                      camera_.width, 0, camera_.height, [&](const kit::ScreenSpan& s) {
                        valid_.add(s.y, s.first, s.last, valid, invalid);
                      });
  }
  for (const Vec3f& p : valid_samples(corners))
    if (const auto pixel = pixel_of(p)) valid_.add(*pixel, valid, invalid);
  return ValidRegion::share(valid, invalid);
}

/// Sample points of a triangle for the test of validity: its corners; in a panorama, where edges
/// are curves, a grid denser than the blocks.
std::vector<Vec3f> ViewVisibility::valid_samples(const std::array<Vec3f, 3>& corners) const {
  if (view_.kind == View::Kind::pinhole) return {corners.begin(), corners.end()};
  constexpr double kApart_px = 8, kMost = 64;
  double widest_rad = 0;
  const auto direction = [&](int i) {
    return normalized(vec_cast<double>(corners[i]) - view_.T_world_camera.translation);
  };
  for (int i = 0; i < 3; ++i)
    widest_rad = std::max(widest_rad, length(direction(i) - direction((i + 1) % 3)));
  const Vec2d density = kit::pixels_per_rad(camera_);
  const double apart = widest_rad * std::max(density.x, density.y) / kApart_px;
  const int steps = static_cast<int>(std::ceil(std::clamp(apart, 1.0, kMost)));
  std::vector<Vec3f> out;
  for (int i = 0; i <= steps; ++i)
    for (int j = 0; i + j <= steps; ++j)
      out.push_back(corners[0] + ((corners[1] - corners[0]) * static_cast<float>(i) +
                                  (corners[2] - corners[0]) * static_cast<float>(j)) /
                                     static_cast<float>(steps));
  return out;
}

bool ViewVisibility::is_whole_turn() const {
  return view_.kind == View::Kind::equirectangular &&
         view_.image_rect == Rect{0, 0, view_.width, view_.height};
}

/// Projects a point into the view's picture; nothing if it is nearer than the near plane.
std::optional<Vec2d> ViewVisibility::pixel_of(Vec3f p_world) const {
  const Vec3d p = T_camera_world_ * vec_cast<double>(p_world);
  if (view_.kind == View::Kind::equirectangular) return project(camera_, p);
  if (p.z <= kit::kNearPlane_m) return std::nullopt;
  const kit::ScreenPoint s = kit::to_screen(camera_, p);
  return Vec2d{s.u, s.v};
}

/// Whether a triangle lies inside the tile minus its gutter, and not across a panorama's seam.
bool ViewVisibility::is_inside(const std::array<Vec3f, 3>& corners) const {
  double left = std::numeric_limits<double>::max(), right = -left;
  for (const Vec3f& corner : corners) {
    const auto pixel = pixel_of(corner);
    if (!pixel || !inside_tile(*pixel)) return false;
    left = std::min(left, pixel->x), right = std::max(right, pixel->x);
  }
  // Corners more than half a turn apart: the triangle crosses the seam or contains a pole.
  return view_.kind == View::Kind::pinhole || right - left < 0.5 * view_.width;
}

bool ViewVisibility::inside_tile(Vec2d pixel) const {
  const Rect& r = view_.image_rect;
  const double g = view_.gutter_px;
  return pixel.x >= r.x + g && pixel.y >= r.y + g && pixel.x <= r.x + r.width - 1 - g &&
         pixel.y <= r.y + r.height - 1 - g;
}

}  // namespace mr::atlas
