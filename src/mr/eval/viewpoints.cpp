#include "mr/eval/viewpoints.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <queue>
#include <unordered_map>
#include <utility>

#include "mr/core/assert.h"
#include "mr/core/parallel.h"
#include "mr/eval/floor_map.h"
#include "mr/eval/skeleton.h"
#include "mr/kit/raster.h"

namespace mr::eval {
namespace {

constexpr double radians(double degrees) { return degrees * (std::numbers::pi / 180); }

// --- what is there to see

/// The captured surface, coarse enough to be drawn hundreds of times, in patches of about 10 cm
/// that face one way.
struct Subject {
  Mesh mesh;
  std::vector<std::uint32_t> patch;  ///< [T]
  std::vector<double> area_m2;       ///< of each patch
  Vec3d middle;                      ///< centroid of the surface
  double size_m = 0;                 ///< diagonal of its box
};

/// Brings the vertices of each cell together in their middle.
Mesh coarsened(const Mesh& mesh, double cell_m) {
  std::unordered_map<Vec3i, std::uint32_t, CellHash> cells;
  std::vector<std::uint32_t> vertex(mesh.positions.size());
  std::vector<Vec3d> sums;
  std::vector<double> counts;
  for (std::size_t v = 0; v < vertex.size(); ++v) {
    const Vec3d p = vec_cast<double>(mesh.positions[v]);
    const Vec3d cell = p / cell_m;
    const auto at = [](double c) { return static_cast<std::int32_t>(std::floor(c)); };
    const auto next = static_cast<std::uint32_t>(sums.size());
    const auto [found, is_new] = cells.try_emplace({at(cell.x), at(cell.y), at(cell.z)}, next);
    if (is_new) sums.push_back({}), counts.push_back(0);
    vertex[v] = found->second;
    sums[vertex[v]] += p, counts[vertex[v]] += 1;
  }
  Mesh out;
  for (std::size_t i = 0; i < sums.size(); ++i)
    out.positions.push_back(vec_cast<float>(sums[i] / counts[i]));
  for (const Triangle& t : mesh.triangles) {
    const Triangle moved{vertex[t[0]], vertex[t[1]], vertex[t[2]]};
    if (moved[0] != moved[1] && moved[1] != moved[2] && moved[2] != moved[0])
      out.triangles.push_back(moved);
  }
  return out;
}

/// Position in cells of a patch, and the axis that it faces along most.
Vec3i patch_key(Vec3d p, Vec3d normal, double patch_m) {
  int axis = 0;
  for (int i = 1; i < 3; ++i)
    if (std::abs(normal[i]) > std::abs(normal[axis])) axis = i;
  const int facing = 2 * axis + (normal[axis] < 0);
  const auto at = [&](double c) { return static_cast<std::int32_t>(std::floor(c / patch_m)); };
  return {at(p.x) * 6 + facing, at(p.y), at(p.z)};
}

Mesh compacted(const Mesh& mesh) {
  return select_triangles(mesh, std::vector<std::uint8_t>(mesh.triangles.size(), 1));
}

Subject subject_of(const Mesh& captured) {
  constexpr double kCoarse_m = 0.04, kPatch_m = 0.1;
  constexpr std::size_t kFewTriangles = 20'000;
  Subject out;
  Mesh used = compacted(captured);
  Box3f box;
  for (const Vec3f p : used.positions) box.add(p);
  out.size_m = length(vec_cast<double>(box.high - box.low));
  out.mesh = used.triangles.size() > kFewTriangles
                 ? coarsened(used, std::min(kCoarse_m, out.size_m / 200))
                 : std::move(used);
  const double patch_m = std::max(std::min(kPatch_m, out.size_m / 40), 1e-6);
  std::unordered_map<Vec3i, std::uint32_t, CellHash> patches;
  double area = 0;
  for (std::size_t t = 0; t < out.mesh.triangles.size(); ++t) {
    const Vec3d p = vec_cast<double>(out.mesh.centroid(t));
    const Vec3d normal = vec_cast<double>(out.mesh.area_normal(t));
    const auto next = static_cast<std::uint32_t>(out.area_m2.size());
    const auto [found, is_new] = patches.try_emplace(patch_key(p, normal, patch_m), next);
    if (is_new) out.area_m2.push_back(0);
    out.patch.push_back(found->second);
    out.area_m2[found->second] += 0.5 * length(normal);
    out.middle += p * (0.5 * length(normal)), area += 0.5 * length(normal);
  }
  if (area > 0) out.middle = out.middle / area;
  return out;
}

// --- what a viewpoint sees

/// The same picture at 120 rows.
Camera small_camera(const ViewpointConfig& config) {
  constexpr int kRows = 120;
  const double width = static_cast<double>(kRows) * config.width / config.height;
  return picture_camera(std::max(1, static_cast<int>(std::lround(width))), kRows,
                        config.vertical_fov_deg);
}

/// A viewpoint that might be chosen.
struct Candidate {
  Pose T_world_camera;
  std::vector<std::uint32_t> patches;  ///< that it sees from their front, each once, in order
  double area_m2 = 0;                  ///< of these
};

/// Nothing when it sees too little, or has its nose against something. Surface that is seen from
/// behind covers nothing.
std::optional<Candidate> view_from(const Subject& subject, const Pose& pose,
                                   const ViewpointConfig& config) {
  const Camera camera = small_camera(config);
  const kit::Raster raster = kit::rasterize(subject.mesh, camera, pose);
  Candidate out{pose, {}, 0};
  std::vector<float> depths;
  std::size_t covered = 0;
  const Vec3f eye = vec_cast<float>(pose.translation);
  for (std::size_t i = 0; i < raster.triangle.data.size(); ++i) {
    const std::uint32_t t = raster.triangle.data[i];
    if (t == kit::kNoTriangle) continue;
    depths.push_back(raster.depth.data[i]);
    if (dot(subject.mesh.area_normal(t), eye - subject.mesh.corner(t, 0)) <= 0) continue;
    ++covered;
    out.patches.push_back(subject.patch[t]);
  }
  const double pixels = static_cast<double>(raster.triangle.data.size());
  if (depths.empty() || static_cast<double>(covered) < config.least_cover * pixels)
    return std::nullopt;
  const auto median = depths.begin() + static_cast<std::ptrdiff_t>(depths.size() / 2);
  std::nth_element(depths.begin(), median, depths.end());
  if (*median < config.least_distance_m) return std::nullopt;
  std::sort(out.patches.begin(), out.patches.end());
  out.patches.erase(std::unique(out.patches.begin(), out.patches.end()), out.patches.end());
  for (const std::uint32_t patch : out.patches) out.area_m2 += subject.area_m2[patch];
  return out;
}

/// Takes one after the other, each the one that adds most area; area that n of them see already
/// counts 1 / 4ⁿ. So once all is seen, what few have seen comes first.
std::vector<std::size_t> greedy_cover(const Subject& subject,
                                      const std::vector<Candidate>& candidates, int views) {
  constexpr double kAgain = 0.25;
  std::vector<double> worth = subject.area_m2;
  std::vector<std::size_t> chosen;
  std::vector<std::uint8_t> taken(candidates.size());
  while (chosen.size() < candidates.size() && static_cast<int>(chosen.size()) < views) {
    std::size_t best = candidates.size();
    double most = -1;
    for (std::size_t i = 0; i < candidates.size(); ++i) {
      if (taken[i]) continue;
      double gain = 0;
      for (const std::uint32_t patch : candidates[i].patches) gain += worth[patch];
      if (gain > most) most = gain, best = i;
    }
    taken[best] = 1;
    chosen.push_back(best);
    for (const std::uint32_t patch : candidates[best].patches) worth[patch] *= kAgain;
  }
  return chosen;
}

// --- along the skeleton

/// Shortest path lengths along the skeleton from a cell; infinite: not reachable.
void measure_ways(const FloorMap& map, std::int32_t from, std::vector<double>& length_m) {
  using Entry = std::pair<double, std::int32_t>;
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> open;
  length_m[from] = 0;
  open.push({0, from});
  while (!open.empty()) {
    const auto [way, cell] = open.top();
    open.pop();
    if (way > length_m[cell]) continue;
    for (const int dy : {-1, 0, 1})
      for (const int dx : {-1, 0, 1}) {
        const std::int32_t next = cell + dy * map.width + dx;
        const double there = way + map.cell_m * std::hypot(dx, dy);
        if (!map.skeleton[next] || there >= length_m[next]) continue;
        length_m[next] = there;
        open.push({there, next});
      }
  }
}

/// Farthest-point samples: first the cell with most room around it, then always the one with the
/// longest way along the skeleton to those taken.
std::vector<std::int32_t> sample_nodes(const FloorMap& map,
                                       const std::vector<std::int32_t>& cells) {
  constexpr double kLeastSpacing_m = 0.25;
  constexpr std::size_t kMostNodes = 40;
  std::vector<double> way_m(map.skeleton.size(), std::numeric_limits<double>::infinity());
  std::vector<std::int32_t> nodes{*std::max_element(
      cells.begin(), cells.end(),
      [&](std::int32_t a, std::int32_t b) { return map.clearance_m[a] < map.clearance_m[b]; })};
  while (nodes.size() < kMostNodes) {
    measure_ways(map, nodes.back(), way_m);
    const auto farthest =
        std::max_element(cells.begin(), cells.end(),
                         [&](std::int32_t a, std::int32_t b) { return way_m[a] < way_m[b]; });
    if (way_m[*farthest] < kLeastSpacing_m) break;
    nodes.push_back(*farthest);
  }
  return nodes;
}

/// The yaw that shows most and the one of the rest, at least 60 degrees off, that does.
std::vector<Candidate> best_yaws(const Subject& subject, const FloorMap& map, Vec3d eye,
                                 const ViewpointConfig& config) {
  constexpr int kYaws = 12, kApart = 2;
  constexpr double kPitch = radians(10);  // downwards: more floor and furniture than ceiling
  std::array<std::optional<Candidate>, kYaws> all;
  for (int i = 0; i < kYaws; ++i) {
    const double yaw = 2 * std::numbers::pi * i / kYaws;
    const Vec3d ahead =
        map.T_world_floor.rotation * Vec3d{std::cos(yaw) * std::cos(kPitch),
                                           std::sin(yaw) * std::cos(kPitch), -std::sin(kPitch)};
    all[i] =
        view_from(subject, look_at(eye, eye + ahead, map.T_world_floor.rotation.column(2)), config);
  }
  std::vector<Candidate> out;
  int first = -1;
  for (int taken = 0; taken < 2; ++taken) {
    int best = -1;
    for (int i = 0; i < kYaws; ++i) {
      const int apart = std::abs(i - first);
      if (!all[i] || (taken > 0 && std::min(apart, kYaws - apart) < kApart)) continue;
      if (best < 0 || all[i]->area_m2 > all[best]->area_m2) best = i;
    }
    if (best < 0) break;
    out.push_back(*all[best]);
    first = best;
  }
  return out;
}

/// Puts the candidates of `count` places, at(i) each, in their order.
template <typename At>
std::vector<Candidate> gathered(std::size_t count, const At& at) {
  std::vector<std::vector<Candidate>> all(count);
  parallel_for(count, 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) all[i] = at(i);
  });
  std::vector<Candidate> out;
  for (auto& some : all)
    out.insert(out.end(), std::make_move_iterator(some.begin()),
               std::make_move_iterator(some.end()));
  return out;
}

