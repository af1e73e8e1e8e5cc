#include "mr/atlas/labels.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <optional>
#include <vector>

#include "mr/atlas/color_sampler.h"
#include "mr/atlas/due_part.h"
#include "mr/atlas/label_history.h"
#include "mr/atlas/label_problem.h"
#include "mr/atlas/visibility.h"
#include "mr/core/parallel.h"
#include "mr/kit/topology.h"

namespace mr::atlas {
namespace {

constexpr double kEnoughVisible = 0.9;
constexpr int kNormalRounds = 4;
constexpr int kCutRounds = 4;

/// [view][triangle]
using Visibilities = std::vector<std::vector<TriangleVisibility>>;

/// The state of labelling while the surface is being split.
struct LabellingState {
  Labelling& surface;
  std::vector<Vec3f> normals;               ///< [V] smoothed
  Visibilities visibility;                  ///< [views][T] of due triangles
  std::vector<std::uint32_t> not_seen_yet;  ///< triangles whose visibility is not computed yet
};

/// One per view; depth buffers show the due triangles.
std::vector<std::optional<ViewVisibility>> visibility_tests(const LabellingState& work,
                                                            std::span<const View> views,
                                                            const LabelConfig& config) {
  std::vector<std::optional<ViewVisibility>> tests(views.size());
  parallel_for(views.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t v = begin; v < end; ++v)
      tests[v].emplace(work.surface.mesh, work.not_seen_yet, views[v], config);
  });
  return tests;
}

/// Computes the visibility of the triangles in not_seen_yet, view by view, so that a depth map
/// stays in the cache.
void find_visibility(std::span<const std::optional<ViewVisibility>> tests, LabellingState& work) {
  const Mesh& mesh = work.surface.mesh;
  for (std::size_t v = 0; v < tests.size(); ++v) {
    std::vector<TriangleVisibility>& visibility = work.visibility[v];
    visibility.resize(mesh.triangles.size());
    parallel_for(work.not_seen_yet.size(), 512, [&](std::size_t first, std::size_t last) {
      for (std::size_t i = first; i < last; ++i) {
        const std::uint32_t t = work.not_seen_yet[i];
        const auto& [a, b, c] = mesh.triangles[t];
        const Vec3f normal = work.normals[a] + work.normals[b] + work.normals[c];
        visibility[t] = tests[v]->of_triangle(mesh, t, normal);
      }
    });
  }
}

/// Splits the edges marked in `split`; the pieces are to be seen again.
void cut(LabellingState& work, const std::vector<std::uint8_t>& split,
         const std::optional<Lattice>& lattice) {
  Labelling& s = work.surface;
  const std::size_t known = s.mesh.positions.size();
  const auto old_count = static_cast<std::uint32_t>(s.label.size());
  const kit::Cuts cuts = kit::refine_in_place(s.mesh, split);
  for (std::size_t v = known; lattice && v < s.mesh.positions.size(); ++v)
    s.mesh.positions[v] = lattice->snap(s.mesh.positions[v]);
  for (const auto& [a, b] : cuts.cut_edges)
    work.normals.push_back(normalized(work.normals[a] + work.normals[b]));
  s.cut_edges.insert(s.cut_edges.end(), cuts.cut_edges.begin(), cuts.cut_edges.end());
  work.not_seen_yet.clear();
  for (const std::uint32_t t : cuts.changed)
    if (s.is_due[t]) work.not_seen_yet.push_back(t);
  for (std::uint32_t i = 0; i < cuts.parent.size(); ++i) {
    const std::uint32_t parent = cuts.parent[i];
    s.label.push_back(s.label[parent]), s.is_due.push_back(s.is_due[parent]);
    s.origin.push_back(s.origin[parent]);
    if (s.is_due[parent]) work.not_seen_yet.push_back(old_count + i);
  }
}

/// Splits triangles that are partly visible in some view but sufficiently visible in none, among
/// those that were just seen.
bool cut_occlusion_edges(LabellingState& work, const LabelConfig& config) {
  const Mesh& mesh = work.surface.mesh;
  std::vector<std::uint8_t> split(mesh.triangles.size() * 3, 0);
  bool any = false;
  for (const std::uint32_t t : work.not_seen_yet) {
    float best = 0;
    bool touched = false;
    for (const auto& view : work.visibility)
      best = std::max(best, view[t].visible), touched |= view[t].touches;
    if (best >= kEnoughVisible || !touched) continue;
    for (std::uint32_t h = 3 * t; h < 3 * t + 3; ++h) {
      const Vec3f edge =
          mesh.positions[kit::edge_to(mesh, h)] - mesh.positions[kit::edge_from(mesh, h)];
      split[h] = length(edge) > 2 * config.min_edge_m;
      any |= split[h] != 0;
    }
  }
  if (any) cut(work, split, config.lattice);
  return any;
}

