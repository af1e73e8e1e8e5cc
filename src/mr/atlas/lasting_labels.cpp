#include "mr/atlas/lasting_labels.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "mr/core/assert.h"
#include "mr/core/hash.h"
#include "mr/core/parallel.h"
#include "mr/kit/raster.h"
#include "mr/kit/topology.h"

namespace mr::atlas {
namespace {

constexpr int kTile_px = 16;
constexpr std::uint32_t kNoVertex = 0xFFFFFFFFu;

/// The corners of a triangle, the smallest first; the winding stays.
std::array<Vec3f, 3> corners_of(const Mesh& mesh, const Triangle& triangle) {
  std::array<Vec3f, 3> out{mesh.positions[triangle[0]], mesh.positions[triangle[1]],
                           mesh.positions[triangle[2]]};
  std::rotate(out.begin(), std::min_element(out.begin(), out.end()), out.end());
  return out;
}

/// [T] hashes of the triangles' corners.
std::vector<std::uint64_t> keys_of(const Mesh& mesh) {
  std::vector<std::uint64_t> out(mesh.triangles.size());
  parallel_for(out.size(), 4096, [&](std::size_t begin, std::size_t end) {
    for (std::size_t t = begin; t < end; ++t) {
      Hash hash;
      for (const Vec3f& p : corners_of(mesh, mesh.triangles[t])) hash.add(p);
      out[t] = hash.value();
    }
  });
  return out;
}

TileMask no_tiles(const View& view) {
  const int columns = (view.width + kTile_px - 1) / kTile_px,
            rows = (view.height + kTile_px - 1) / kTile_px;
  return {kTile_px, columns, rows,
          std::vector<std::uint8_t>(static_cast<std::size_t>(columns) * rows)};
}

/// Marks the tiles in which a view's depth has changed, dilated by one tile for occluders' margins.
/// `tile_px`: the width of a tile in the depth maps.
void mark_other_depth(const ImageDepth& before, const ImageDepth& now, int tile_px,
                      TileMask& tiles) {
  constexpr float kOther_m = 0.05f;
  // Of a tile: a depth edge that moves by a pixel is ignored.
  const int least_px = tile_px * tile_px * 40 / (kTile_px * kTile_px);
  std::vector<std::uint8_t> other(tiles.tiles.size());
  for (int row = 0; row < tiles.rows; ++row)
    for (int column = 0; column < tiles.columns; ++column) {
      int count = 0;
      const int x_end = std::min((column + 1) * tile_px, now.width);
      for (int y = row * tile_px; y < std::min((row + 1) * tile_px, now.height); ++y)
        for (int x = column * tile_px; x < x_end; ++x)
          count += std::abs(*before.at(x, y) - *now.at(x, y)) > kOther_m;  // 0: no surface
      other[static_cast<std::size_t>(row) * tiles.columns + column] = count >= least_px;
    }
  for (int row = 0; row < tiles.rows; ++row)
    for (int column = 0; column < tiles.columns; ++column) {
      if (!other[static_cast<std::size_t>(row) * tiles.columns + column]) continue;
      for (int y = std::max(row - 1, 0); y <= std::min(row + 1, tiles.rows - 1); ++y)
        for (int x = std::max(column - 1, 0); x <= std::min(column + 1, tiles.columns - 1); ++x)
          tiles.tiles[static_cast<std::size_t>(y) * tiles.columns + x] = 1;
    }
}

/// Projects a mesh's vertices into a pinhole view; NaN: at or behind its near plane.
std::vector<Vec2f> screen_points(const Mesh& mesh, const View& view) {
  const Camera camera = view.camera();
  const Pose T_camera_world = view.T_world_camera.inverse();
  std::vector<Vec2f> out(mesh.positions.size());
  for (std::size_t i = 0; i < out.size(); ++i) {
    const Vec3d p = T_camera_world * vec_cast<double>(mesh.positions[i]);
    constexpr float kNowhere = std::numeric_limits<float>::quiet_NaN();
    out[i] = {kNowhere, kNowhere};
    if (p.z <= kit::kNearPlane_m) continue;
    const kit::ScreenPoint s = kit::to_screen(camera, p);
    out[i] = {static_cast<float>(s.u), static_cast<float>(s.v)};
  }
  return out;
}

/// Whether a tile is set in the box around three points; points behind a camera are in none.
bool any_tile(const TileMask& mask, Vec2f a, Vec2f b, Vec2f c) {
  const auto tile = [&](float px, int count) {
    return static_cast<int>(std::floor(
        std::clamp(px / static_cast<float>(mask.tile_px), -1.0f, static_cast<float>(count))));
  };
  if (!(std::abs(a.x + b.x + c.x) < std::numeric_limits<float>::max())) return false;
  const int x0 = std::max(tile(std::min({a.x, b.x, c.x}), mask.columns), 0),
            x1 = std::min(tile(std::max({a.x, b.x, c.x}), mask.columns), mask.columns - 1),
            y0 = std::max(tile(std::min({a.y, b.y, c.y}), mask.rows), 0),
            y1 = std::min(tile(std::max({a.y, b.y, c.y}), mask.rows), mask.rows - 1);
  for (int y = y0; y <= y1; ++y)
    for (int x = x0; x <= x1; ++x)
      if (mask.at(x, y)) return true;
  return false;
}

/// Cuts the edges of whole triangles where a carried-over neighbour was cut: no T-junction is left.
void meet_cuts(Labelling& next) {
  const std::size_t first_cut = next.mesh.positions.size() - next.cut_edges.size();
  std::map<std::array<std::uint32_t, 2>, std::uint32_t> middle;  // midpoint vertex of a cut edge
  const auto key = [](std::uint32_t a, std::uint32_t b) {
    return std::array{std::min(a, b), std::max(a, b)};
  };
  for (std::size_t i = 0; i < next.cut_edges.size(); ++i)
    middle.emplace(key(next.cut_edges[i][0], next.cut_edges[i][1]),
                   static_cast<std::uint32_t>(first_cut + i));
  for (bool any = !middle.empty(); any;) {
    std::vector<std::uint8_t> split(3 * next.mesh.triangles.size());
    any = false;
    for (std::uint32_t h = 0; h < split.size(); ++h) {
      if (!next.is_due[h / 3]) continue;
      split[h] = middle.contains(key(kit::edge_from(next.mesh, h), kit::edge_to(next.mesh, h)));
      any |= split[h] != 0;
    }
    if (!any) return;
    kit::Refined refined = kit::refine(next.mesh, split);
    const auto known = static_cast<std::uint32_t>(next.mesh.positions.size());
    for (Triangle& triangle : refined.mesh.triangles)
      for (std::uint32_t& v : triangle)
        if (v >= known) {
          const auto& [from, to] = refined.cut_edges[v - known];
          v = middle.at(key(from, to));
        }
    Labelling cut;
    for (const std::uint32_t parent : refined.parent) {
      cut.label.push_back(next.label[parent]), cut.is_due.push_back(next.is_due[parent]);
      cut.origin.push_back(next.origin[parent]);
    }
    next.mesh.triangles = std::move(refined.mesh.triangles);
    next.label = std::move(cut.label), next.is_due = std::move(cut.is_due);
    next.origin = std::move(cut.origin);
  }
}

}  // namespace

/// Whether the labels of the last call are valid for these views.
bool LastingLabels::may_keep(std::span<const View> views) const {
  const auto same = [](const View& a, const View& b) {
    return a.kind == View::Kind::pinhole && a.kind == b.kind && a.id == b.id &&
           a.camera() == b.camera() && a.T_world_camera == b.T_world_camera &&
           a.image_rect == b.image_rect && a.gutter_px == b.gutter_px;
  };
  return std::ranges::equal(views, views_, same);
}

bool LastingLabels::is_last_surface(const Mesh& surface) const {
  const std::size_t vertices = last_.mesh.positions.size() - last_.cut_edges.size();
  return surface.triangles == triangles_ && surface.positions.size() == vertices &&
         std::equal(surface.positions.begin(), surface.positions.end(),
                    last_.mesh.positions.begin());
}

/// Index of a triangle in the last surface; nothing: it is new.
std::optional<std::uint32_t> LastingLabels::last_place(const Mesh& surface, std::size_t t,
                                                       std::uint64_t key) const {
  const std::uint32_t* const found = place_.find(key);
  if (!found ||
      corners_of(surface, surface.triangles[t]) != corners_of(last_.mesh, triangles_[*found]))
    return std::nullopt;
  return *found;
}

/// The surface with unchanged triangles split and labelled as before; new triangles are unsplit and
/// due.
Labelling LastingLabels::carry_over(const Mesh& surface,
                                    std::span<const std::uint64_t> keys) const {
  Labelling next;
  next.mesh.positions = surface.positions;
  next.mesh.triangles.reserve(last_.label.size()), next.label.reserve(last_.label.size());
  next.is_due.reserve(last_.label.size()), next.origin.reserve(last_.label.size());
  const std::size_t first_cut = last_.mesh.positions.size() - last_.cut_edges.size();
  std::vector<std::uint32_t> moved(last_.mesh.positions.size(), kNoVertex);  // last → next vertex
  const auto move = [&](const auto& self, std::uint32_t v) -> std::uint32_t {
    if (moved[v] != kNoVertex || v < first_cut) return moved[v];
    const auto& [a, b] = last_.cut_edges[v - first_cut];
    const std::array<std::uint32_t, 2> ends{self(self, a), self(self, b)};
    moved[v] = static_cast<std::uint32_t>(next.mesh.positions.size());
    next.mesh.positions.push_back(last_.mesh.positions[v]);
    next.cut_edges.push_back(ends);
    return moved[v];
  };
  const auto add = [&](const Triangle& triangle, int label, bool is_due, std::uint32_t origin) {
    next.mesh.triangles.push_back(triangle);
    next.label.push_back(label), next.is_due.push_back(is_due), next.origin.push_back(origin);
  };
  for (std::uint32_t t = 0; t < surface.triangles.size(); ++t) {
    const auto place = last_place(surface, t, keys[t]);
    if (!place) {
      add(surface.triangles[t], Labelling::kNone, true, t);
      continue;
    }
    for (const std::uint32_t v : surface.triangles[t])
      for (const std::uint32_t u : triangles_[*place])
        if (last_.mesh.positions[u] == surface.positions[v]) moved[u] = v;
    for (std::uint32_t p = first_piece_[*place]; p < first_piece_[*place + 1]; ++p) {
      Triangle piece = last_.mesh.triangles[p];
      for (std::uint32_t& v : piece) v = move(move, v);
      add(piece, last_.label[p], false, t);
    }
  }
  meet_cuts(next);
  return next;
}

std::vector<LastingLabels::Changes> LastingLabels::changes(
    std::span<const View> views, const Occluders& now,
    const std::map<ViewId, TileMask>& valid) const {
  std::vector<Changes> out(views.size());
  parallel_for(views.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      TileMask& other = out[i].other = no_tiles(views[i]);
      const auto *before = occluders_->faces(views[i]), *after = now.faces(views[i]);
      mark_other_depth(before->front(), after->front(), kTile_px / depth_divisor(views[i].camera()),
                       other);
      out[i].better = other;
      const auto was = valid_.find(views[i].id), is = valid.find(views[i].id);
      MR_ASSERT(was == valid_.end() || was->second.tile_px == kTile_px);
      MR_ASSERT(is == valid.end() || is->second.tile_px == kTile_px);
      const auto is_set = [&](auto found, auto none, int column, int row) {
        return found == none || (column < found->second.columns && row < found->second.rows &&
                                 found->second.at(column, row));
      };
      for (int row = 0; row < other.rows; ++row)
        for (int column = 0; column < other.columns; ++column) {
          const bool good = is_set(is, valid.end(), column, row);
          if (good == is_set(was, valid_.end(), column, row)) continue;
          const std::size_t tile = static_cast<std::size_t>(row) * other.columns + column;
          (good ? out[i].better : other).tiles[tile] = 1;
        }
    }
  });
  return out;
}