/// Along the largest component of the skeleton; along the next ones only where that gives too few
/// (aisles that clutter cuts into pieces).
std::vector<Candidate> standing_candidates(const Subject& subject, const FloorMap& map,
                                           const ViewpointConfig& config) {
  const std::size_t heights = config.eye_heights_m.size();
  std::vector<Candidate> out;
  for (const std::vector<std::int32_t>& component : components(map)) {
    const std::vector<std::int32_t> nodes = sample_nodes(map, component);
    const auto more = gathered(nodes.size() * heights, [&](std::size_t i) {
      const Vec3d eye = world_point(map, nodes[i / heights], config.eye_heights_m[i % heights]);
      return best_yaws(subject, map, eye, config);
    });
    out.insert(out.end(), more.begin(), more.end());
    if (static_cast<int>(out.size()) >= config.views) break;
  }
  return out;
}

// --- arcs between the sensors

/// Where a sensor stands, seen from the middle of the surface.
struct Bearing {
  Vec3d direction;
  double distance_m = 0, azimuth = 0;
};

struct Arc {
  Bearing from, to;
};

Vec3d turned(Vec3d v, Vec3d axis, double angle) {
  return v * std::cos(angle) + cross(axis, v) * std::sin(angle) +
         axis * (dot(axis, v) * (1 - std::cos(angle)));
}

