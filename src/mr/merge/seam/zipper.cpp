#include "mr/merge/seam/zipper.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <numeric>
#include <optional>
#include <queue>
#include <tuple>
#include <utility>

#include "mr/core/parallel.h"
#include "mr/kit/topology.h"
#include "mr/merge/cell.h"
#include "mr/merge/groups.h"
#include "mr/merge/seam/advancing_front.h"
#include "mr/merge/seam/border.h"
#include "mr/merge/seam/border_cutter.h"
#include "mr/merge/seam/border_map.h"
#include "mr/merge/seam/point_grid.h"

namespace mr::merge {
namespace {

constexpr std::size_t kMostAround = 256;  // corners in reach; where there are more lie slivers
constexpr std::size_t kSmallLoop = 30;    // edges of a loop that is closed at all costs
constexpr std::size_t kLongLoop = 200;    // and of one that is closed where its rims agree
constexpr float kAgree = 0.6f;            // cosine
constexpr double kCube_gaps = 64;         // side of the cubes that are closed on their own
constexpr std::size_t kRoom = 6;          // edges that may be made in them, per edge
constexpr double kMoreReach = 1.001;      // rounding included

/// [border] The edges that another part's border may be near, and a few more on both sides.
std::vector<std::uint8_t> wanted_edges(const Joined& joined, const BorderMap& map) {
  constexpr int kMore = 3;
  std::vector<std::uint8_t> edges = map.has_other_near(joined);
  const auto ends = [&](std::size_t e) {
    return std::pair(kit::edge_from(joined.mesh, joined.border[e]),
                     kit::edge_to(joined.mesh, joined.border[e]));
  };
  std::vector<std::uint8_t> at_vertex(joined.mesh.positions.size(), 0);
  for (int round = 0; round < kMore; ++round) {
    for (std::size_t e = 0; e < edges.size(); ++e)
      if (edges[e]) at_vertex[ends(e).first] = at_vertex[ends(e).second] = 1;
    for (std::size_t e = 0; e < edges.size(); ++e)
      edges[e] |= at_vertex[ends(e).first] | at_vertex[ends(e).second];
  }
  return edges;
}

/// A candidate of the advancing front: the triangle of a border edge and a corner, with its cost.
struct GapTriangle {
  double cost = 0;
  std::uint32_t edge = 0, corner = 0;

  friend bool operator>(const GapTriangle& a, const GapTriangle& b) {
    return std::tie(a.cost, a.edge, a.corner) > std::tie(b.cost, b.edge, b.corner);
  }
};

/// Closes gaps with a priority queue of candidates, shortest connections first: in parallel for
/// cubes of space, each with its own queue, then serially between the cubes.
class Zipper {
 public:
  Zipper(AdvancingFront& front, const ZipperConfig& config)
      : front_(front),
        config_(config),
        per_cube_(static_cast<float>(1 / (kCube_gaps * config.max_gap_m))),
        grid_(places_of(front), config.max_gap_m + config.edge_m / 2) {}

  /// Returns the new triangles.
  std::vector<Triangle> run() {
    std::vector<std::uint32_t> edges(front_.original());
    std::iota(edges.begin(), edges.end(), 0u);
    Jobs jobs = distribute(edges);
    parallel_for(jobs.cubes.size(), 1, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) drain(jobs.cubes[i]);
    });
    Job& between = jobs.between;
    between.space = front_.open_workspace();
    std::vector<Triangle> out;
    for (const Job& cube : jobs.cubes) {
      out.insert(out.end(), cube.space.added.begin(), cube.space.added.end());
      for (const auto& triangle : best_triangles(cube.left))
        if (triangle) between.queue.push(*triangle);
    }
    drain(between);
    close_loops(between.space);
    out.insert(out.end(), between.space.added.begin(), between.space.added.end());
    return out;
  }

 private:
  static std::vector<Vec3f> places_of(const AdvancingFront& front) {
    std::vector<Vec3f> out;
    for (const AdvancingFront::Vertex& v : front.vertices()) out.push_back(v.at);
    return out;
  }

  /// The neighbourhood of an edge; reused to save allocations.
  struct EdgeNeighbourhood {
    double reach = 0;                     // how far a triangle over the edge may go
    std::vector<std::uint32_t> near;      // vertices that it may reach or meet
    std::vector<GapTriangle> candidates;  // with the vertex as corner
  };

