#include "mr/atlas/labels.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <optional>
#include <vector>

#include "mr/atlas/fold_around.h"
#include "mr/core/parallel.h"
#include "mr/kit/raster.h"
#include "mr/kit/topology.h"

namespace mr::atlas {
namespace {

constexpr double kEnoughVisible = 0.9;
constexpr double kLeastDirect = 0.75;  // below it, neutral colour is better than a wrong picture
constexpr float kLeastFacing = 0.1f;   // cosine; flatter, a pixel smears over the surface
constexpr int kNormalRounds = 4;
constexpr int kCutRounds = 4;
constexpr int kSweeps = 12;
constexpr float kFrontOfMargin_m = 0.05f;  // an occluder this much nearer needs a margin around it

/// How one view sees one triangle.
struct TriangleSight {
  float visible = 0;    ///< share of the triangle's pixels in sight, clear of occluders' margins; 0
                        ///< where the view may not be used
  float direct_px = 0;  ///< pixels in sight, margins or not; 0 where the view may not be used
  float facing = 0;     ///< cosine between the normal and the direction to the camera
  bool touches = false;  ///< some of it is in the picture and in sight
};

/// Smallest value in a window of (2r + 1)²; where the mesh leaves the picture empty counts as far.
ImageDepth nearest_around(const ImageDepth& depth, int r) {
  constexpr float kFar = std::numeric_limits<float>::infinity();
  const auto nearer = [](float a, float b) { return a < b ? a : b; };
  ImageDepth far_where_empty = depth;
  for (float& d : far_where_empty.data) d = d == 0 ? kFar : d;
  return fold_around(far_where_empty, r, kFar, nearer);
}

/// Depth that nine tenths of the picture are beyond: margins must do for occluders close by.
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

/// The nearer of two depths, pixel by pixel; of `others` the part from (x0, y0) on.
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

/// A pinhole picture of the mesh: a view's own, or one of the six that a panorama is made of.
class Face {
 public:
  /// The triangle's pixels that a face has seen.
  struct Count {
    int pixels = 0, clear = 0, direct = 0;
  };

  /// `ring_px`: pixels at the border that only serve those inside. `others`: the depth of other
  /// surface, of which `camera` shows the part from (x, y) on; may be null.
  Face(const Mesh& mesh, const Camera& camera, const Pose& T_world_face, int ring_px,
       const ImageDepth* others, int x, int y, const LabelConfig& config)
      : camera_(camera),
        T_face_world_(T_world_face.inverse()),
        ring_(ring_px),
        error_m_(static_cast<float>(config.geometry_error_m + 2 * config.precision.base_m)),
        noise_per_m2_(static_cast<float>(2 * config.precision.per_m2)),
        pixel_(static_cast<float>(1 / camera.fx)),
        depth_(nearer(kit::rasterize_depth(mesh, camera, T_world_face), others, x, y)),
        margin_(static_cast<int>(
            std::ceil(margin_of(camera, config.geometry_error_m, near_depth(depth_))))),
        around_(nearest_around(depth_, margin_)) {}