/// Spherical interpolation between directions that are not opposite.
Vec3d slerp(Vec3d a, Vec3d b, double share) {
  const double angle = std::acos(std::clamp(dot(a, b), -1.0, 1.0));
  if (angle < 1e-6) return a;
  return normalized(a * std::sin((1 - share) * angle) + b * std::sin(share * angle));
}

std::vector<Bearing> bearings(std::span<const Pose> sensors, Vec3d middle, Vec3d up) {
  const Vec3d ahead = any_horizontal(up), side = cross(up, ahead);
  std::vector<Bearing> out;
  for (const Pose& sensor : sensors) {
    const Vec3d away = sensor.translation - middle;
    if (length(away) > 1e-3)
      out.push_back(
          {normalized(away), length(away), std::atan2(dot(side, away), dot(ahead, away))});
  }
  std::stable_sort(out.begin(), out.end(),
                   [](const Bearing& a, const Bearing& b) { return a.azimuth < b.azimuth; });
  return out;
}

/// Between neighbours around the surface, unless they are so far apart that nobody looked from
/// between them; where no two are neighbours, 20 degrees to either side of each.
std::vector<Arc> arcs_between(const std::vector<Bearing>& sensors, Vec3d up) {
  const double farthest = std::cos(radians(150));
  std::vector<Arc> out;
  const std::size_t pairs = sensors.size() < 3 ? sensors.size() / 2 : sensors.size();
  for (std::size_t i = 0; i < pairs; ++i) {
    const Bearing &a = sensors[i], &b = sensors[(i + 1) % sensors.size()];
    double gap = b.azimuth - a.azimuth;
    if (gap < 0) gap += 2 * std::numbers::pi;
    const bool around = sensors.size() > 2 && gap > std::numbers::pi;
    if (!around && dot(a.direction, b.direction) > farthest) out.push_back({a, b});
  }
  if (!out.empty()) return out;
  for (const Bearing& s : sensors) {
    Arc arc{s, s};
    arc.from.direction = turned(s.direction, up, -radians(20));
    arc.to.direction = turned(s.direction, up, radians(20));
    out.push_back(arc);
  }
  return out;
}

