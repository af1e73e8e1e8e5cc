#include "mr/merge/overlap/free_space_carver.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "mr/kit/raster.h"

namespace mr::merge {
namespace {

constexpr int kCaptures = 15;                // in a row, before a place counts as empty
constexpr double kLeastArea_m2 = 0.005;      // of places that touch each other
constexpr double kTolerances = 3;            // so many times what may be one surface lies beyond
constexpr int kAround_px = 2;                // of the other's view
constexpr double kNear_voxels = 10;          // of a tile: what is one thing
constexpr std::uint64_t kDisputeTurns = 64;  // updates to check all tiles once for disputes

/// Area of a tile at a depth.
double area_m2(const StillSurfaceMask::SensorView& own, int tile_px, double depth_m) {
  const double edge_m = depth_m * tile_px * own.scale / own.camera.fx;
  return edge_m * edge_m;
}

}  // namespace

/// Whether another sensor measures still surface well behind that of the own sensor at a pixel.
bool FreeSpaceCarver::sees_past(const StillSurfaceMask::SensorView& own,
                                const StillSurfaceMask::SensorView& other,
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
  // In all neighbours, too: beside a thin object, such as a chair's back, others see past it.
  const int last_row = std::min(v + kAround_px, other.own.height - 1),
            last_column = std::min(u + kAround_px, other.own.width - 1);
  for (int row = std::max(v - kAround_px, 0); row <= last_row; ++row)
    for (int column = std::max(u - kAround_px, 0); column <= last_column; ++column) {
      const float beyond = *other.own.at(column, row);
      if (beyond > 0 && beyond <= p.z + kTolerances * tolerance_m) return false;
    }
  return *other.own.at(u, v) > 0;
}

/// Depth of a sensor's nearest surface in a tile; 0: none.
float FreeSpaceCarver::nearest_in(const StillSurfaceMask::SensorView& own, const Samples& samples) {
  float nearest = 0;
  for (const auto& [x, y] : samples)
    if (const float z = *own.own.at(x, y); z > 0 && (nearest == 0 || z < nearest)) nearest = z;
  return nearest;
}

/// Whether some other sensor sees through all of a tile's nearest surface.
bool FreeSpaceCarver::any_sees_past(const StillSurfaceMask::SensorView& own,
                                    const StillSurfaceMask& cover, const Confirmed& confirmed,
                                    const Samples& samples, float nearest) const {
  const double near_m = kNear_voxels * config_.voxel_m;
  return std::ranges::any_of(cover.views(), [&](const StillSurfaceMask::SensorView& other) {
    const auto its = confirmed.find(other.sensor);
    if (other.sensor == own.sensor || its == confirmed.end()) return false;
    return std::ranges::all_of(samples, [&](const std::array<int, 2>& at) {
      const float z = *own.own.at(at[0], at[1]);
      return z == 0 || z > nearest + near_m || sees_past(own, other, *its->second, at[0], at[1]);
    });
  });
}

/// Updates a tile that its own sensor does not confirm.
void FreeSpaceCarver::follow(const StillSurfaceMask::SensorView& own, const StillSurfaceMask& cover,
                             const Confirmed& confirmed, const Samples& samples, Tile& tile) const {
  const double near_m = kNear_voxels * config_.voxel_m;
  const float nearest = nearest_in(own, samples);
  if (nearest == 0 || (tile.is_empty && std::abs(nearest - tile.depth_m) > near_m)) {
    tile = {.disputed_m = tile.disputed_m};  // what was empty is gone, or another surface now
    return;
  }
  if (tile.is_empty) return;
  const bool is_disputed = tile.disputed_m > 0 && std::abs(nearest - tile.disputed_m) <= near_m;
  tile.depth_m = nearest;
  tile.empty_for = !is_disputed && any_sees_past(own, cover, confirmed, samples, nearest)
                       ? std::min(tile.empty_for + 1, kCaptures)
                       : 0;
}

/// Updates all tiles of a sensor. Surface that it confirms although another sensor sees through it,
/// such as the edge of an object that the other measures farther behind, is disputed and never
/// carved; some confirmed tiles per update are tested for that.
double FreeSpaceCarver::follow(const StillSurfaceMask::SensorView& own,
                               const StillSurfaceMask& cover, const Confirmed& confirmed,
                               Tiles& tiles) const {
  const TileMask& mine = *confirmed.at(own.sensor);
  const auto samples_of = [&](int column, int row) {
    Samples out;
    for (int i = 0; i < 9; ++i) {
      const auto place = [&](int t, int third, int size) {
        const double at = (t + 0.1 + 0.4 * third) * tiles.tile_px * own.scale;
        return std::min(static_cast<int>(at), size - 1);
      };
      out[i] = {place(column, i % 3, own.own.width), place(row, i / 3, own.own.height)};
    }
    return out;
  };
  double changed_m2 = 0;
  for (int row = 0; row < tiles.rows; ++row)
    for (int column = 0; column < tiles.columns; ++column) {
      const std::size_t number = static_cast<std::size_t>(row) * tiles.columns + column;
      Tile& tile = tiles.tiles[number];
      if (!mine.at(column, row)) {
        follow(own, cover, confirmed, samples_of(column, row), tile);
        continue;
      }
      if (tile.is_empty) changed_m2 += area_m2(own, tiles.tile_px, tile.depth_m);
      tile = {.disputed_m = tile.disputed_m};
      if ((number + updates_) % kDisputeTurns != 0) continue;
      const Samples samples = samples_of(column, row);
      const float nearest = nearest_in(own, samples);
      if (nearest > 0 && any_sees_past(own, cover, confirmed, samples, nearest))
        tile.disputed_m = nearest;
    }
  return changed_m2;
}

double FreeSpaceCarver::update(const StillSurfaceMask& cover, std::span<const SourceInfo> sources) {
  Confirmed confirmed;
  for (const SourceInfo& source : sources)
    if (!source.confirmed_depth.empty()) confirmed[source.sensor] = &source.confirmed_depth;
  double changed_m2 = 0;
  for (const StillSurfaceMask::SensorView& own : cover.views()) {
    const auto mine = confirmed.find(own.sensor);
    if (mine == confirmed.end()) continue;
    Tiles& tiles = tiles_[own.sensor];
    const TileMask& mask = *mine->second;
    if (tiles.columns != mask.columns || tiles.rows != mask.rows)
      tiles = {
          mask.tile_px, mask.columns, mask.rows, std::vector<Tile>(mask.tiles.size()), 1, {}, {}};
    tiles.scale = own.scale, tiles.camera = own.camera, tiles.T_camera_world = own.T_camera_world;
    changed_m2 += follow(own, cover, confirmed, tiles);
    changed_m2 += find_large(own, tiles);
  }
  ++updates_;
  return changed_m2;
}

/// Carves connected tiles that have been empty for long enough and have enough area together.
double FreeSpaceCarver::find_large(const StillSurfaceMask::SensorView& own, Tiles& tiles) const {
  std::vector<std::uint8_t> seen(tiles.tiles.size());
  double changed_m2 = 0;
  for (std::size_t first = 0; first < tiles.tiles.size(); ++first) {
    if (seen[first] || tiles.tiles[first].empty_for < kCaptures) continue;
    std::vector<std::size_t> region{first};
    seen[first] = 1;
    double all_m2 = 0;
    for (std::size_t i = 0; i < region.size(); ++i) {
      all_m2 += area_m2(own, tiles.tile_px, tiles.tiles[region[i]].depth_m);
      const int column = static_cast<int>(region[i]) % tiles.columns,
                row = static_cast<int>(region[i]) / tiles.columns;
      for (int y = std::max(row - 1, 0); y <= std::min(row + 1, tiles.rows - 1); ++y)
        for (int x = std::max(column - 1, 0); x <= std::min(column + 1, tiles.columns - 1); ++x) {
          const std::size_t t = static_cast<std::size_t>(y) * tiles.columns + x;
          if (!std::exchange(seen[t], 1) && tiles.tiles[t].empty_for >= kCaptures)
            region.push_back(t);
        }
    }
    if (all_m2 < kLeastArea_m2) continue;
    for (const std::size_t t : region)
      if (!std::exchange(tiles.tiles[t].is_empty, true))
        changed_m2 += area_m2(own, tiles.tile_px, tiles.tiles[t].depth_m);
  }
  return changed_m2;
}

Mesh FreeSpaceCarver::carved(const Mesh& still) const {
  std::vector<std::uint8_t> keep(still.triangles.size(), 1);
  bool any = false;
  for (const SensorRun& run : still.sensors) {
    const auto found = tiles_.find(run.id);
    if (found == tiles_.end()) continue;
    const Tiles& tiles = found->second;
    if (std::ranges::none_of(tiles.tiles, &Tile::is_empty)) continue;
    for (std::uint32_t t = run.first; t < run.first + run.count; ++t) {
      const Vec3d p = tiles.T_camera_world * vec_cast<double>(still.centroid(t));
      if (p.z <= kit::kNearPlane_m) continue;
      const kit::ScreenPoint s = kit::to_screen(tiles.camera, p);
      const int column = static_cast<int>(std::floor(s.u / tiles.scale / tiles.tile_px)),
                row = static_cast<int>(std::floor(s.v / tiles.scale / tiles.tile_px));
      if (column < 0 || row < 0 || column >= tiles.columns || row >= tiles.rows) continue;
      const Tile& tile = tiles.tiles[static_cast<std::size_t>(row) * tiles.columns + column];
      keep[t] = !tile.is_empty || std::abs(p.z - tile.depth_m) > kNear_voxels * config_.voxel_m;
      any |= keep[t] == 0;
    }
  }
  return any ? select_triangles(still, keep) : still;
}

}  // namespace mr::merge