  /// Adds the pixels inside a triangle.
  void count(const std::array<Vec3f, 3>& corners, Count& count) const {
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

  /// Adds the pixel at a point, if it is inside.
  void count(Vec3f point, Count& count) const {
    const Vec3d p = in_face(point);
    if (p.z <= kit::kNearPlane_m) return;
    const kit::ScreenPoint s = kit::to_screen(camera_, p);
    const double most = std::max(camera_.width, camera_.height);
    if (!(std::abs(s.u) <= most && std::abs(s.v) <= most)) return;
    const int x = static_cast<int>(std::lround(s.u)), y = static_cast<int>(std::lround(s.v));
    if (x >= ring_ && y >= ring_ && x < camera_.width - ring_ && y < camera_.height - ring_)
      add({y, x, x, static_cast<float>(s.inv_z), 0}, count);
  }

 private:
  Vec3d in_face(Vec3f p_world) const { return T_face_world_ * vec_cast<double>(p_world); }

  void add(const kit::ScreenSpan& s, Count& count) const {
    const float* const nearest = depth_.row(s.y);
    const float* const around = around_.row(s.y);
    for (int x = s.first; x <= s.last; ++x) {
      const float z = 1 / (s.inv_z + static_cast<float>(x - s.first) * s.inv_z_step);
      // Bumps of the surface's own size hide nothing, and no slope of up to 72 degrees does.
      const float in_front = z - (error_m_ + noise_per_m2_ * (z * z) + 3 * pixel_ * z);
      const float occluder =
          in_front - kFrontOfMargin_m - 3 * pixel_ * z * static_cast<float>(margin_ - 1);
      const int in_sight = nearest[x] >= in_front;
      count.direct += in_sight;
      count.clear += in_sight & (around[x] >= occluder);
    }
    count.pixels += std::max(0, s.last - s.first + 1);
  }

  Camera camera_;
  Pose T_face_world_;
  int ring_;
  float error_m_, noise_per_m2_;  ///< how far in front something must be to hide
  float pixel_;                   ///< width of a pixel at 1 m
  ImageDepth depth_;
  int margin_;
  ImageDepth around_;
};

/// Where a mesh falls in a pinhole's picture, with `around_px` pixels around; the whole picture
/// where some of it is at the near plane or behind.
Rect bounds_in(const Camera& camera, const Pose& T_world_camera, const Mesh& mesh, int around_px) {
  const Pose T_camera_world = T_world_camera.inverse();
  double left = camera.width, top = camera.height, right = -1, bottom = -1;
  for (const Vec3f& position : mesh.positions) {
    const Vec3d p = T_camera_world * vec_cast<double>(position);
    if (p.z <= kit::kNearPlane_m) continue;
    const kit::ScreenPoint s = kit::to_screen(camera, p);
    left = std::min(left, s.u), right = std::max(right, s.u);
    top = std::min(top, s.v), bottom = std::max(bottom, s.v);
  }
  const auto within = [&](double v, int size) {
    return static_cast<int>(std::clamp(v, 0.0, static_cast<double>(size)));
  };
  const int x = within(left - around_px, camera.width), y = within(top - around_px, camera.height);
  return {x, y, within(right + around_px + 1, camera.width) - x,
          within(bottom + around_px + 1, camera.height) - y};
}

/// The six pictures that a panorama is made of.
std::array<kit::CubeFace, 6> panorama_faces(const Camera& camera) {
  constexpr int kRing_px = 24;
  constexpr double kEnoughPerRad = 512;  // to tell what hides what
  const Vec2d density = kit::pixels_per_rad(camera);
  return kit::cube_faces(std::min(std::max(density.x, density.y), kEnoughPerRad), kRing_px);
}

/// The faces of a view, as much of them as the mesh falls into.
std::vector<Face> faces_of(const Mesh& mesh, const View& view, const LabelConfig& config) {
  constexpr int kAround_px = 64;  // margins around occluders are no wider
  std::vector<Face> out;
  const Camera camera = view.camera();
  const std::vector<ImageDepth>* const others =
      config.occluders ? config.occluders->faces(view) : nullptr;
  if (view.kind == View::Kind::pinhole) {
    const Rect part = others ? bounds_in(camera, view.T_world_camera, mesh, kAround_px)
                             : Rect{0, 0, camera.width, camera.height};
    if (part.empty()) return out;
    Camera cropped = camera;
    cropped.width = part.width, cropped.height = part.height;
    cropped.cx -= part.x, cropped.cy -= part.y;
    out.emplace_back(mesh, cropped, view.T_world_camera, 0, others ? &others->front() : nullptr,
                     part.x, part.y, config);
    return out;
  }
  const auto faces = panorama_faces(camera);
  for (std::size_t i = 0; i < faces.size(); ++i)
    out.emplace_back(mesh, faces[i].camera, view.T_world_camera * Pose{faces[i].R_camera_face, {}},
                     faces[i].ring_px, others ? &(*others)[i] : nullptr, 0, 0, config);
  return out;
}

/// The pixels of a view's picture that are good for texture.
class ValidRegion {
 public:
  enum class Share { none, some, all };

  explicit ValidRegion(const TileMask* mask) : mask_(mask) {}
  bool is_whole() const { return mask_ == nullptr; }

