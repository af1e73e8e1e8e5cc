#include "mr/eval/floor_map.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "mr/eval/skeleton.h"

namespace mr::eval {

Vec3d any_horizontal(Vec3d up) {
  const Vec3d off = std::abs(up.x) < 0.9 ? Vec3d{1, 0, 0} : Vec3d{0, 1, 0};
  return normalized(off - up * dot(off, up));
}

// --- the floor's height

namespace {

constexpr double kFacesUp = 0.8;  // cosine to the vertical
constexpr double kLevel_m = 0.2;  // thickness of one level: sensors disagree by centimetres

struct Slice {
  double height_m = 0, area_m2 = 0;
};

bool lower(const Slice& a, const Slice& b) { return a.height_m < b.height_m; }

double total_area(std::span<const Slice> slices) {
  return std::accumulate(slices.begin(), slices.end(), 0.0,
                         [](double sum, const Slice& s) { return sum + s.area_m2; });
}

/// Triangles by height; `least_cosine` of their normal with `up`.
std::vector<Slice> slices_of(const Mesh& mesh, Vec3d up, double least_cosine) {
  std::vector<Slice> out;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const Vec3d normal = vec_cast<double>(mesh.area_normal(t));
    if (dot(normal, up) < least_cosine * length(normal)) continue;
    out.push_back({dot(vec_cast<double>(mesh.centroid(t)), up), 0.5 * length(normal)});
  }
  std::stable_sort(out.begin(), out.end(), lower);
  return out;
}

double percentile_m(std::span<const Slice> slices, double share) {
  double left = share * total_area(slices);
  for (const Slice& slice : slices)
    if ((left -= slice.area_m2) <= 0) return slice.height_m;
  return slices.back().height_m;
}

/// What each slice and those less than a level above it hold together.
std::vector<double> areas_of_levels(std::span<const Slice> slices) {
  std::vector<double> out(slices.size());
  double sum = 0;
  for (std::size_t i = slices.size(), end = slices.size(); i-- > 0;) {
    sum += slices[i].area_m2;
    while (slices[end - 1].height_m > slices[i].height_m + kLevel_m) sum -= slices[--end].area_m2;
    out[i] = sum;
  }
  return out;
}

double mean_height_m(std::span<const Slice> slices) {
  double sum = 0;
  for (const Slice& s : slices) sum += s.height_m * s.area_m2;
  return sum / total_area(slices);
}

}  // namespace

double floor_height_m(const Mesh& captured, Vec3d up) {
  constexpr double kFairShare = 0.25;  // of the largest level
  constexpr double kNothing = 0.02;    // of all surface
  MR_ASSERT(!captured.empty());
  const std::vector<Slice> all = slices_of(captured, up, -2),
                           facing = slices_of(captured, up, kFacesUp);
  const double area = total_area(facing);
  if (area <= 0 || area < kNothing * total_area(all)) return percentile_m(all, 0.02);
  const std::vector<double> levels = areas_of_levels(facing);
  const double fair = kFairShare * *std::max_element(levels.begin(), levels.end());
  const auto first =
      std::find_if(levels.begin(), levels.end(), [&](double level) { return level >= fair; });
  const std::size_t begin = first - levels.begin();
  std::size_t best = begin;
  for (std::size_t i = begin;
       i < levels.size() && facing[i].height_m <= facing[begin].height_m + kLevel_m; ++i)
    if (levels[i] > levels[best]) best = i;
  const Slice above{facing[best].height_m + kLevel_m, 0};
  const auto end = std::upper_bound(facing.begin(), facing.end(), above, lower);
  return mean_height_m(std::span(facing).subspan(best, end - facing.begin() - best));
}

// --- the captured hull

std::vector<Vec2d> convex_hull(std::vector<Vec2d> points) {
  std::sort(points.begin(), points.end());
  points.erase(std::unique(points.begin(), points.end()), points.end());
  if (points.size() < 3) return points;
  const auto turn = [](Vec2d a, Vec2d b, Vec2d c) {
    return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
  };
  std::vector<Vec2d> hull;  // Andrew's monotone chain
  for (const bool upper : {false, true}) {
    const std::size_t base = hull.size();
    for (std::size_t i = 0; i < points.size(); ++i) {
      const Vec2d p = upper ? points[points.size() - 1 - i] : points[i];
      while (hull.size() >= base + 2 && turn(hull[hull.size() - 2], hull.back(), p) <= 0)
        hull.pop_back();
      hull.push_back(p);
    }
    hull.pop_back();
  }
  return hull;
}