/// The same direction, raised by an angle; nothing straight above or below.
std::optional<Vec3d> raised(Vec3d direction, Vec3d up, double angle) {
  const Vec3d rising = up - direction * dot(up, direction);
  if (length(rising) < 0.1) return angle == 0 ? std::optional(direction) : std::nullopt;
  return direction * std::cos(angle) + normalized(rising) * std::sin(angle);
}

/// From where the sensors are, or from nearer where the surface would be too small in the picture.
std::vector<Candidate> from_direction(const Subject& subject, Vec3d direction, double distance_m,
                                      Vec3d up, const ViewpointConfig& config) {
  const bool vertical = length(cross(direction, up)) < 0.05;
  for (const double nearer : {1.0, 0.8, 0.64, 0.5, 0.4}) {
    const Vec3d eye = subject.middle + direction * (distance_m * nearer);
    const Pose pose = look_at(eye, subject.middle, vertical ? any_horizontal(up) : up);
    if (auto seen = view_from(subject, pose, config)) return {*seen};
  }
  return {};
}

std::vector<Candidate> arc_candidates(const Subject& subject, std::span<const Pose> sensors,
                                      Vec3d up, const ViewpointConfig& config) {
  const std::vector<Arc> arcs = arcs_between(bearings(sensors, subject.middle, up), up);
  if (arcs.empty()) return {};
  constexpr std::array kRaised{radians(0), radians(12), radians(-8)};
  const std::size_t steps =
      std::max<std::size_t>(3, (config.views + arcs.size() - 1) / arcs.size());
  return gathered(arcs.size() * steps * kRaised.size(), [&](std::size_t i) {
    const Arc& arc = arcs[i / kRaised.size() / steps];
    const double share = (static_cast<double>(i / kRaised.size() % steps) + 0.5) / steps;
    const auto direction =
        raised(slerp(arc.from.direction, arc.to.direction, share), up, kRaised[i % kRaised.size()]);
    if (!direction) return std::vector<Candidate>{};
    const double distance_m =
        arc.from.distance_m + share * (arc.to.distance_m - arc.from.distance_m);
    return from_direction(subject, *direction, distance_m, up, config);
  });
}