  /// Adds pixels of a row.
  void add(int y, int first, int last, int& valid, int& invalid) const {
    for (int tile = first / mask_->tile_px; tile <= last / mask_->tile_px; ++tile)
      ++(is_valid(tile, y / mask_->tile_px) ? valid : invalid);
  }
  void add(Vec2d pixel, int& valid, int& invalid) const {
    const int x = static_cast<int>(std::lround(pixel.x)),
              y = static_cast<int>(std::lround(pixel.y));
    ++(x >= 0 && y >= 0 && is_valid(x / mask_->tile_px, y / mask_->tile_px) ? valid : invalid);
  }
  static Share share(int valid, int invalid) {
    return valid == 0 ? Share::none : invalid > 0 ? Share::some : Share::all;
  }

 private:
  bool is_valid(int column, int row) const {
    return column < mask_->columns && row < mask_->rows && mask_->at(column, row);
  }

  const TileMask* mask_;  ///< null: all
};

ValidRegion valid_region(const View& view, const LabelConfig& config) {
  const auto found = config.valid.find(view.id);
  return ValidRegion(found == config.valid.end() ? nullptr : &found->second);
}

/// A view with the mesh's depth as it sees it.
class Eye {
 public:
  Eye(const Mesh& mesh, const View& view, const LabelConfig& config)
      : view_(view),
        camera_(view.camera()),
        T_camera_world_(view.T_world_camera.inverse()),
        valid_(valid_region(view, config)),
        faces_(faces_of(mesh, view, config)) {}

  /// `normal_world`: what the surface faces there, smoothed.
  TriangleSight look_at(const Mesh& mesh, std::size_t t, Vec3f normal_world) const {
    TriangleSight sight;
    const Vec3d sight_line = vec_cast<double>(mesh.centroid(t)) - view_.T_world_camera.translation;
    sight.facing = static_cast<float>(-dot(vec_cast<double>(normal_world), normalized(sight_line)));
    if (sight.facing < kLeastFacing) return {};
    const std::array<Vec3f, 3> corners = {mesh.corner(t, 0), mesh.corner(t, 1), mesh.corner(t, 2)};
    const Face::Count count = count_pixels(corners, mesh.centroid(t));
    if (count.pixels == 0) return {};
    const ValidRegion::Share valid = valid_share(corners);
    if (valid == ValidRegion::Share::none) return {};
    sight.touches = count.direct > 0;
    if (valid == ValidRegion::Share::some) return sight;  // cut, its inner pieces may use the view
    const bool inside = is_inside(corners);
    // A corner outside forbids the view for this triangle; cut, its inner pieces may use it.
    // Across the seam of a panorama, though, what cannot be cut further has its picture.
    if (!inside && !is_whole_turn()) return sight;
    if (inside) sight.visible = static_cast<float>(count.clear) / static_cast<float>(count.pixels);
    if (count.direct > kLeastDirect * count.pixels)
      sight.direct_px = static_cast<float>(count.direct);
    return sight;
  }

 private:
  Face::Count count_pixels(const std::array<Vec3f, 3>& corners, Vec3f middle) const {
    Face::Count count;
    for (const Face& face : faces_) face.count(corners, count);
    // Smaller than a pixel.
    for (std::size_t i = 0; i < faces_.size() && count.pixels == 0; ++i)
      faces_[i].count(middle, count);
    return count;
  }

