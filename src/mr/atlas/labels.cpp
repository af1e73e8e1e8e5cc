#include "mr/atlas/labels.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <vector>

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
constexpr double kFrontOfMargin_m = 0.05;  // an occluder this much nearer needs a margin around it

/// How one view sees one triangle.
struct Sight {
  float visible = 0;    ///< share of the triangle's pixels in sight, clear of occluders' margins; 0
                        ///< where the view may not be used
  float direct_px = 0;  ///< pixels in sight, margins or not; 0 where the view may not be used
  float facing = 0;     ///< cosine between the normal and the direction to the camera
  bool touches = false;  ///< some of it is in the picture and in sight
};

/// Smallest value in a window of (2r + 1)², ignoring 0.
ImageDepth nearest_around(const ImageDepth& depth, int r) {
  const auto nearer = [](float a, float b) { return a == 0 ? b : b == 0 ? a : std::min(a, b); };
  ImageDepth rows(depth.width, depth.height), out(depth.width, depth.height);
  parallel_for(depth.height, 32, [&](std::size_t begin, std::size_t end) {
    for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y)
      for (int x = 0; x < depth.width; ++x) {
        float best = 0;
        for (int k = std::max(0, x - r); k <= std::min(depth.width - 1, x + r); ++k)
          best = nearer(best, *depth.at(k, y));
        *rows.at(x, y) = best;
      }
  });
  parallel_for(depth.height, 32, [&](std::size_t begin, std::size_t end) {
    for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y)
      for (int k = std::max(0, y - r); k <= std::min(depth.height - 1, y + r); ++k)
        for (int x = 0; x < depth.width; ++x) *out.at(x, y) = nearer(*out.at(x, y), *rows.at(x, k));
  });
  return out;
}

/// Depth that nine tenths of the picture are beyond: margins must do for occluders close by.
double near_depth(const ImageDepth& depth) {
  std::vector<float> valid;
  for (const float d : depth.data)
    if (d > 0) valid.push_back(d);
  if (valid.empty()) return 1;
  std::nth_element(valid.begin(), valid.begin() + valid.size() / 10, valid.end());
  return valid[valid.size() / 10];
}

/// A view with the mesh's depth as it sees it.
class Eye {
 public:
  Eye(const Mesh& mesh, const View& view, const LabelConfig& config)
      : view_(view),
        camera_(view.camera()),
        T_camera_world_(view.T_world_camera.inverse()),
        config_(config),
        depth_(kit::rasterize(mesh, camera_, view.T_world_camera).depth),
        margin_(static_cast<int>(
            std::ceil(margin_px(view, config.geometry_error_m, near_depth(depth_))))),
        around_(nearest_around(depth_, margin_)) {}

  /// `normal_world`: what the surface faces there, smoothed.
  Sight look_at(const Mesh& mesh, std::size_t t, Vec3f normal_world) const {
    const std::array<Vec3d, 3> p = {in_camera(mesh.corner(t, 0)), in_camera(mesh.corner(t, 1)),
                                    in_camera(mesh.corner(t, 2))};
    const Vec3d normal = T_camera_world_.rotation * vec_cast<double>(normal_world);
    const Vec3d middle = (p[0] + p[1] + p[2]) / 3.0;
    Sight sight;
    sight.facing = static_cast<float>(-dot(normal, normalized(middle)));
    if (sight.facing < kLeastFacing) return {};
    int pixels = 0, clear = 0, direct = 0;
    const auto count = [&](int x, int y, double z) {
      const bool in_sight = nothing_in_front(x, y, z);
      ++pixels;
      direct += in_sight;
      clear += in_sight && clear_of_occluders(x, y, z);
    };
    kit::scan_polygon(kit::clip_to_screen(camera_, p), camera_.width, 0, camera_.height, count);
    if (pixels == 0 && middle.z > kit::kNearPlane_m) {  // smaller than a pixel
      const kit::ScreenPoint s = kit::to_screen(camera_, middle);
      const int x = static_cast<int>(std::lround(s.u)), y = static_cast<int>(std::lround(s.v));
      if (depth_.contains(x, y)) count(x, y, middle.z);
    }
    if (pixels == 0) return {};
    sight.touches = direct > 0;
    // A corner outside forbids the view for this triangle; cut, its inner pieces may use it.
    if (!std::all_of(p.begin(), p.end(), [&](Vec3d c) { return inside(c); })) return sight;
    sight.visible = static_cast<float>(clear) / static_cast<float>(pixels);
    if (direct > kLeastDirect * pixels) sight.direct_px = static_cast<float>(direct);
    return sight;
  }

 private:
  Vec3d in_camera(Vec3f p_world) const { return T_camera_world_ * vec_cast<double>(p_world); }

  bool inside(Vec3d p) const {
    if (p.z <= kit::kNearPlane_m) return false;
    const kit::ScreenPoint s = kit::to_screen(camera_, p);
    const Rect& r = view_.image_rect;
    const double g = view_.gutter_px;
    return s.u >= r.x + g && s.v >= r.y + g && s.u <= r.x + r.width - 1 - g &&
           s.v <= r.y + r.height - 1 - g;
  }

  double slack_m(double z) const {
    return config_.geometry_error_m + 2 * config_.precision.sigma_m(z);
  }

  bool nothing_in_front(int x, int y, double z) const {
    return *depth_.at(x, y) >= z - slack_m(z) - 3 * z / camera_.fx;
  }

  /// No occluder within the margin: a slope of up to 72 degrees across the margin is not one.
  bool clear_of_occluders(int x, int y, double z) const {
    return *around_.at(x, y) >= z - kFrontOfMargin_m - slack_m(z) - 3 * z / camera_.fx * margin_;
  }