// --- all of it

ViewPlan planned(ViewPlan::Kind kind, const Subject& subject,
                 const std::vector<Candidate>& candidates, const ViewpointConfig& config) {
  ViewPlan plan;
  plan.kind = kind;
  const Camera camera = picture_camera(config.width, config.height, config.vertical_fov_deg);
  for (const std::size_t i : greedy_cover(subject, candidates, config.views))
    plan.views.push_back(
        {fmt::format("view-{:02}", plan.views.size()), camera, candidates[i].T_world_camera});
  return plan;
}

/// A thing on a table, not a place to stand in.
bool nobody_fits(const Subject& subject) {
  constexpr double kReach_m = 0.9;
  for (const Vec3f p : subject.mesh.positions)
    if (length(vec_cast<double>(p) - subject.middle) > kReach_m) return false;
  return true;
}

Status check(const Mesh& captured, std::span<const Pose> sensors, Vec3d up,
             const ViewpointConfig& config) {
  MR_ASSERT(config.views > 0 && config.width > 0 && config.height > 0 && config.cell_m > 0);
  MR_ASSERT(std::abs(length(up) - 1) < 1e-3);
  const auto invalid = [](const char* why) { return Error{Error::Cause::invalid, why}; };
  for (const Vec3f p : captured.positions)
    if (!(length(p) < 1e5f))
      return invalid("viewpoints: a position of the captured surface is not finite or far away");
  for (const Pose& sensor : sensors)
    if (!(length(sensor.translation) < 1e5))
      return invalid("viewpoints: the position of a sensor is not finite or far away");
  if (!(surface_area_m2(captured) > 0))
    return Error{Error::Cause::empty, "viewpoints: the captured surface has no area"};
  return {};
}

}  // namespace

Camera picture_camera(int width, int height, double vertical_fov_deg) {
  Camera c;
  c.width = width, c.height = height;
  c.fx = c.fy = 0.5 * height / std::tan(0.5 * radians(vertical_fov_deg));
  c.cx = 0.5 * (width - 1), c.cy = 0.5 * (height - 1);
  return c;
}

Result<ViewPlan> plan_viewpoints(const Mesh& captured, std::span<const Pose> sensors, Vec3d up,
                                 const ViewpointConfig& config) {
  if (const Status usable = check(captured, sensors, up, config); !usable) return usable.error();
  const Subject subject = subject_of(captured);
  if (!nobody_fits(subject)) {
    auto map = map_floor(captured, sensors, up, config);
    if (!map) return map.error();
    const auto candidates = standing_candidates(subject, *map, config);
    if (!candidates.empty()) {
      ViewPlan plan = planned(ViewPlan::Kind::voronoi, subject, candidates, config);
      plan.floor = std::move(*map);
      return plan;
    }
  }
  const auto candidates = arc_candidates(subject, sensors, up, config);
  if (candidates.empty())
    return Error{
        Error::Cause::empty,
        fmt::format("viewpoints: neither standing on the floor nor between {} sensors does a "
                    "view see {:.0f} % of its picture covered, half of it beyond {} m",
                    sensors.size(), 100 * config.least_cover, config.least_distance_m)};
  return planned(ViewPlan::Kind::arcs, subject, candidates, config);
}

}  // namespace mr::eval