  /// How much of what a triangle covers is valid.
  ValidRegion::Share valid_share(const std::array<Vec3f, 3>& corners) const {
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

  /// Points at which to look whether a triangle is valid: its corners, and of a panorama, where
  /// edges are curves, so many that no block lies between them.
  std::vector<Vec3f> valid_samples(const std::array<Vec3f, 3>& corners) const {
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

  bool is_whole_turn() const {
    return view_.kind == View::Kind::equirectangular &&
           view_.image_rect == Rect{0, 0, view_.width, view_.height};
  }

  /// Where a point falls in the view's picture; nothing when it is too near.
  std::optional<Vec2d> pixel_of(Vec3f p_world) const {
    const Vec3d p = T_camera_world_ * vec_cast<double>(p_world);
    if (view_.kind == View::Kind::equirectangular) return project(camera_, p);
    if (p.z <= kit::kNearPlane_m) return std::nullopt;
    const kit::ScreenPoint s = kit::to_screen(camera_, p);
    return Vec2d{s.u, s.v};
  }

  /// Whether all of a triangle lies in the tile without its gutter, and not across its seam.
  bool is_inside(const std::array<Vec3f, 3>& corners) const {
    double left = std::numeric_limits<double>::max(), right = -left;
    for (const Vec3f& corner : corners) {
      const auto pixel = pixel_of(corner);
      if (!pixel || !inside_tile(*pixel)) return false;
      left = std::min(left, pixel->x), right = std::max(right, pixel->x);
    }
    // Corners of one more than half a turn apart: it goes the other way, or around a pole.
    return view_.kind == View::Kind::pinhole || right - left < 0.5 * view_.width;
  }

  bool inside_tile(Vec2d pixel) const {
    const Rect& r = view_.image_rect;
    const double g = view_.gutter_px;
    return pixel.x >= r.x + g && pixel.y >= r.y + g && pixel.x <= r.x + r.width - 1 - g &&
           pixel.y <= r.y + r.height - 1 - g;
  }

  const View& view_;
  Camera camera_;
  Pose T_camera_world_;
  ValidRegion valid_;
  std::vector<Face> faces_;
};

/// [view][triangle]
using Sights = std::vector<std::vector<TriangleSight>>;

/// What labelling needs beside the surface, while that is cut.
struct Work {
  Labelling& surface;
  std::vector<Vec3f> normals;               ///< [V] smoothed
  Sights sights;                            ///< of what is due
  std::vector<std::uint32_t> not_seen_yet;  ///< triangles whose sights are still to be found
};

/// One per view.
std::vector<std::optional<Eye>> open_eyes(const Mesh& mesh, std::span<const View> views,
                                          const LabelConfig& config) {
  std::vector<std::optional<Eye>> eyes(views.size());
  parallel_for(views.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t v = begin; v < end; ++v) eyes[v].emplace(mesh, views[v], config);
  });
  return eyes;
}

/// Finds the sights that are missing.
void look(std::span<const std::optional<Eye>> eyes, Work& work) {
  const Mesh& mesh = work.surface.mesh;
  for (auto& view : work.sights) view.resize(mesh.triangles.size());
  parallel_for(work.not_seen_yet.size(), 256, [&](std::size_t first, std::size_t last) {
    for (std::size_t i = first; i < last; ++i) {
      const std::uint32_t t = work.not_seen_yet[i];
      const auto& [a, b, c] = mesh.triangles[t];
      const Vec3f normal = normalized(work.normals[a] + work.normals[b] + work.normals[c]);
      for (std::size_t v = 0; v < eyes.size(); ++v)
        work.sights[v][t] = eyes[v]->look_at(mesh, t, normal);
    }
  });
}

/// Cuts the edges marked in `split`. Pieces face what their triangle faced; the sights of whole
/// triangles move along.
void cut(Work& work, const std::vector<std::uint8_t>& split) {
  Labelling& s = work.surface;
  kit::Refined refined = kit::refine(s.mesh, split);
  for (const auto& [a, b] : refined.cut_edges) {
    work.normals.push_back(normalized(work.normals[a] + work.normals[b]));
    s.cut_edges.push_back({a, b});
  }
  Sights sights(work.sights.size(), std::vector<TriangleSight>(refined.parent.size()));
  work.not_seen_yet.clear();
  Labelling out;
  for (std::uint32_t t = 0; t < refined.parent.size(); ++t) {
    const std::uint32_t parent = refined.parent[t];
    out.label.push_back(s.label[parent]), out.is_due.push_back(s.is_due[parent]);
    out.origin.push_back(s.origin[parent]);
    if (refined.mesh.triangles[t] == s.mesh.triangles[parent])
      for (std::size_t v = 0; v < sights.size(); ++v) sights[v][t] = work.sights[v][parent];
    else if (s.is_due[parent])
      work.not_seen_yet.push_back(t);
  }
  out.mesh = std::move(refined.mesh), out.cut_edges = std::move(s.cut_edges);
  s = std::move(out);
  work.sights = std::move(sights);
}

/// Cuts triangles that some view sees a good part of, but none enough.
bool cut_occlusion_edges(Work& work, double min_edge_m) {
  const Mesh& mesh = work.surface.mesh;
  std::vector<std::uint8_t> split(mesh.triangles.size() * 3, 0);
  bool any = false;
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    float best = 0;
    bool touched = false;
    for (const auto& view : work.sights)
      best = std::max(best, view[t].visible), touched |= view[t].touches;
    if (best >= kEnoughVisible || !touched) continue;
    for (std::uint32_t h = 3 * t; h < 3 * t + 3; ++h) {
      const Vec3f edge =
          mesh.positions[kit::edge_to(mesh, h)] - mesh.positions[kit::edge_from(mesh, h)];
      split[h] = length(edge) > 2 * min_edge_m;
      any |= split[h] != 0;
    }
  }
  if (any) cut(work, split);
  return any;
}

constexpr int kNone = Labelling::kNone;

/// The view that looks most directly among those that see enough; else the one that sees most of
/// the triangle, if need be within the margin of an occluder.
int best_view(const Sights& sights, std::size_t t) {
  int best = kNone, most = kNone;
  for (int v = 0; v < static_cast<int>(sights.size()); ++v) {
    const TriangleSight& s = sights[v][t];
    if (s.visible >= kEnoughVisible && (best == kNone || s.facing > sights[best][t].facing))
      best = v;
    const auto rank = [&](int view) {
      return std::pair(sights[view][t].visible, sights[view][t].direct_px);
    };
    if (s.direct_px > 0 && (most == kNone || rank(v) > rank(most))) most = v;
  }
  return best != kNone ? best : most;
}

/// [triangle][view] 1 where the view sees enough, at an angle that is not much worse than the best.
std::vector<std::uint8_t> allowed_views(const Labelling& surface, const Sights& sights,
                                        double angle_deg) {
  const std::vector<int>& best = surface.label;
  const double allowance = angle_deg * std::numbers::pi / 180;
  const auto angle = [](const TriangleSight& s) { return std::acos(std::min(1.0f, s.facing)); };
  std::vector<std::uint8_t> allowed(best.size() * sights.size(), 0);
  for (std::size_t t = 0; t < best.size(); ++t) {
    if (best[t] == kNone || !surface.is_due[t]) continue;
    const double most = angle(sights[best[t]][t]) + allowance;
    for (std::size_t v = 0; v < sights.size(); ++v) {
      const TriangleSight& s = sights[v][t];
      allowed[t * sights.size() + v] = s.visible >= kEnoughVisible && angle(s) <= most;
    }
  }
  return allowed;
}

/// The view with the longest border among a triangle's own and those that its neighbours bring; its
/// own when none is longer, else the lowest of equals.
class LongestBorder {
 public:
  explicit LongestBorder(int own) : entries_{{{own, 0.0}}} {}