Mesh LastingLabels::update(const Mesh& surface, std::span<const View> views, LabelConfig config,
                           Extent extent) {
  const bool may_carry = !last_.mesh.empty() && may_keep(views);
  kept_surface_ = may_carry && is_last_surface(surface);
  const bool quick = may_carry && extent == Extent::new_surface;
  const bool was_old =
      std::exchange(occluders_are_old_, quick && (occluders_are_old_ || !kept_surface_));
  const bool keep = quick || (kept_surface_ && !was_old);
  const auto now = keep ? occluders_ : std::make_shared<const Occluders>(surface, views);
  const std::vector<std::uint64_t> keys = keys_of(surface);
  Labelling next;
  if (extent == Extent::everything || !may_carry) {
    next = Labelling::of(surface);
    config.occluders = nullptr;
  } else {
    next = carry_over(surface, keys);
    const std::vector<Changes> changed = changes(views, *now, config.valid);
    for (std::size_t i = 0; i < views.size(); ++i) {
      const std::vector<Vec2f> at = screen_points(next.mesh, views[i]);
      for (std::size_t t = 0; t < next.is_due.size(); ++t) {
        const auto& [a, b, c] = next.mesh.triangles[t];
        if (next.is_due[t]) continue;
        if (next.label[t] == static_cast<int>(i))
          next.is_due[t] = any_tile(changed[i].other, at[a], at[b], at[c]);
        else if (next.label[t] == Labelling::kNone)
          next.is_due[t] = any_tile(changed[i].better, at[a], at[b], at[c]);
      }
    }
    config.occluders = now.get();
  }
  constexpr float kKeepStill = 0.3f;  // the resolution along a line is two thirds of the best one's
  config.keep = kKeepStill, config.history = nullptr;
  std::optional<LabelHistory> history;
  if (may_carry && std::ranges::count(next.is_due, 1) > 0)
    config.history = &history.emplace(labelled_);
  label_due(next, views, config);
  last_ = std::move(next), occluders_ = now, valid_ = std::move(config.valid);
  remember(surface, keys, views);
  labelled_ = last_.labelled(views);
  return labelled_;
}

void LastingLabels::remember(const Mesh& surface, std::span<const std::uint64_t> keys,
                             std::span<const View> views) {
  views_.assign(views.begin(), views.end());
  triangles_ = surface.triangles;
  first_piece_.assign(triangles_.size() + 1, 0);
  for (const std::uint32_t origin : last_.origin) ++first_piece_[origin + 1];
  for (std::size_t t = 0; t < triangles_.size(); ++t) first_piece_[t + 1] += first_piece_[t];
  place_ = kit::PairMap(keys.size());
  for (std::uint32_t t = 0; t < keys.size(); ++t) place_.get_or_add(keys[t], t);
}

}  // namespace mr::atlas