  /// The work of one queue.
  struct Job {
    std::optional<Vec3i> cube;  // that edges must lie in with all that they may reach; none: any
    std::priority_queue<GapTriangle, std::vector<GapTriangle>, std::greater<>> queue;
    AdvancingFront::Workspace space;
    std::vector<std::uint32_t> left;  // edges that are not for this job
    EdgeNeighbourhood around;
  };
  struct Jobs {
    std::vector<Job> cubes;
    Job between;
  };

  /// Distributes edges that have a candidate to the cubes' queues.
  Jobs distribute(const std::vector<std::uint32_t>& edges) {
    Jobs out;
    std::map<std::tuple<int, int, int>, std::size_t> place;  // of cubes
    for (const auto& triangle : best_triangles(edges)) {
      if (!triangle) continue;
      const std::optional<Vec3i> cube = cube_of(triangle->edge);
      if (!cube) {
        out.between.queue.push(*triangle);
        continue;
      }
      const auto [known, fresh] = place.try_emplace({cube->x, cube->y, cube->z}, out.cubes.size());
      if (fresh) out.cubes.emplace_back().cube = cube;
      out.cubes[known->second].queue.push(*triangle);
    }
    for (Job& job : out.cubes) job.space = front_.workspace(kRoom * job.queue.size());
    return out;
  }

  /// The cube that contains everything within an edge's reach, if there is one.
  std::optional<Vec3i> cube_of(std::uint32_t e) const {
    const Vec3f middle = (from(e) + to(e)) * 0.5f;
    const auto reach = static_cast<float>(kMoreReach * reach_of(e));
    const Vec3f around{reach, reach, reach};
    const Vec3i low = cell_at((middle - around) * per_cube_);
    return low == cell_at((middle + around) * per_cube_) ? std::optional(low) : std::nullopt;
  }

  void drain(Job& job) {
    while (!job.queue.empty()) {
      const GapTriangle f = job.queue.top();
      job.queue.pop();
      if (!front_.edge(f.edge).alive) continue;
      if (!front_.has_room(job.space)) {
        job.left.push_back(f.edge);
        continue;
      }
      if (front_.fits(f.edge, f.corner)) {
        look_around(f.edge, job.around);
        if (!blocked(f.edge, front_.edge(f.corner).from, job.around)) {
          for (const std::uint32_t fresh : front_.fill(f.edge, f.corner, job.space))
            if (fresh != AdvancingFront::kNone) offer(fresh, job);
          continue;
        }
      }
      offer(f.edge, job);
    }
  }

  void offer(std::uint32_t e, Job& job) {
    if (job.cube && cube_of(e) != job.cube)
      job.left.push_back(e);
    else if (const auto best = best_triangle(e, job.around))
      job.queue.push(*best);
  }

  std::vector<std::optional<GapTriangle>> best_triangles(
      const std::vector<std::uint32_t>& edges) const {
    std::vector<std::optional<GapTriangle>> out(edges.size());
    parallel_for(out.size(), 256, [&](std::size_t begin, std::size_t end) {
      EdgeNeighbourhood around;
      for (std::size_t i = begin; i < end; ++i) out[i] = best_triangle(edges[i], around);
    });
    return out;
  }

  /// The cheapest triangle over an edge, if there is one.
  std::optional<GapTriangle> best_triangle(std::uint32_t e, EdgeNeighbourhood& around) const {
    if (!front_.edge(e).alive) return std::nullopt;
    look_around(e, around);
    const Vec3f u = from(e), v = to(e), into_gap = front_.into_gap(e);
    auto& candidates = around.candidates;
    candidates.clear();
    for (const std::uint32_t w : around.near) {
      const Vec3f tip = at(w);
      if (dot(into_gap, tip - v) <= 0 || !joins_parts(e, w) || !front_.faces_alike(e, w)) continue;
      const double to_u = length(tip - u), to_v = length(tip - v);
      if (to_u <= around.reach && to_v <= around.reach) candidates.push_back({to_u + to_v, e, w});
    }
    std::make_heap(candidates.begin(), candidates.end(), std::greater<>());
    for (; !candidates.empty(); candidates.pop_back()) {
      std::pop_heap(candidates.begin(), candidates.end(), std::greater<>());
      const GapTriangle& f = candidates.back();
      std::uint32_t c = front_.corner_at(f.corner);
      for (; c != AdvancingFront::kNone; c = front_.edge(c).sibling)
        if (front_.fits(e, c) && !blocked(e, f.corner, around)) return GapTriangle{f.cost, e, c};
    }
    return std::nullopt;
  }

  double reach_of(std::uint32_t e) const {
    return config_.max_gap_m + 0.5 * length(to(e) - from(e));
  }