namespace {

/// A rectangle, turned: `x` is a unit vector along its longer side.
struct Rectangle {
  Vec2d x{1, 0}, low, high;  ///< low and high along x and its normal

  Vec2d size() const { return high - low; }
};

Vec2d along(Vec2d x, Vec2d p) { return {p.x * x.x + p.y * x.y, p.y * x.x - p.x * x.y}; }

Rectangle around(const std::vector<Vec2d>& hull, Vec2d x) {
  Rectangle out{x, along(x, hull[0]), along(x, hull[0])};
  for (const Vec2d p : hull) {
    const Vec2d q = along(x, p);
    out.low = {std::min(out.low.x, q.x), std::min(out.low.y, q.y)};
    out.high = {std::max(out.high.x, q.x), std::max(out.high.y, q.y)};
  }
  return out;
}

/// The smallest one around a hull; it shares an edge with it.
Rectangle smallest_rectangle(const std::vector<Vec2d>& hull) {
  const auto area = [](const Rectangle& r) { return r.size().x * r.size().y; };
  Rectangle best = around(hull, {1, 0});
  for (std::size_t i = 0; i < hull.size(); ++i) {
    const Vec2d edge = hull[(i + 1) % hull.size()] - hull[i];
    const double len = std::hypot(edge.x, edge.y);
    if (len <= 0) continue;
    const Rectangle r = around(hull, edge * (1 / len));
    if (area(r) < (1 - 1e-9) * area(best)) best = r;
  }
  if (best.size().x < best.size().y) best = around(hull, {-best.x.y, best.x.x});
  if (best.x.x < 0) best = around(hull, {-best.x.x, -best.x.y});
  return best;
}

bool inside(const std::vector<Vec2d>& hull, Vec2d p) {
  for (std::size_t i = 0; i < hull.size(); ++i) {
    const Vec2d a = hull[i], b = hull[(i + 1) % hull.size()];
    if ((b.x - a.x) * (p.y - a.y) - (b.y - a.y) * (p.x - a.x) < 0) return false;
  }
  return hull.size() >= 3;
}

/// The hull from above, in the frame of (ahead, side).
std::vector<Vec2d> hull_from_above(const Mesh& captured, std::span<const Pose> sensors, Vec3d ahead,
                                   Vec3d side) {
  std::vector<std::uint8_t> used(captured.positions.size());
  for (const Triangle& triangle : captured.triangles)
    for (const std::uint32_t v : triangle) used[v] = 1;
  std::vector<Vec2d> points;
  for (std::size_t v = 0; v < used.size(); ++v) {
    const Vec3d p = vec_cast<double>(captured.positions[v]);
    if (used[v]) points.push_back({dot(ahead, p), dot(side, p)});
  }
  for (const Pose& sensor : sensors)
    points.push_back({dot(ahead, sensor.translation), dot(side, sensor.translation)});
  return convex_hull(std::move(points));
}

// --- what is where on the floor

/// Calls point(p_floor, area) at points spread over a triangle, at most half a cell apart.
template <typename Point>
void spread(const std::array<Vec3d, 3>& corners, double area, double step_m, const Point& point) {
  constexpr double kMostSteps = 4000;  // as long as the largest map
  const Vec3d a = corners[0], ab = corners[1] - a, ac = corners[2] - a;
  const double longest = std::max({length(ab), length(ac), length(ac - ab)});
  const int n = static_cast<int>(std::clamp(std::ceil(longest / step_m), 1.0, kMostSteps));
  const double each = area / (static_cast<double>(n) * n);
  for (int i = 0; i < n; ++i)
    for (int j = 0; i + j < n; ++j) {  // the small triangle (i, j), and its neighbour upside down
      point(a + ab * ((i + 1 / 3.0) / n) + ac * ((j + 1 / 3.0) / n), each);
      if (i + j < n - 1) point(a + ab * ((i + 2 / 3.0) / n) + ac * ((j + 2 / 3.0) / n), each);
    }
}

/// Area per cell of what stands in the way and of captured floor.
struct Occupancy {
  std::vector<double> obstacle_m2, floor_m2;
};

Occupancy occupancy(const FloorMap& map, const Mesh& captured, const ViewpointConfig& config) {
  constexpr double kFloorBand_m = 0.15;
  Occupancy out{std::vector<double>(map.cells.size()), std::vector<double>(map.cells.size())};
  const Pose T_floor_world = map.T_world_floor.inverse();
  for (std::size_t t = 0; t < captured.triangles.size(); ++t) {
    std::array<Vec3d, 3> corners;
    for (int i = 0; i < 3; ++i)
      corners[i] = T_floor_world * vec_cast<double>(captured.corner(t, i));
    const Vec3d normal = cross(corners[1] - corners[0], corners[2] - corners[0]);
    const bool faces_up = normal.z > kFacesUp * length(normal);
    const auto [low, high] = std::minmax({corners[0].z, corners[1].z, corners[2].z});
    const bool in_the_way = high >= config.obstacle_low_m && low <= config.obstacle_high_m;
    const bool floor = faces_up && high >= -kFloorBand_m && low <= kFloorBand_m;
    if (!in_the_way && !floor) continue;
    spread(corners, 0.5 * length(normal), 0.5 * map.cell_m, [&](Vec3d p, double area) {
      const int x = std::clamp(static_cast<int>(p.x / map.cell_m), 0, map.width - 1);
      const int y = std::clamp(static_cast<int>(p.y / map.cell_m), 0, map.height - 1);
      const std::size_t cell = static_cast<std::size_t>(y) * map.width + x;
      if (p.z >= config.obstacle_low_m && p.z <= config.obstacle_high_m)
        out.obstacle_m2[cell] += area;
      else if (floor && std::abs(p.z) <= kFloorBand_m)
        out.floor_m2[cell] += area;
    });
  }
  return out;
}

void mark_cells(FloorMap& map, const std::vector<Vec2d>& hull, const Occupancy& occupied) {
  const double least_m2 = 0.1 * map.cell_m * map.cell_m;  // less is a speck of noise
  for (int y = 0; y < map.height; ++y)
    for (int x = 0; x < map.width; ++x) {
      const std::size_t cell = static_cast<std::size_t>(y) * map.width + x;
      const Vec2d middle{(x + 0.5) * map.cell_m, (y + 0.5) * map.cell_m};
      map.cells[cell] = occupied.obstacle_m2[cell] > least_m2 ? FloorMap::obstacle
                        : inside(hull, middle)                ? FloorMap::free
                                                              : FloorMap::unknown;
    }
  for (int x = 0; x < map.width;
       ++x)  // a frame around all, so that every cell has eight neighbours
    map.cells[x] = map.cells[map.cells.size() - 1 - x] = FloorMap::unknown;
  for (int y = 0; y < map.height; ++y)
    map.cells[static_cast<std::size_t>(y) * map.width] =
        map.cells[static_cast<std::size_t>(y + 1) * map.width - 1] = FloorMap::unknown;
}

/// The part that each free cell belongs to, its own or that of the nearest one on free ground.
void grow(ConnectedComponents& parts, const FloorMap& map) {
  std::vector<std::int32_t> open;
  for (std::size_t i = 0; i < map.cells.size(); ++i)
    if (parts.of_cell[i] >= 0) open.push_back(static_cast<std::int32_t>(i));
  for (std::size_t next = 0; next < open.size(); ++next) {
    const auto around = ring(open[next], map.width);
    for (int k = 0; k < 8; k += 2)
      if (map.cells[around[k]] == FloorMap::free && parts.of_cell[around[k]] < 0)
        parts.of_cell[around[k]] = parts.of_cell[open[next]], open.push_back(around[k]);
  }
}

/// The cell below a point; -1 outside the map.
std::int32_t cell_below(const FloorMap& map, Vec3d p_world) {
  const Vec3d p = map.T_world_floor.inverse() * p_world;
  const double x = std::floor(p.x / map.cell_m), y = std::floor(p.y / map.cell_m);
  if (x < 0 || y < 0 || x >= map.width || y >= map.height) return -1;
  return static_cast<std::int32_t>(y) * map.width + static_cast<std::int32_t>(x);
}

/// The hull of a place that bends holds ground behind its walls. Walkable parts that hold no sensor
/// and of which next to no floor was captured become unknown, unless that is so of all of them.
void forget_unseen_parts(FloorMap& map, const Occupancy& occupied, std::span<const Pose> sensors,
                         double clearance_m) {
  constexpr double kSeen = 0.1;
  ConnectedComponents parts = connected_components(walkable(map, clearance_m), map.width, false);
  grow(parts, map);
  std::vector<double> cells(parts.count), seen(parts.count);
  for (std::size_t i = 0; i < map.cells.size(); ++i)
    if (parts.of_cell[i] >= 0)
      cells[parts.of_cell[i]] += 1, seen[parts.of_cell[i]] += occupied.floor_m2[i] > 0;
  for (const Pose& sensor : sensors) {
    const std::int32_t cell = cell_below(map, sensor.translation);
    const std::int32_t part = cell < 0 ? -1 : parts.of_cell[cell];
    if (part >= 0) seen[part] += cells[part];
  }
  const auto unseen = [&](std::int32_t part) { return seen[part] < kSeen * cells[part]; };
  bool any = false;
  for (std::int32_t part = 0; part < parts.count; ++part) any |= !unseen(part);
  if (!any) return;
  for (std::size_t i = 0; i < map.cells.size(); ++i)
    if (parts.of_cell[i] >= 0 && unseen(parts.of_cell[i])) map.cells[i] = FloorMap::unknown;
}

/// An empty map under the hull, with a frame of two cells around it.
Result<FloorMap> frame_map(const Rectangle& r, Vec3d ahead, Vec3d side, Vec3d up, double floor_m,
                           double cell_m) {
  constexpr double kMostCells = 4e6;
  const double width = std::ceil(r.size().x / cell_m) + 4,
               height = std::ceil(r.size().y / cell_m) + 4;
  if (width * height > kMostCells)
    return Error{
        Error::Cause::too_large,
        fmt::format("the captured surface is {:.0f} x {:.0f} m wide: too large for a floor plan",
                    r.size().x, r.size().y)};
  FloorMap map;
  map.width = static_cast<int>(width), map.height = static_cast<int>(height);
  map.cell_m = cell_m;
  const Vec3d x = ahead * r.x.x + side * r.x.y, y = cross(up, x);
  const Vec3d corner = x * (r.low.x - 2 * cell_m) + y * (r.low.y - 2 * cell_m) + up * floor_m;
  map.T_world_floor = {{{x.x, y.x, up.x, x.y, y.y, up.y, x.z, y.z, up.z}}, corner};
  map.cells.resize(static_cast<std::size_t>(map.width) * map.height);
  return map;
}

}  // namespace

Vec3d world_point(const FloorMap& map, std::int32_t cell, double height_m) {
  return map.T_world_floor * Vec3d{(cell % map.width + 0.5) * map.cell_m,
                                   (cell / map.width + 0.5) * map.cell_m, height_m};
}

Result<FloorMap> map_floor(const Mesh& captured, std::span<const Pose> sensors, Vec3d up,
                           const ViewpointConfig& config) {
  const Vec3d ahead = any_horizontal(up), side = cross(up, ahead);
  std::vector<Vec2d> hull = hull_from_above(captured, sensors, ahead, side);
  const Rectangle r = smallest_rectangle(hull);
  auto map = frame_map(r, ahead, side, up, floor_height_m(captured, up), config.cell_m);
  if (!map) return map;
  for (Vec2d& p : hull) p = along(r.x, p) - r.low + Vec2d{2 * config.cell_m, 2 * config.cell_m};
  const Occupancy occupied = occupancy(*map, captured, config);
  mark_cells(*map, hull, occupied);
  measure_clearance(*map);
  forget_unseen_parts(*map, occupied, sensors, config.clearance_m);
  find_skeleton(*map, config.clearance_m);
  return map;
}

}  // namespace mr::eval
