#include "mr/atlas/visibility.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <span>

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

/// `at_least_px`: how far a silhouette may be off apart from that.
double margin_of(const Camera& camera, double geometry_error_m, double depth_m,
                 double at_least_px = 2) {
  const Vec2d density = kit::pixels_per_rad(camera);
  return geometry_error_m * std::max(density.x, density.y) / std::max(depth_m, kit::kNearPlane_m) +
         at_least_px;
}

/// The logarithm to base 2 of a positive number, within 0.01; the same on every machine.
float approximate_log2(float v) {
  const auto bits = std::bit_cast<std::uint32_t>(v);
  const float exponent = static_cast<float>(static_cast<int>(bits >> 23) - 127);
  const float mantissa = std::bit_cast<float>((bits & 0x7FFFFFu) | 0x3F800000u);
  return exponent + (2 - mantissa / 3) * mantissa - 5.0f / 3;
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

/// The columns and rows of a pinhole's picture that each triangle covers.
struct Coverage {
  struct Columns {
    int first = 0, last = -1;  ///< empty: outside the picture
    int top = 0, end = 0;      ///< rows
  };

  Coverage(const Camera& camera, const kit::Projection& projection, const Mesh& mesh,
           std::span<const std::uint32_t> wanted) {
    triangles.reserve(wanted.size());
    for (const std::uint32_t t : wanted) {
      Columns& columns = triangles.emplace_back();
      double left = camera.width, top = camera.height, right = -1, bottom = -1;
      int behind = 0;
      for (const std::uint32_t v : mesh.triangles[t]) {
        behind += projection.in_camera[v].z <= kit::kNearPlane_m;
        const kit::ScreenPoint& s = projection.on_screen[v];
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
        for (const std::uint32_t v : mesh.triangles[t])
          nearest_m = std::min(nearest_m, projection.in_camera[v].z);
    }
  }

  std::vector<Columns> triangles;  ///< of the wanted ones
  double nearest_m = std::numeric_limits<double>::infinity();
  bool is_cut = false;  ///< some triangle crosses the near plane
};

/// Vertical strips of a pinhole's picture that cover a mesh with a margin of `around_px` pixels;
/// each triangle lies inside one strip. Upright shapes such as people leave gaps between strips.
std::vector<Rect> strips_in(const Camera& camera, const Coverage& mesh, int around_px) {
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
int reach_px(const Camera& camera, const Coverage& mesh, const ImageDepth& others,
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

ValidRegion valid_region(const View& view, const LabelConfig& config) {
  const auto found = config.valid.find(view.id);
  return ValidRegion(found == config.valid.end() ? nullptr : &found->second);
}

const Alpha* alpha_of(const View& view, const LabelConfig& config) {
  const auto found = config.alpha.find(view.stream);
  return found == config.alpha.end() ? nullptr : found->second.get();
}

}  // namespace

double margin_px(const View& view, double geometry_error_m, double depth_m) {
  return margin_of(view.camera(), geometry_error_m, depth_m);
}

float quality_cost(const ViewQuality& quality) {
  constexpr float kPerHalving = 0.25f;  // of the resolution on a surface; twice that along a line
  constexpr float kMost = 0.5f, kBorder = 0.04f, kDepthEdge_px = 16, kCut = 4;
  const auto within = [](float distance, float reach) {
    const float nearness = std::max(0.0f, 1 - distance / reach);
    return kMost * nearness * nearness;
  };
  const float flatness = 1 - std::clamp(quality.facing, 0.0f, 1.0f);
  return -kPerHalving * approximate_log2(std::max(quality.pixels_per_m2, 1e-6f)) +
         kMost * flatness * flatness + within(quality.border, kBorder) +
         within(quality.depth_edge_px, kDepthEdge_px) + kCut * quality.cut;
}

namespace {

ImageDepth depth_of(const Mesh& mesh, std::span<const std::uint32_t> triangles,
                    const Camera& camera, const kit::Projection& projection,
                    const Face::Place& place) {
  kit::DepthPart part{place.part.x, place.part.y, ImageDepth(place.part.width, place.part.height)};
  kit::rasterize_part(mesh, camera, projection, triangles, part);
  return nearer(std::move(part.depth), place.others, part.x, part.y);
}

/// Two pixels of the view's picture.
double least_margin_px(const Camera& camera, const Camera& depth_camera) {
  return 2 * depth_camera.fx / camera.fx;
}

}  // namespace

Face::Face(const Mesh& mesh, std::span<const std::uint32_t> triangles, const Camera& camera,
           const kit::Projection& projection, const Place& place, const LabelConfig& config)
    : camera_(camera),
      part_(place.part),
      ring_(place.ring_px),
      error_m_(static_cast<float>(config.geometry_error_m + 2 * config.precision.base_m)),
      noise_per_m2_(static_cast<float>(2 * config.precision.per_m2)),
      pixel_(static_cast<float>(1 / camera.fx)),
      depth_(depth_of(mesh, triangles, camera, projection, place)),
      margin_(static_cast<int>(std::ceil(
          margin_of(camera, config.geometry_error_m, near_depth(depth_), place.least_margin_px)))),
      around_(nearest_around(depth_, margin_)),
      edges_(depth_, pixel_) {}

void Face::count(const kit::ScreenPolygon& p, Count& count) const {
  constexpr double kSmall_px = 6;
  if (p.count == 3 && ring_ == 0) {
    const auto [left, right] = std::minmax({p.points[0].u, p.points[1].u, p.points[2].u});
    const auto [top, bottom] = std::minmax({p.points[0].v, p.points[1].v, p.points[2].v});
    if (right - left < kSmall_px && bottom - top < kSmall_px) return add_samples(p, count);
  }
  const int left = part_.x + ring_, right = part_.x + part_.width - ring_;
  kit::scan_polygon(p, right, part_.y + ring_, part_.y + part_.height - ring_,
                    [&](kit::ScreenSpan s) {
                      const int skipped = std::max(0, left - s.first);
                      s.first += skipped;
                      s.inv_z += static_cast<float>(skipped) * s.inv_z_step;
                      add(s, count);
                    });
}

/// At points inside the triangle, towards each corner and in the middle.
void Face::add_samples(const kit::ScreenPolygon& p, Count& count) const {
  const kit::ScreenPoint &a = p.points[0], &b = p.points[1], &c = p.points[2];
  const kit::ScreenPoint third{(a.u + b.u + c.u) / 3, (a.v + b.v + c.v) / 3,
                               (a.inv_z + b.inv_z + c.inv_z) / 3};
  this->count(third, count);
  for (const kit::ScreenPoint& corner : {a, b, c})
    this->count(kit::ScreenPoint{0.5 * (third.u + corner.u), 0.5 * (third.v + corner.v),
                                 0.5 * (third.inv_z + corner.inv_z)},
                count);
}

void Face::count(const kit::ScreenPoint& point, Count& count) const {
  const double left = part_.x + ring_ - 0.5, top = part_.y + ring_ - 0.5;
  if (!(point.u >= left && point.v >= top && point.u < left + part_.width - 2 * ring_ &&
        point.v < top + part_.height - 2 * ring_))
    return;
  const int x = static_cast<int>(point.u + 0.5) - part_.x,
            y = static_cast<int>(point.v + 0.5) - part_.y;
  // The farthest of the four pixels around the point: beside a silhouette, half a pixel is no
  // occluder.
  const int x0 = std::max(static_cast<int>(point.u) - part_.x, 0),
            y0 = std::max(static_cast<int>(point.v) - part_.y, 0);
  const int x1 = std::min(x0 + 1, part_.width - 1), y1 = std::min(y0 + 1, part_.height - 1);
  const float *const upper = depth_.row(y0), *const lower = depth_.row(y1);
  const float nearest = std::max({upper[x0], upper[x1], lower[x0], lower[x1]});
  add(nearest, *around_.at(x, y), 1 / static_cast<float>(point.inv_z), count);
  ++count.pixels;
}

/// Adds a pixel: the nearest depth there and around it, and the depth of the surface.
void Face::add(float nearest, float around, float z, Count& count) const {
  // Tolerance: roughness within the geometry error, noise, and slopes of up to 72 degrees do not
  // occlude.
  const float in_front = z - (error_m_ + noise_per_m2_ * (z * z) + 3 * pixel_ * z);
  const float occluder =
      in_front - kFrontOfMargin_m - 3 * pixel_ * z * static_cast<float>(margin_ - 1);
  const int in_sight = nearest >= in_front;
  count.direct += in_sight;
  count.near += nearest >= in_front - kFrontOfMargin_m;
  count.clear += in_sight & (around >= occluder);
}

void Face::add(const kit::ScreenSpan& s, Count& count) const {
  const float* const nearest = depth_.row(s.y - part_.y);
  const float* const around = around_.row(s.y - part_.y);
  for (int x = s.first; x <= s.last; ++x)
    add(nearest[x - part_.x], around[x - part_.x],
        1 / (s.inv_z + static_cast<float>(x - s.first) * s.inv_z_step), count);
  count.pixels += std::max(0, s.last - s.first + 1);
}

ValidRegion::ValidRegion(const TileMask* mask) : mask_(mask) {
  if (!mask) return;
  const std::size_t stride = static_cast<std::size_t>(mask->columns) + 1;
  valid_sums_.resize(stride * (static_cast<std::size_t>(mask->rows) + 1));
  for (int row = 0; row < mask->rows; ++row)
    for (int column = 0; column < mask->columns; ++column) {
      const std::size_t at = static_cast<std::size_t>(row) * stride + column;
      valid_sums_[at + stride + 1] = valid_sums_[at + 1] + valid_sums_[at + stride] -
                                     valid_sums_[at] + (mask->at(column, row) ? 1 : 0);
    }
}

ValidRegion::Share ValidRegion::share_in(Vec2d least, Vec2d most) const {
  const auto tile = [&](double px, int count) {
    return kit::floor_within(std::round(px) / mask_->tile_px, -1, count);
  };
  const int x0 = tile(least.x, mask_->columns), x1 = tile(most.x, mask_->columns);
  const int y0 = tile(least.y, mask_->rows), y1 = tile(most.y, mask_->rows);
  const auto above = [&](int column, int row) {
    column = std::clamp(column, 0, mask_->columns), row = std::clamp(row, 0, mask_->rows);
    return valid_sums_[static_cast<std::size_t>(row) * (mask_->columns + 1) + column];
  };
  const std::uint32_t valid =
      above(x1 + 1, y1 + 1) - above(x0, y1 + 1) - above(x1 + 1, y0) + above(x0, y0);
  const auto all = static_cast<std::uint32_t>((x1 - x0 + 1) * (y1 - y0 + 1));
  return valid == 0 ? Share::none : valid < all ? Share::some : Share::all;
}

ViewVisibility::ViewVisibility(const Mesh& mesh, std::span<const std::uint32_t> triangles,
                               const View& view, const LabelConfig& config)
    : view_(view),
      camera_(view.camera()),
      depth_camera_(is_pinhole() ? depth_camera(camera_) : camera_),
      eye_(vec_cast<float>(view.T_world_camera.translation)),
      T_camera_world_(view.T_world_camera.inverse()),
      valid_(valid_region(view, config)),
      alpha_(alpha_of(view, config)) {
  if (is_pinhole())
    add_picture(mesh, triangles, config);
  else
    add_cube_faces(mesh, triangles, config);
}

/// The face of a pinhole's picture, or strips of it where another surface is there as well.
void ViewVisibility::add_picture(const Mesh& mesh, std::span<const std::uint32_t> triangles,
                                 const LabelConfig& config) {
  projection_ = kit::Projection(mesh, depth_camera_, view_.T_world_camera);
  const std::vector<ImageDepth>* const others =
      config.occluders ? config.occluders->faces(view_) : nullptr;
  Face::Place place;
  place.part = {0, 0, depth_camera_.width, depth_camera_.height};
  place.others = others ? &others->front() : nullptr;
  place.least_margin_px = least_margin_px(camera_, depth_camera_);
  if (others)
    add_strips(mesh, triangles, place, config);
  else
    faces_.emplace_back(mesh, triangles, depth_camera_, projection_, place, config);
}

/// Strips that cover the triangles.
void ViewVisibility::add_strips(const Mesh& mesh, std::span<const std::uint32_t> triangles,
                                Face::Place place, const LabelConfig& config) {
  const Coverage coverage(depth_camera_, projection_, mesh, triangles);
  if (coverage.is_cut) {
    faces_.emplace_back(mesh, triangles, depth_camera_, projection_, place, config);
    return;
  }
  const int reach = reach_px(depth_camera_, coverage, *place.others, config);
  for (const Rect& part : strips_in(depth_camera_, coverage, reach)) {
    std::vector<std::uint32_t> inside;
    for (std::size_t i = 0; i < triangles.size(); ++i) {
      const auto& [first, last, top, end] = coverage.triangles[i];
      if (first <= last && first >= part.x && first < part.x + part.width)
        inside.push_back(triangles[i]);
    }
    place.part = part;
    faces_.emplace_back(mesh, inside, depth_camera_, projection_, place, config);
  }
}

void ViewVisibility::add_cube_faces(const Mesh& mesh, std::span<const std::uint32_t> triangles,
                                    const LabelConfig& config) {
  const std::vector<ImageDepth>* const others =
      config.occluders ? config.occluders->faces(view_) : nullptr;
  const auto cube = panorama_faces(camera_);
  for (std::size_t i = 0; i < cube.size(); ++i) {
    const Camera& camera = cube[i].camera;
    const Pose T_world_face = view_.T_world_camera * Pose{cube[i].R_camera_face, {}};
    T_face_world_.push_back(T_world_face.inverse());
    faces_.emplace_back(mesh, triangles, camera, kit::Projection(mesh, camera, T_world_face),
                        Face::Place{.part = {0, 0, camera.width, camera.height},
                                    .ring_px = cube[i].ring_px,
                                    .others = others ? &(*others)[i] : nullptr},
                        config);
  }
}

/// A triangle in the picture of depth_camera_, clipped at the near plane.
kit::ScreenPolygon ViewVisibility::polygon(const Mesh& mesh, std::size_t t) const {
  const Triangle& triangle = mesh.triangles[t];
  const std::size_t known = projection_.on_screen.size();
  if (triangle[0] < known && triangle[1] < known && triangle[2] < known)
    return projection_.polygon(depth_camera_, triangle);
  const auto in_camera = [&](int i) {
    return T_camera_world_ * vec_cast<double>(mesh.corner(t, i));
  };
  return kit::clip_to_screen(depth_camera_, {in_camera(0), in_camera(1), in_camera(2)});
}

kit::ScreenPolygon ViewVisibility::in_face(std::size_t face, const Corners& corners) const {
  const auto at = [&](int i) { return T_face_world_[face] * vec_cast<double>(corners[i]); };
  return kit::clip_to_screen(faces_[face].camera(), {at(0), at(1), at(2)});
}

TriangleVisibility ViewVisibility::of_triangle(const Mesh& mesh, std::size_t t,
                                               Vec3f normal_world) const {
  const Vec3f middle = mesh.centroid(t), to_eye = eye_ - middle;
  TriangleVisibility visibility;
  const float toward = dot(normal_world, to_eye);
  if (!(toward > 0)) return {};
  visibility.facing = toward / std::sqrt(dot(to_eye, to_eye) * dot(normal_world, normal_world));
  if (!(visibility.facing >= kLeastFacing)) return {};
  if (is_outside(mesh.triangles[t])) return {};
  const Corners corners = {mesh.corner(t, 0), mesh.corner(t, 1), mesh.corner(t, 2)};
  const kit::ScreenPolygon outline = is_pinhole() ? polygon(mesh, t) : kit::ScreenPolygon{};
  float edge_px = DepthEdges::kFar_px;
  const Face::Count count =
      is_pinhole() ? count_in_picture(outline, edge_px) : count_in_cube(corners, edge_px);
  if (count.pixels == 0) return {};
  const ValidRegion::Share valid = valid_share(corners);
  if (valid == ValidRegion::Share::none) return {};
  visibility.touches = count.direct > 0;
  if (valid == ValidRegion::Share::some)
    return visibility;  // after cutting, its inner pieces may use the view
  const bool inside = is_pinhole() ? is_inside(outline) : is_inside(corners);
  // A triangle with a corner outside cannot use the view; after cutting, its inner pieces may. At
  // the seam of a panorama even a triangle too small to cut may use it.
  if (!inside && !is_whole_turn()) return visibility;
  if (inside)
    visibility.visible = static_cast<float>(count.clear) / static_cast<float>(count.pixels);
  if (count.direct >= kLeastDirect * count.pixels)
    visibility.direct_px = static_cast<float>(count.direct);
  if (count.near >= kLeastDirect * count.pixels)
    visibility.near_px = static_cast<float>(count.near);
  if (visibility.visible > 0 || visibility.near_px > 0)
    visibility.cost = cost(outline, middle,
                           {.facing = visibility.facing,
                            .border = 1,
                            .depth_edge_px = edge_px,
                            .cut = cut_share(corners, middle)});
  return visibility;
}

/// Whether a triangle of a pinhole's mesh lies beside the picture or nearer than the near plane;
/// false where that is not known.
bool ViewVisibility::is_outside(const Triangle& triangle) const {
  int left = 0, right = 0, above = 0, below = 0, near = 0;
  for (const std::uint32_t v : triangle) {
    if (v >= projection_.on_screen.size()) return false;
    const kit::ScreenPoint& s = projection_.on_screen[v];
    const bool is_near = projection_.in_camera[v].z < kit::kNearPlane_m;
    near += is_near;
    if (is_near) continue;
    left += s.u<-0.5, right += s.u> depth_camera_.width - 0.5;
    above += s.v<-0.5, below += s.v> depth_camera_.height - 0.5;
  }
  return left == 3 || right == 3 || above == 3 || below == 3 || near == 3;
}

/// How badly the view shows a triangle; `outline`: in a pinhole's picture.
float ViewVisibility::cost(const kit::ScreenPolygon& outline, Vec3f middle,
                           ViewQuality quality) const {
  const Vec3f sight_line = middle - eye_;
  const float distance2 = dot(sight_line, sight_line);
  const auto per_rad2 =
      static_cast<float>(kit::pixels_per_rad(camera_).x * kit::pixels_per_rad(camera_).y);
  quality.pixels_per_m2 = per_rad2 * quality.facing / distance2;
  if (!is_pinhole()) return quality_cost(quality);
  const kit::ScreenPoint& p = outline.points[0];
  const auto inv_z = static_cast<float>(p.inv_z);
  quality.pixels_per_m2 = per_rad2 * quality.facing * std::sqrt(distance2) * inv_z * inv_z * inv_z;
  const double scale = camera_.fx / depth_camera_.fx;
  const Rect& r = view_.image_rect;
  const double u = (p.u + 0.5) * scale - 0.5 - r.x, v = (p.v + 0.5) * scale - 0.5 - r.y;
  const double inner = std::min({u, v, r.width - 1 - u, r.height - 1 - v}) - view_.gutter_px;
  quality.border = static_cast<float>(std::max(inner, 0.0) / r.width);
  return quality_cost(quality);
}

/// A triangle lies in the strips that contain its first corner's column.
Face::Count ViewVisibility::count_in_picture(const kit::ScreenPolygon& outline,
                                             float& edge_px) const {
  Face::Count count;
  if (outline.count == 0) return count;
  kit::ScreenPoint middle;
  for (int i = 0; i < outline.count; ++i) {
    const kit::ScreenPoint& p = outline.points[i];
    middle.u += p.u / outline.count, middle.v += p.v / outline.count;
    middle.inv_z += p.inv_z / outline.count;
  }
  const double column = std::clamp(outline.points[0].u, 0.0, depth_camera_.width - 1.0);
  for (const Face& face : faces_) {
    if (faces_.size() > 1 && !face.has_column(column)) continue;
    face.count(outline, count);
    // A triangle that covers no pixel centre: tests the pixel at its centroid.
    if (count.pixels == 0) face.count(middle, count);
    if (count.pixels > 0) edge_px = face.edge_distance_px(middle.u, middle.v);
    if (count.pixels > 0) break;
  }
  return count;
}

Face::Count ViewVisibility::count_in_cube(const Corners& corners, float& edge_px) const {
  Face::Count count;
  for (std::size_t i = 0; i < faces_.size(); ++i) faces_[i].count(in_face(i, corners), count);
  const Vec3f middle = (corners[0] + corners[1] + corners[2]) / 3.0f;
  for (std::size_t i = 0; i < faces_.size(); ++i) {
    const Vec3d p = T_face_world_[i] * vec_cast<double>(middle);
    if (p.z <= kit::kNearPlane_m) continue;
    const kit::ScreenPoint s = kit::to_screen(faces_[i].camera(), p);
    if (count.pixels == 0) faces_[i].count(s, count);
    if (std::abs(p.x) <= p.z && std::abs(p.y) <= p.z)
      edge_px = faces_[i].edge_distance_px(s.u, s.v);
  }
  return count;
}

/// Share of a triangle, by its middle and three points around it, where the view's alpha is 0.
float ViewVisibility::cut_share(const Corners& corners, Vec3f middle) const {
  if (!alpha_) return 0;
  int cut = 0;
  const auto add = [&](Vec3f p) {
    const auto pixel = pixel_of(p);
    if (!pixel) return;
    const Vec2d at = stream_pixel(view_, *pixel);
    cut += alpha_->at(at) == 0;
  };
  add(middle);
  for (const Vec3f& corner : corners) add(middle + (corner - middle) * 0.6f);
  return static_cast<float>(cut) / 4;
}

/// Share of a triangle's pixels that are valid.
ValidRegion::Share ViewVisibility::valid_share(const Corners& corners) const {
  if (valid_.is_whole()) return ValidRegion::Share::all;
  int valid = 0, invalid = 0;
  if (is_pinhole()) {
    const auto in_camera = [&](int i) { return T_camera_world_ * vec_cast<double>(corners[i]); };
    const kit::ScreenPolygon outline =
        kit::clip_to_screen(camera_, {in_camera(0), in_camera(1), in_camera(2)});
    if (outline.count == 3) {
      const auto& [a, b, c, d] = outline.points;
      const auto share = valid_.share_in({std::min({a.u, b.u, c.u}), std::min({a.v, b.v, c.v})},
                                         {std::max({a.u, b.u, c.u}), std::max({a.v, b.v, c.v})});
      if (share != ValidRegion::Share::some) return share;
    }
    kit::scan_polygon(outline, camera_.width, 0, camera_.height, [&](const kit::ScreenSpan& s) {
      valid_.add(s.y, s.first, s.last, valid, invalid);
    });
  }
  for (const Vec3f& p : valid_samples(corners))
    if (const auto pixel = pixel_of(p)) valid_.add(*pixel, valid, invalid);
  return ValidRegion::share(valid, invalid);
}

/// Sample points of a triangle for the test of validity: its corners; in a panorama, where edges
/// are curves, a grid denser than the blocks.
std::vector<Vec3f> ViewVisibility::valid_samples(const Corners& corners) const {
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

/// Whether a triangle of depth_camera_'s picture lies inside the tile minus its gutter.
bool ViewVisibility::is_inside(const kit::ScreenPolygon& outline) const {
  constexpr double kBeyondNearPlane = 0.9999;
  const double scale = depth_divisor(camera_);
  bool inside = outline.count == 3;
  for (const kit::ScreenPoint& p : std::span(outline.points).first(3))
    inside &= p.inv_z * kit::kNearPlane_m < kBeyondNearPlane &&
              inside_tile({(p.u + 0.5) * scale - 0.5, (p.v + 0.5) * scale - 0.5});
  return inside;
}

/// Whether a triangle lies inside the tile minus its gutter, and not across a panorama's seam.
bool ViewVisibility::is_inside(const Corners& corners) const {
  double left = std::numeric_limits<double>::max(), right = -left;
  for (const Vec3f& corner : corners) {
    const auto pixel = pixel_of(corner);
    if (!pixel || !inside_tile(*pixel)) return false;
    left = std::min(left, pixel->x), right = std::max(right, pixel->x);
  }
  // Corners more than half a turn apart: the triangle crosses the seam or contains a pole.
  return right - left < 0.5 * view_.width;
}

bool ViewVisibility::inside_tile(Vec2d pixel) const {
  const Rect& r = view_.image_rect;
  const double g = view_.gutter_px;
  return pixel.x >= r.x + g && pixel.y >= r.y + g && pixel.x <= r.x + r.width - 1 - g &&
         pixel.y <= r.y + r.height - 1 - g;
}

}  // namespace mr::atlas