  void look_around(std::uint32_t e, EdgeNeighbourhood& around) const {
    around.reach = reach_of(e);
    around.near.clear();
    grid_.within((from(e) + to(e)) * 0.5f, static_cast<float>(around.reach),
                 [&](std::uint32_t vertex) { around.near.push_back(vertex); });
    if (around.near.size() > kMostAround) around.near.clear();
  }

  /// Whether the triangle over `e` with tip `w` would lie across another border nearby: seen along
  /// its normal, a border vertex lies inside it or a border edge crosses one of its new edges.
  bool blocked(std::uint32_t e, std::uint32_t w, const EdgeNeighbourhood& around) const {
    const Vec3f u = from(e), v = to(e), tip = at(w);
    const Vec3f normal = cross(u - v, tip - v);
    const float slack = 1e-4f * dot(normal, normal);
    // How far a point is on the inner side of each edge, times that edge's length.
    const Vec3f in_vu = cross(normal, u - v), in_ut = cross(normal, tip - u),
                in_tv = cross(normal, v - tip);
    const auto side = [&](Vec3f a, Vec3f b, Vec3f p) { return dot(normal, cross(b - a, p - a)); };
    const auto crosses = [&](float p_side, float q_side, Vec3f p, Vec3f q, Vec3f a, Vec3f b) {
      return p_side * q_side < 0 && std::min(std::abs(p_side), std::abs(q_side)) > slack &&
             side(p, q, a) * side(p, q, b) < 0;
    };
    const auto is_across = [&](Vec3f p, Vec3f q) {
      const float p_vu = dot(in_vu, p - v), q_vu = dot(in_vu, q - v);
      if (p_vu <= 0 && q_vu <= 0) return false;
      const float p_ut = dot(in_ut, p - u), q_ut = dot(in_ut, q - u);
      if (p_ut <= 0 && q_ut <= 0) return false;
      const float p_tv = dot(in_tv, p - tip), q_tv = dot(in_tv, q - tip);
      return (p_ut > slack && p_tv > slack && p_vu > slack) ||
             (q_ut > slack && q_tv > slack && q_vu > slack) || crosses(p_ut, q_ut, p, q, u, tip) ||
             crosses(p_tv, q_tv, p, q, tip, v);
    };
    for (const std::uint32_t near : around.near) {
      std::uint32_t c = front_.corner_at(near);
      for (; c != AdvancingFront::kNone; c = front_.edge(c).sibling)
        if (is_across(from(c), to(c))) return true;
    }
    return false;
  }

  /// Closes remaining loops and pinholes.
  void close_loops(AdvancingFront::Workspace& space) {
    std::vector<std::uint8_t> seen(front_.size(), 0);
    std::vector<std::uint32_t> edges, loop;
    for (std::uint32_t v = 0; v < front_.vertices().size(); ++v) {
      for (std::uint32_t e = front_.corner_at(v); e != AdvancingFront::kNone;
           e = front_.edge(e).sibling)
        edges.push_back(e);
      for (; !edges.empty();) {
        const std::uint32_t e = edges.back();
        edges.pop_back();
        if (!front_.edge(e).alive || seen[e] || !is_remainder(e, seen, loop)) continue;
        const std::size_t before = space.added.size();
        close_loop(e, space);
        seen.resize(front_.size(), 0);
        if (space.added.size() == before) continue;
        for (const std::uint32_t k : loop)
          seen[k] = 0, edges.push_back(k);  // it may have come apart
      }
    }
  }

  /// Whether `e` is on a loop that strips left over, or around a pinhole. Marks and returns
  /// what is on the same loop.
  bool is_remainder(std::uint32_t e, std::vector<std::uint8_t>& seen,
                    std::vector<std::uint32_t>& loop) const {
    double around = 0;
    bool left_over = false;
    std::uint32_t k = e;
    for (loop.clear(); !seen[k]; k = front_.edge(k).next) {
      seen[k] = 1;
      loop.push_back(k);
      around += length(to(k) - from(k));
      left_over |= k >= front_.original();
    }
    return k == e && loop.size() <= kLongLoop && (left_over || around < 2 * config_.max_gap_m);
  }