  void add(int view, double length_m) {
    int i = 0;
    while (i < count_ && entries_[i].view != view) ++i;
    if (i == count_) entries_[count_++] = {view, 0.0};
    entries_[i].length_m += length_m;
  }
  int view() const {
    Entry best = entries_[0];
    for (int i = 1; i < count_; ++i) {
      const Entry& e = entries_[i];
      const bool lower_of_equals =
          e.length_m == best.length_m && best.view != entries_[0].view && e.view < best.view;
      if (e.length_m > best.length_m || lower_of_equals) best = e;
    }
    return best.view;
  }

 private:
  struct Entry {
    int view = kNone;
    double length_m = 0;
  };
  std::array<Entry, 4> entries_;  // its own and one per edge
  int count_ = 1;
};

/// Moves labels to the neighbours' where the angle test allows (paper 3.3): in each sweep a
/// triangle takes the allowed view with the longest border to triangles of that view. In index
/// order: deterministic. Only triangles at which something changed are looked at again.
void agree_with_neighbours(Labelling& surface, const Sights& sights, double angle_deg) {
  const Mesh& mesh = surface.mesh;
  std::vector<int>& label = surface.label;
  const std::vector<std::uint32_t> twin = kit::edge_table(mesh).twin;
  const std::vector<std::uint8_t> allowed = allowed_views(surface, sights, angle_deg);
  const auto may_move = [&](std::size_t t) { return label[t] != kNone && surface.is_due[t]; };
  std::vector<std::uint8_t> stale(label.size());
  for (std::size_t t = 0; t < label.size(); ++t) stale[t] = may_move(t);
  bool moved = true;
  for (int sweep = 0; sweep < kSweeps && moved; ++sweep) {
    moved = false;
    for (std::uint32_t t = 0; t < label.size(); ++t) {
      if (!stale[t]) continue;
      stale[t] = 0;
      LongestBorder border(label[t]);
      for (std::uint32_t h = 3 * t; h < 3 * t + 3; ++h) {
        const int other = twin[h] == kit::kNoTwin ? kNone : label[twin[h] / 3];
        if (other == kNone || !allowed[t * sights.size() + other]) continue;
        border.add(other, length(mesh.positions[kit::edge_to(mesh, h)] -
                                 mesh.positions[kit::edge_from(mesh, h)]));
      }
      if (border.view() == label[t]) continue;
      label[t] = border.view();
      moved = true;
      for (std::uint32_t h = 3 * t; h < 3 * t + 3; ++h)
        if (twin[h] != kit::kNoTwin) stale[twin[h] / 3] = may_move(twin[h] / 3);
    }
  }
}

/// Labels what is due of a surface.
void label(Labelling& surface, std::span<const View> views, const LabelConfig& config) {
  Work work{surface, kit::smooth_normals(surface.mesh, kNormalRounds), Sights(views.size()), {}};
  for (std::uint32_t t = 0; t < surface.is_due.size(); ++t)
    if (surface.is_due[t]) work.not_seen_yet.push_back(t);
  // Cutting leaves the surface as it is: what hides what is found out once.
  const bool all = work.not_seen_yet.size() == surface.is_due.size();
  const std::vector<std::optional<Eye>> eyes =
      open_eyes(all ? surface.mesh : select_triangles(surface.mesh, surface.is_due), views, config);
  look(eyes, work);
  for (int round = 0; round < kCutRounds && cut_occlusion_edges(work, config.min_edge_m); ++round)
    look(eyes, work);
  for (std::size_t t = 0; t < surface.label.size(); ++t)
    if (surface.is_due[t]) surface.label[t] = best_view(work.sights, t);
  if (config.views == AtlasConfig::Views::coherent)
    agree_with_neighbours(surface, work.sights, config.coherent_angle_deg);
}

/// What is due of a surface, with as much around it as its labels follow from: a label of what is
/// due costs the same on a large surface as on a small one.
struct Part {
  Labelling labelling;                ///< its origins: places in the whole
  std::vector<std::uint32_t> vertex;  ///< [V] of the part → of the whole