  const View& view_;
  Camera camera_;
  Pose T_camera_world_;
  const LabelConfig& config_;
  ImageDepth depth_;
  int margin_;
  ImageDepth around_;
};

/// [view][triangle]
using Sights = std::vector<std::vector<Sight>>;

Sights look(const Mesh& mesh, std::span<const View> views, const LabelConfig& config) {
  Sights sights(views.size());
  const std::vector<Vec3f> normals = kit::smooth_normals(mesh, kNormalRounds);
  parallel_for(views.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t v = begin; v < end; ++v) {
      sights[v].resize(mesh.triangles.size());
      if (views[v].kind != View::Kind::pinhole) continue;
      const Eye eye(mesh, views[v], config);
      parallel_for(mesh.triangles.size(), 1024, [&](std::size_t first, std::size_t last) {
        for (std::size_t t = first; t < last; ++t) {
          const Triangle& tri = mesh.triangles[t];
          sights[v][t] =
              eye.look_at(mesh, t, normalized(normals[tri[0]] + normals[tri[1]] + normals[tri[2]]));
        }
      });
    }
  });
  return sights;
}

/// Cuts triangles that some view sees a good part of, but none enough.
bool cut_occlusion_edges(Mesh& mesh, const Sights& sights, double min_edge_m) {
  std::vector<std::uint8_t> split(mesh.triangles.size() * 3, 0);
  bool any = false;
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    float best = 0;
    bool touched = false;
    for (const auto& view : sights)
      best = std::max(best, view[t].visible), touched |= view[t].touches;
    if (best >= kEnoughVisible || !touched) continue;
    for (std::uint32_t h = 3 * t; h < 3 * t + 3; ++h) {
      const Vec3f edge =
          mesh.positions[kit::edge_to(mesh, h)] - mesh.positions[kit::edge_from(mesh, h)];
      split[h] = length(edge) > 2 * min_edge_m;
      any |= split[h] != 0;
    }
  }
  if (any) mesh = kit::refine(mesh, split).mesh;
  return any;
}

constexpr int kNone = -1;

/// The view that looks most directly among those that see enough; else the one that sees most of
/// the triangle, if need be within the margin of an occluder.
int best_view(const Sights& sights, std::size_t t) {
  int best = kNone, most = kNone;
  for (int v = 0; v < static_cast<int>(sights.size()); ++v) {
    const Sight& s = sights[v][t];
    if (s.visible >= kEnoughVisible && (best == kNone || s.facing > sights[best][t].facing))
      best = v;
    const auto rank = [&](int view) {
      return std::pair(sights[view][t].visible, sights[view][t].direct_px);
    };
    if (s.direct_px > 0 && (most == kNone || rank(v) > rank(most))) most = v;
  }
  return best != kNone ? best : most;
}

/// Moves labels to the neighbours' where the angle test allows (paper 3.3): in each sweep a
/// triangle takes the allowed view with the longest border to triangles of that view. In index
/// order: deterministic.
void agree_with_neighbours(std::vector<int>& label, const Mesh& mesh, const Sights& sights,
                           double angle_deg) {
  const kit::EdgeTable edges = kit::edge_table(mesh);
  const double allowance = angle_deg * std::numbers::pi / 180;
  const auto allowed = [&](int v, std::size_t t, int best) {
    const Sight& s = sights[v][t];
    const double angle = std::acos(std::min(1.0f, s.facing)),
                 least = std::acos(std::min(1.0f, sights[best][t].facing));
    return s.visible >= kEnoughVisible && angle <= least + allowance;
  };
  std::vector<int> best = label;
  for (int sweep = 0; sweep < kSweeps; ++sweep) {
    bool moved = false;
    for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
      if (best[t] == kNone) continue;
      std::map<int, double> border{{label[t], 0.0}};
      for (std::uint32_t h = 3 * t; h < 3 * t + 3; ++h) {
        if (edges.twin[h] == kit::kNoTwin) continue;
        const int other = label[edges.twin[h] / 3];
        if (other == kNone || !allowed(other, t, best[t])) continue;
        border[other] +=
            length(mesh.positions[kit::edge_to(mesh, h)] - mesh.positions[kit::edge_from(mesh, h)]);
      }
      int choice = label[t];
      for (const auto& [view, length_m] : border)
        if (length_m > border[choice]) choice = view;
      moved |= choice != label[t];
      label[t] = choice;
    }
    if (!moved) return;
  }
}

}  // namespace

double margin_px(const View& view, double geometry_error_m, double depth_m) {
  return geometry_error_m * std::max(view.fx, view.fy) / std::max(depth_m, kit::kNearPlane_m) + 2;
}

Mesh label_triangles(const Mesh& input, std::span<const View> views, const LabelConfig& config) {
  Mesh mesh = input;
  mesh.runs.clear();
  Sights sights = look(mesh, views, config);
  for (int round = 0; round < kCutRounds && cut_occlusion_edges(mesh, sights, config.min_edge_m);
       ++round)
    sights = look(mesh, views, config);

  std::vector<int> label(mesh.triangles.size(), kNone);
  for (std::size_t t = 0; t < label.size(); ++t) label[t] = best_view(sights, t);
  if (config.views == AtlasConfig::Views::coherent)
    agree_with_neighbours(label, mesh, sights, config.coherent_angle_deg);

  std::vector<ViewId> ids;
  for (const int l : label) ids.push_back(l == kNone ? kNoView : views[l].id);
  set_triangle_views(mesh, ids);
  return mesh;
}

}  // namespace mr::atlas