  /// Cuts off ears, the smallest first, until the loop that `e` is on is closed or no ear
  /// fits.
  void close_loop(std::uint32_t e, AdvancingFront::Workspace& space) {
    const bool small = front_.loop_length(e, kSmallLoop).has_value();
    while (front_.edge(e).alive && front_.loop_length(e, kLongLoop)) {
      double least = std::numeric_limits<double>::max();
      std::uint32_t best = e;
      std::uint32_t k = e;
      do {
        const double across = length(from(front_.ear_corner(k)) - from(k));
        if (across < std::min(least, 2 * config_.max_gap_m) &&
            front_.fits_as_ear(k, small ? 0 : kAgree))
          least = across, best = k;
        k = front_.edge(k).next;
      } while (k != e);
      if (least == std::numeric_limits<double>::max()) return;
      for (const std::uint32_t fresh : front_.fill(best, front_.ear_corner(best), space))
        if (!front_.edge(e).alive && fresh != AdvancingFront::kNone) e = fresh;
    }
  }

  Vec3f at(std::uint32_t vertex) const { return front_.vertex(vertex).at; }
  Vec3f from(std::uint32_t e) const { return at(front_.edge(e).from); }
  Vec3f to(std::uint32_t e) const { return at(front_.edge(e).to); }

  bool joins_parts(std::uint32_t e, std::uint32_t tip) const {
    const auto part = [&](std::uint32_t v) { return front_.vertex(v).part; };
    const AdvancingFront::Edge& edge = front_.edge(e);
    return part(edge.from) != part(tip) || part(edge.to) != part(tip);
  }

  AdvancingFront& front_;
  const ZipperConfig& config_;
  float per_cube_;
  PointGrid grid_;  // of the front's vertices
};

/// Adds the strips; each triangle has the sensor of the surface at one of its corners.
void add_strips(const std::vector<Triangle>& strips, Joined& joined) {
  std::vector<SensorId> sensor(joined.mesh.positions.size(), kNoSensor);
  for (const std::uint32_t h : joined.border)
    sensor[kit::edge_from(joined.mesh, h)] = joined.sensor[h / 3];
  for (const Triangle& t : strips) joined.sensor.push_back(sensor[t[0]]);
  joined.mesh.triangles.insert(joined.mesh.triangles.end(), strips.begin(), strips.end());
}

/// The mesh, with sensors if any part had some.
Mesh with_sensors(Joined joined) {
  if (std::ranges::any_of(joined.sensor, [](SensorId v) { return v != kNoSensor; }))
    set_triangle_sensors(joined.mesh, joined.sensor);
  return std::move(joined.mesh);
}

/// How far a strip may reach: every new edge may be longer than the one that it grew from, up to
/// twice the gap.
double reach_m(const ZipperConfig& config) {
  return std::max(2 * config.max_gap_m, config.max_gap_m + config.edge_m);
}

/// One surface of parts that meet.
Mesh close(std::span<const Mesh> parts, const ZipperConfig& config) {
  Joined joined = join_parts(parts);
  if (config.max_gap_m <= 0) return with_sensors(std::move(joined));
  const BorderMap map(joined, reach_m(config));
  split_long_border_edges(joined, map, config);
  AdvancingFront front(joined, wanted_edges(joined, map));
  add_strips(Zipper(front, config).run(), joined);
  const bool came_apart = joined.came_apart;
  Mesh out = with_sensors(std::move(joined));
  return came_apart ? kit::without_nonmanifold_edges(out) : out;
}

}  // namespace

Mesh zip(std::span<const Mesh> parts, const ZipperConfig& config) {
  if (parts.size() == 1) return parts[0];
  if (config.max_gap_m <= 0) return close(parts, config);
  std::vector<const Mesh*> meshes;
  for (const Mesh& part : parts) meshes.push_back(&part);
  const auto groups = connected_groups(meshes, reach_m(config));
  if (groups.size() == 1) return close(parts, config);
  std::vector<Mesh> closed(groups.size());
  parallel_for(groups.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t g = begin; g < end; ++g) {
      std::vector<Mesh> some;
      for (const std::uint32_t i : groups[g]) some.push_back(parts[i]);
      closed[g] = some.size() == 1 ? kit::without_nonmanifold_edges(some[0]) : close(some, config);
    }
  });
  Joined out;
  std::size_t triangles = 0;
  for (const Mesh& mesh : closed) triangles += mesh.triangles.size();
  out.mesh.triangles.reserve(triangles);
  for (Mesh& mesh : closed) {
    const std::vector<SensorId> sensor = triangle_sensors(mesh);
    out.sensor.insert(out.sensor.end(), sensor.begin(), sensor.end());
    clear_labels(mesh);
    append(out.mesh, mesh);
  }
  return with_sensors(std::move(out));
}

}  // namespace mr::merge