  explicit Part(const Labelling& whole) {
    const std::vector<std::uint8_t> near = near_due(whole);
    std::vector<std::uint32_t> index(whole.mesh.positions.size(), kNoVertex);
    for (std::uint32_t t = 0; t < near.size(); ++t) {
      if (!near[t]) continue;
      Triangle triangle = whole.mesh.triangles[t];
      for (std::uint32_t& v : triangle) {
        if (index[v] == kNoVertex) {
          index[v] = static_cast<std::uint32_t>(vertex.size());
          vertex.push_back(v), labelling.mesh.positions.push_back(whole.mesh.positions[v]);
        }
        v = index[v];
      }
      labelling.mesh.triangles.push_back(triangle), labelling.origin.push_back(t);
      labelling.label.push_back(whole.label[t]), labelling.is_due.push_back(whole.is_due[t]);
    }
  }

  /// The pieces and labels take the place of what they were cut from.
  void put_back(Labelling& whole) {
    const std::size_t first_cut = vertex.size();
    for (std::size_t i = 0; i < labelling.cut_edges.size(); ++i) {
      const auto& [a, b] = labelling.cut_edges[i];
      vertex.push_back(static_cast<std::uint32_t>(whole.mesh.positions.size()));
      whole.mesh.positions.push_back(labelling.mesh.positions[first_cut + i]);
      whole.cut_edges.push_back({vertex[a], vertex[b]});
    }
    Labelling out;
    const auto add = [&](const Triangle& triangle, int label, std::uint8_t is_due,
                         std::uint32_t origin) {
      out.mesh.triangles.push_back(triangle);
      out.label.push_back(label), out.is_due.push_back(is_due), out.origin.push_back(origin);
    };
    std::size_t p = 0;
    for (std::uint32_t t = 0; t < whole.mesh.triangles.size(); ++t) {
      if (p == labelling.origin.size() || labelling.origin[p] != t)
        add(whole.mesh.triangles[t], whole.label[t], whole.is_due[t], whole.origin[t]);
      for (; p < labelling.origin.size() && labelling.origin[p] == t; ++p) {
        const auto& [a, b, c] = labelling.mesh.triangles[p];
        add({vertex[a], vertex[b], vertex[c]}, labelling.label[p], labelling.is_due[p],
            whole.origin[t]);
      }
    }
    whole.mesh.triangles = std::move(out.mesh.triangles), whole.label = std::move(out.label);
    whole.is_due = std::move(out.is_due), whole.origin = std::move(out.origin);
  }