/// Puts the pieces of each original triangle side by side, the originals in order.
void gather_pieces(Labelling& s) {
  if (std::ranges::is_sorted(s.origin)) return;
  std::vector<std::uint32_t> order(s.origin.size());
  std::iota(order.begin(), order.end(), 0u);
  std::ranges::stable_sort(order, {}, [&](std::uint32_t t) { return s.origin[t]; });
  Labelling out;
  for (const std::uint32_t t : order) {
    out.mesh.triangles.push_back(s.mesh.triangles[t]), out.label.push_back(s.label[t]);
    out.is_due.push_back(s.is_due[t]), out.origin.push_back(s.origin[t]);
  }
  s.mesh.triangles = std::move(out.mesh.triangles), s.label = std::move(out.label);
  s.is_due = std::move(out.is_due), s.origin = std::move(out.origin);
}

constexpr int kNone = Labelling::kNone;

/// The most frontal of the views in which enough of the triangle is visible; else the view in which
/// most of it is visible, including an occluder's margin if necessary.
int best_view(const Visibilities& visibility, std::size_t t) {
  int best = kNone, most = kNone;
  for (int v = 0; v < static_cast<int>(visibility.size()); ++v) {
    const TriangleVisibility& s = visibility[v][t];
    if (s.visible >= kEnoughVisible && (best == kNone || s.facing > visibility[best][t].facing))
      best = v;
    const auto rank = [&](int view) {
      return std::pair(visibility[view][t].visible, visibility[view][t].direct_px);
    };
    if (s.direct_px > 0 && (most == kNone || rank(v) > rank(most))) most = v;
  }
  return best != kNone ? best : most;
}

/// The views that may texture a triangle and what they cost per area: 0 for the best one, at most
/// kMostCost more. Where only the margin of an occluder hides a triangle, a view costs kMargin
/// more; where it shows surface just in front, twice as much: such views serve regions that would
/// be too small. Nothing is allowed where no view shows the triangle itself.
void rate_views(const Visibilities& visibility, std::size_t t, ViewId kept,
                std::span<const View> views, float keep, std::span<float> cost) {
  constexpr float kMostCost = 4, kMargin = 1;
  const auto shows = [](const TriangleVisibility& s) {
    return s.visible >= kEnoughVisible || s.direct_px > 0;
  };
  float best = LabelProblem::kNotAllowed;
  bool any = false;
  for (std::size_t v = 0; v < visibility.size(); ++v) {
    const TriangleVisibility& s = visibility[v][t];
    cost[v] = LabelProblem::kNotAllowed;
    if (!shows(s) && s.near_px <= 0) continue;
    const float hidden = s.visible >= kEnoughVisible ? 0 : shows(s) ? kMargin : 2 * kMargin;
    const float change = kept == kNoView || views[v].id == kept ? 0 : keep;
    cost[v] = s.cost + hidden + (1 - s.visible) + change;
    best = std::min(best, cost[v]), any |= shows(s);
  }
  for (float& c : cost)
    if (c < LabelProblem::kNotAllowed)
      c = any ? std::min(c - best, kMostCost) : LabelProblem::kNotAllowed;
}

/// The choice of views of the due triangles as a problem; the others' labels are fixed.
LabelProblem label_problem(const LabellingState& work, std::span<const View> views,
                           const LabelConfig& config) {
  const Mesh& mesh = work.surface.mesh;
  const std::size_t count = mesh.triangles.size();
  LabelProblem out;
  out.mesh = &mesh, out.views = views.size();
  out.cost.resize(count * views.size()), out.area_m2.resize(count);
  out.may_move = work.surface.is_due;
  parallel_for(count, 1024, [&](std::size_t begin, std::size_t end) {
    for (std::size_t t = begin; t < end; ++t) {
      out.area_m2[t] = 0.5f * length(mesh.area_normal(t));
      if (!out.may_move[t]) continue;
      const ViewId kept = config.history ? config.history->at(mesh.centroid(t)) : kNoView;
      const std::span cost(out.cost.data() + t * views.size(), views.size());
      rate_views(work.visibility, t, kept, views, config.keep, cost);
      for (float& c : cost) c *= out.area_m2[t];
    }
  });
  out.twin = kit::edge_table(mesh).twin;
  return out;
}

