#include "mr/merge/emptiness.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "mr/kit/raster.h"

namespace mr::merge {
namespace {

constexpr int kCaptures = 15;            // in a row, before a place counts as empty
constexpr double kLeastArea_m2 = 0.005;  // of places that touch each other
constexpr double kTolerances = 3;        // so many times what may be one surface lies beyond

}  // namespace

/// Whether another sensor measures its still surface well beyond the own one's at a pixel.
bool EmptyPlaces::sees_past(const StillCover::SensorView& own, const StillCover::SensorView& other,
                            const TileMask& confirmed, int x, int y) const {
  const float z = *own.own.at(x, y);
  const Vec3d p_world =
      own.T_camera_world.inverse() * (unproject(own.camera, {double(x), double(y)}) * double(z));
  const Vec3d p = other.T_camera_world * p_world;
  if (p.z <= kit::kNearPlane_m) return false;
  const kit::ScreenPoint s = kit::to_screen(other.camera, p);
  if (!(std::abs(s.u) < 1e6 && std::abs(s.v) < 1e6)) return false;
  const int u = static_cast<int>(std::lround(s.u)), v = static_cast<int>(std::lround(s.v));
  if (!other.own.contains(u, v)) return false;
  const auto tile = [&](int pixel) {
    return static_cast<int>(pixel / other.scale) / confirmed.tile_px;
  };
  if (tile(u) >= confirmed.columns || tile(v) >= confirmed.rows || !confirmed.at(tile(u), tile(v)))
    return false;
  const double tolerance_m = 2 * std::max(own.precision.sigma_m(z), other.precision.sigma_m(p.z)) +
                             2 * config_.calibration_error_m + config_.voxel_m / 2;
  return *other.own.at(u, v) > p.z + kTolerances * tolerance_m;
}

bool EmptyPlaces::follow(const StillCover::SensorView& own, const StillCover& cover,
                         const std::map<std::uint32_t, const TileMask*>& confirmed,
                         Tiles& tiles) const {
  const TileMask& mine = *confirmed.at(own.sensor);
  bool changed = false;
  for (int row = 0; row < tiles.rows; ++row)
    for (int column = 0; column < tiles.columns; ++column) {
      Tile& tile = tiles.tiles[static_cast<std::size_t>(row) * tiles.columns + column];
      const auto place = [&](int t, double share, int size) {
        return std::min(static_cast<int>((t + share) * tiles.tile_px * own.scale), size - 1);
      };
      const int x = place(column, 0.5, own.own.width), y = place(row, 0.5, own.own.height);
      const float z = *own.own.at(x, y);
      const bool other_surface = std::abs(z - tile.depth_m) > 3 * config_.voxel_m;
      if (mine.at(column, row) || z == 0 || (tile.is_empty && other_surface)) {
        changed |= tile.is_empty;
        tile = {};
        continue;
      }
      if (tile.is_empty) continue;
      const auto is_past = [&](const StillCover::SensorView& other) {
        if (other.sensor == own.sensor || !confirmed.contains(other.sensor)) return false;
        const TileMask& its = *confirmed.at(other.sensor);
        for (const double v : {0.1, 0.5, 0.9})
          for (const double u : {0.1, 0.5, 0.9}) {
            const int px = place(column, u, own.own.width), py = place(row, v, own.own.height);
            if (*own.own.at(px, py) == 0 || !sees_past(own, other, its, px, py)) return false;
          }
        return true;
      };
      if (!std::ranges::any_of(cover.views(), is_past)) {
        tile.empty_for = 0;
      } else if (tile.empty_for < kCaptures) {
        tile.depth_m = z;
        ++tile.empty_for;
      }
    }
  return changed;
}

bool EmptyPlaces::update(const StillCover& cover, std::span<const SourceInfo> sources) {
  std::map<std::uint32_t, const TileMask*> confirmed;
  for (const SourceInfo& source : sources)
    if (!source.confirmed_depth.empty()) confirmed[source.sensor] = &source.confirmed_depth;
  bool changed = false;
  for (const StillCover::SensorView& own : cover.views()) {
    const auto mine = confirmed.find(own.sensor);
    if (mine == confirmed.end()) continue;
    Tiles& tiles = tiles_[own.sensor];
    const TileMask& mask = *mine->second;
    if (tiles.columns != mask.columns || tiles.rows != mask.rows)
      tiles = {mask.tile_px, mask.columns, mask.rows, std::vector<Tile>(mask.tiles.size())};
    changed |= follow(own, cover, confirmed, tiles);
    changed |= find_large(own, tiles);
  }
  return changed;
}

/// Of the places that have been empty for long enough, those become so for good that make up enough
/// area together.
bool EmptyPlaces::find_large(const StillCover::SensorView& own, Tiles& tiles) const {
  const double pixel_rad = 1 / (own.camera.fx / own.scale);
  std::vector<std::uint8_t> seen(tiles.tiles.size());
  bool changed = false;
  for (std::size_t first = 0; first < tiles.tiles.size(); ++first) {
    if (seen[first] || tiles.tiles[first].empty_for < kCaptures) continue;
    std::vector<std::size_t> region{first};
    seen[first] = 1;
    double area_m2 = 0;
    for (std::size_t i = 0; i < region.size(); ++i) {
      const double edge_m = tiles.tiles[region[i]].depth_m * tiles.tile_px * pixel_rad;
      area_m2 += edge_m * edge_m;
      const int column = static_cast<int>(region[i]) % tiles.columns,
                row = static_cast<int>(region[i]) / tiles.columns;
      for (int y = std::max(row - 1, 0); y <= std::min(row + 1, tiles.rows - 1); ++y)
        for (int x = std::max(column - 1, 0); x <= std::min(column + 1, tiles.columns - 1); ++x) {
          const std::size_t t = static_cast<std::size_t>(y) * tiles.columns + x;
          if (!std::exchange(seen[t], 1) && tiles.tiles[t].empty_for >= kCaptures)
            region.push_back(t);
        }
    }
    if (area_m2 < kLeastArea_m2) continue;
    for (const std::size_t t : region) changed |= !std::exchange(tiles.tiles[t].is_empty, true);
  }
  return changed;
}

Mesh EmptyPlaces::without_empty(const Mesh& still, const StillCover& cover) const {
  std::vector<std::uint8_t> keep(still.triangles.size(), 1);
  bool any = false;
  for (const ViewRun& run : still.runs) {
    const auto found = tiles_.find(run.view);
    const auto* const view = cover.view_of(run.view);
    if (found == tiles_.end() || !view) continue;
    const Tiles& tiles = found->second;
    if (std::ranges::none_of(tiles.tiles, &Tile::is_empty)) continue;
    for (std::uint32_t t = run.first; t < run.first + run.count; ++t) {
      const Vec3d p = view->T_camera_world * vec_cast<double>(still.centroid(t));
      if (p.z <= kit::kNearPlane_m) continue;
      const kit::ScreenPoint s = kit::to_screen(view->camera, p);
      const int column = static_cast<int>(std::floor(s.u / view->scale / tiles.tile_px)),
                row = static_cast<int>(std::floor(s.v / view->scale / tiles.tile_px));
      if (column < 0 || row < 0 || column >= tiles.columns || row >= tiles.rows) continue;
      const Tile& tile = tiles.tiles[static_cast<std::size_t>(row) * tiles.columns + column];
      keep[t] = !tile.is_empty || std::abs(p.z - tile.depth_m) > 8 * config_.voxel_m;
      any |= keep[t] == 0;
    }
  }
  return any ? select_triangles(still, keep) : still;
}

}  // namespace mr::merge