 private:
  static constexpr std::uint32_t kNoVertex = 0xFFFFFFFFu;

  /// [T] what is due and the rings of triangles around it that smooth its normals.
  static std::vector<std::uint8_t> near_due(const Labelling& whole) {
    constexpr int kRings = kNormalRounds + 1;
    std::vector<std::uint8_t> near = whole.is_due, reached(whole.mesh.positions.size());
    const auto reach = [&](std::size_t t, int ring) {
      for (const std::uint32_t v : whole.mesh.triangles[t])
        if (!reached[v]) reached[v] = static_cast<std::uint8_t>(ring + 1);
    };
    for (std::size_t t = 0; t < near.size(); ++t)
      if (near[t]) reach(t, 0);
    for (int ring = 1; ring <= kRings; ++ring)
      for (std::size_t t = 0; t < near.size(); ++t) {
        if (near[t]) continue;
        near[t] = std::ranges::any_of(whole.mesh.triangles[t], [&](std::uint32_t v) {
          return reached[v] && reached[v] <= ring;
        });
        if (near[t]) reach(t, ring);
      }
    return near;
  }
};

}  // namespace

double margin_px(const View& view, double geometry_error_m, double depth_m) {
  return margin_of(view.camera(), geometry_error_m, depth_m);
}

Occluders::Occluders(const Mesh& mesh, std::span<const View> views) {
  std::vector<std::vector<ImageDepth>> faces(views.size());
  parallel_for(views.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t v = begin; v < end; ++v) {
      const View& view = views[v];
      const auto draw = [&](const Camera& camera, const Mat3& R_camera_face) {
        const Pose T_world_face = view.T_world_camera * Pose{R_camera_face, {}};
        faces[v].push_back(kit::rasterize_depth(mesh, camera, T_world_face));
      };
      if (view.kind == View::Kind::pinhole)
        draw(view.camera(), Pose{}.rotation);
      else
        for (const kit::CubeFace& face : panorama_faces(view.camera()))
          draw(face.camera, face.R_camera_face);
    }
  });
  for (std::size_t v = 0; v < views.size(); ++v) faces_[views[v].id] = std::move(faces[v]);
}

const std::vector<ImageDepth>* Occluders::faces(const View& view) const {
  const auto found = faces_.find(view.id);
  return found == faces_.end() ? nullptr : &found->second;
}

Labelling Labelling::of(Mesh surface) {
  Labelling out;
  const std::size_t count = surface.triangles.size();
  out.mesh = std::move(surface);
  out.mesh.runs.clear();
  out.label.assign(count, kNone), out.is_due.assign(count, 1);
  out.origin.resize(count);
  std::iota(out.origin.begin(), out.origin.end(), 0u);
  return out;
}

Mesh Labelling::labelled(std::span<const View> views) const {
  std::vector<ViewId> ids;
  for (const int v : label) ids.push_back(v == kNone ? kNoView : views[v].id);
  Mesh out = mesh;
  set_triangle_views(out, ids);
  return out;
}

void label_due(Labelling& surface, std::span<const View> views, const LabelConfig& config) {
  const auto due = static_cast<std::size_t>(std::ranges::count(surface.is_due, 1));
  if (due == 0) return;
  if (due == surface.is_due.size()) return label(surface, views, config);
  Part part(surface);
  label(part.labelling, views, config);
  part.put_back(surface);
}

Mesh label_triangles(const Mesh& mesh, std::span<const View> views, const LabelConfig& config) {
  Labelling surface = Labelling::of(mesh);
  label_due(surface, views, config);
  return surface.labelled(views);
}

}  // namespace mr::atlas