/// View selection as energy minimization. Due triangles start with the view of least cost.
void choose_coherent(LabellingState& work, std::span<const View> views, const LabelConfig& config) {
  LabelProblem problem = label_problem(work, views, config);
  SeamColors colors(work.surface.mesh, views, config.colors);
  problem.colors = &colors;
  std::vector<int>& label = work.surface.label;
  for (std::size_t t = 0; t < label.size(); ++t) {
    if (!problem.may_move[t]) continue;
    const auto first = problem.cost.begin() + static_cast<std::ptrdiff_t>(t * views.size());
    const auto best = std::min_element(first, first + static_cast<std::ptrdiff_t>(views.size()));
    label[t] = views.empty() || !(*best < LabelProblem::kNotAllowed)
                   ? kNone
                   : static_cast<int>(best - first);
  }
  solve_labels(problem, config.least_region_m2, label);
}

/// Labels the due triangles of a surface.
void label(Labelling& surface, std::span<const View> views, const LabelConfig& config) {
  LabellingState work{
      surface, kit::smooth_normals(surface.mesh, kNormalRounds), Visibilities(views.size()), {}};
  for (std::uint32_t t = 0; t < surface.is_due.size(); ++t)
    if (surface.is_due[t]) work.not_seen_yet.push_back(t);
  // Cutting moves no surface by more than a step of the lattice: depth is rendered once.
  const std::vector<std::optional<ViewVisibility>> tests = visibility_tests(work, views, config);
  find_visibility(tests, work);
  for (int round = 0; round < kCutRounds && cut_occlusion_edges(work, config); ++round)
    find_visibility(tests, work);
  if (config.views == AtlasConfig::Views::coherent) {
    choose_coherent(work, views, config);
  } else {
    for (std::size_t t = 0; t < surface.label.size(); ++t)
      if (surface.is_due[t]) surface.label[t] = best_view(work.visibility, t);
  }
  gather_pieces(surface);
}

void label_part(Labelling& surface, std::span<const View> views, const LabelConfig& config) {
  DuePart part(surface, kNormalRounds + 1);
  label(part.labelling, views, config);
  part.put_back(surface);
}

}  // namespace

Labelling Labelling::of(Mesh surface) {
  Labelling out;
  const std::size_t count = surface.triangles.size();
  out.mesh = std::move(surface);
  out.mesh.views.clear();
  out.label.assign(count, kNone), out.is_due.assign(count, 1);
  out.origin.resize(count);
  std::iota(out.origin.begin(), out.origin.end(), 0u);
  return out;
}

Mesh Labelling::labelled(std::span<const View> views) const {
  std::vector<ViewId> ids;
  Mesh out;
  out.positions = mesh.positions;
  for (std::size_t t = 0; t < label.size(); ++t) {
    const Vec3f a = mesh.corner(t, 0), b = mesh.corner(t, 1), c = mesh.corner(t, 2);
    if (a == b || b == c || c == a) continue;  // what splitting left of a sliver
    out.triangles.push_back(mesh.triangles[t]);
    ids.push_back(label[t] == kNone ? kNoView : views[label[t]].id);
  }
  set_triangle_views(out, ids);
  // On the lattice, vertices of cuts may meet those of another sheet.
  const std::vector<std::uint32_t> place =
      cut_edges.empty() ? std::vector<std::uint32_t>{} : kit::same_place(out.positions);
  for (std::uint32_t v = 0; v < place.size(); ++v)
    if (place[v] != v) return kit::without_nonmanifold_edges(kit::weld(out));
  return out;
}

void label_due(Labelling& surface, std::span<const View> views, const LabelConfig& config) {
  const auto due = static_cast<std::size_t>(std::ranges::count(surface.is_due, 1));
  if (due == 0) return;
  if (due == surface.is_due.size()) return label(surface, views, config);
  label_part(surface, views, config);
  const bool is_coherent = config.views == AtlasConfig::Views::coherent;
  if (is_coherent && mark_fragments(surface, config.least_region_m2))
    label_part(surface, views, config);
}

Mesh label_triangles(const Mesh& mesh, std::span<const View> views, const LabelConfig& config) {
  Labelling surface = Labelling::of(mesh);
  label_due(surface, views, config);
  return surface.labelled(views);
}

}  // namespace mr::atlas
