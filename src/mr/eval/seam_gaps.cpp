#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <unordered_map>

#include "mr/core/parallel.h"
#include "mr/eval/geometry_error.h"
#include "mr/kit/raycast.h"
#include "mr/kit/topology.h"

namespace mr::eval {
namespace {

constexpr double kFarthest_voxels = 6;    // wider openings are not gaps
constexpr double kSameBorder_voxels = 3;  // borders connected by a shorter path are one
constexpr double kDetour = 3;    // the path must also be this many times longer than the gap
constexpr double kAcross = 0.5;  // cosine: within 60 degrees

Vec3d position(const Mesh& mesh, std::uint32_t vertex) {
  return vec_cast<double>(mesh.positions[vertex]);
}

std::vector<std::uint32_t> border_half_edges(const Mesh& mesh) {
  const kit::EdgeTable edges = kit::edge_table(mesh);
  std::vector<std::uint32_t> border;
  for (std::uint32_t h = 0; h < edges.uses.size(); ++h)
    if (edges.uses[h] == 1) border.push_back(h);
  return border;
}

/// A half-edge of a border.
struct BorderEdge {
  std::uint32_t from = 0, to = 0;  ///< vertices
  Vec3d a, b;
  Vec3d along;  ///< unit length
  Vec3d open;   ///< unit length, in the triangle's plane, away from it
};

/// Borders without edges of no length and triangles of no area.
std::vector<BorderEdge> border_edges(const Mesh& mesh) {
  std::vector<BorderEdge> out;
  for (const std::uint32_t h : border_half_edges(mesh)) {
    BorderEdge edge{kit::edge_from(mesh, h), kit::edge_to(mesh, h), {}, {}, {}, {}};
    edge.a = position(mesh, edge.from), edge.b = position(mesh, edge.to);
    edge.along = normalized(edge.b - edge.a);
    const Vec3d third = position(mesh, mesh.triangles[h / 3][(h % 3 + 2) % 3]);
    edge.open = normalized(cross(edge.along, cross(edge.b - edge.a, third - edge.a)));
    if (dot(edge.open, edge.open) > 0) out.push_back(edge);
  }
  return out;
}

/// A short part of a border edge.
struct BorderSegment {
  std::uint32_t edge = 0;
  Vec3d a, b;

  Vec3d middle() const { return (a + b) * 0.5; }
  double length_m() const { return length(b - a); }
};

std::vector<BorderSegment> cut(std::span<const BorderEdge> edges, double longest_m) {
  std::vector<BorderSegment> segments;
  for (std::uint32_t e = 0; e < edges.size(); ++e) {
    const Vec3d side = edges[e].b - edges[e].a;
    const double count = std::max(1.0, std::ceil(length(side) / longest_m - 1e-6));
    for (double k = 0; k < count; ++k)
      segments.push_back(
          {e, edges[e].a + side * (k / count), edges[e].a + side * ((k + 1) / count)});
  }
  return segments;
}

/// Segments by the cell that their middle lies in.
class SegmentGrid {
 public:
  SegmentGrid(std::span<const BorderSegment> segments, double cell_m) : cell_m_(cell_m) {
    for (std::uint32_t i = 0; i < segments.size(); ++i)
      cells_[cell_of(segments[i].middle())].push_back(i);
  }

  /// Calls body(segment) for all whose middle lies at most a cell away, and for some others.
  template <typename Body>
  void around(Vec3d p, const Body& body) const {
    const Vec3i c = cell_of(p);
    for (std::int32_t z = c.z - 1; z <= c.z + 1; ++z)
      for (std::int32_t y = c.y - 1; y <= c.y + 1; ++y)
        for (std::int32_t x = c.x - 1; x <= c.x + 1; ++x)
          if (const auto found = cells_.find({x, y, z}); found != cells_.end())
            for (const std::uint32_t i : found->second) body(i);
  }

 private:
  Vec3i cell_of(Vec3d p) const {
    return vec_cast<std::int32_t>(
        Vec3d{std::floor(p.x / cell_m_), std::floor(p.y / cell_m_), std::floor(p.z / cell_m_)});
  }

  double cell_m_;
  std::unordered_map<Vec3i, std::vector<std::uint32_t>, CellHash> cells_;
};

/// Which border edges meet at each vertex.
using EdgesAt = std::unordered_map<std::uint32_t, std::vector<std::uint32_t>>;

EdgesAt edges_at(std::span<const BorderEdge> edges) {
  EdgesAt out;
  for (std::uint32_t e = 0; e < edges.size(); ++e)
    out[edges[e].from].push_back(e), out[edges[e].to].push_back(e);
  return out;
}

/// An edge and how far along the border it begins.
struct BorderArc {
  std::uint32_t edge = 0;
  double distance_m = 0;
};

/// The edges that begin at most `reach_m` along the border from an edge, sorted; that edge and its
/// neighbours included.
std::vector<BorderArc> along_border(std::uint32_t start, std::span<const BorderEdge> edges,
                                    const EdgesAt& at, double reach_m) {
  std::map<std::uint32_t, double> vertices{{edges[start].from, 0}, {edges[start].to, 0}};
  std::map<std::uint32_t, double> found;
  std::vector<std::uint32_t> open{edges[start].from, edges[start].to};
  while (!open.empty()) {
    const std::uint32_t vertex = open.back();
    open.pop_back();
    const double here = vertices[vertex];
    for (const std::uint32_t e : at.at(vertex)) {
      double& begins = found.try_emplace(e, here).first->second;
      begins = std::min(begins, here);
      const double there = here + length(edges[e].b - edges[e].a);
      const std::uint32_t next = edges[e].from == vertex ? edges[e].to : edges[e].from;
      if (there > reach_m) continue;
      const auto [known, is_new] = vertices.try_emplace(next, there);
      if (!is_new && known->second <= there) continue;
      known->second = there;
      open.push_back(next);
    }
  }
  std::vector<BorderArc> out;
  for (const auto& [edge, distance] : found) out.push_back({edge, distance});
  return out;
}

/// How far along the border an edge begins; infinite where it is not listed.
double arc_length_to(std::uint32_t edge, std::span<const BorderArc> listed) {
  const auto at = std::ranges::lower_bound(listed, edge, {}, &BorderArc::edge);
  return at != listed.end() && at->edge == edge ? at->distance_m
                                                : std::numeric_limits<double>::infinity();
}

/// Distance from a point of an edge to a segment of another; infinite where they do not face.
double facing_distance(Vec3d from, const BorderEdge& edge, const BorderSegment& segment,
                       const BorderEdge& other) {
  constexpr double kNone = std::numeric_limits<double>::infinity();
  if (dot(edge.along, other.along) > -kAcross) return kNone;
  const Vec3d across = kit::nearest_on_segment(from, segment.a, segment.b) - from;
  const double distance = length(across);
  if (distance < 1e-6) return distance;  // no direction
  if (dot(across, edge.open) < kAcross * distance) return kNone;
  return dot(-across, other.open) < kAcross * distance ? kNone : distance;
}

/// For every segment the distance to the nearest that faces it; infinite where none does.
std::vector<double> gap_widths(std::span<const BorderEdge> edges,
                               std::span<const BorderSegment> segments, double voxel_m) {
  const double farthest = kFarthest_voxels * voxel_m;
  const SegmentGrid grid(segments,
                         farthest + voxel_m);  // a segment's middle is that much farther away
  const EdgesAt at = edges_at(edges);
  std::vector<double> widths(segments.size(), std::numeric_limits<double>::infinity());
  parallel_for(segments.size(), 64, [&](std::size_t begin, std::size_t end) {
    std::vector<BorderArc> same;
    for (std::size_t i = begin; i < end; ++i) {
      const BorderSegment& segment = segments[i];
      if (i == begin || segment.edge != segments[i - 1].edge)
        same = along_border(segment.edge, edges, at, kDetour * farthest);
      const Vec3d from = segment.middle();
      grid.around(from, [&](std::uint32_t other) {
        const std::uint32_t e = segments[other].edge;
        const double width = facing_distance(from, edges[segment.edge], segments[other], edges[e]);
        if (width > farthest || width >= widths[i]) return;
        const double least_way = std::max(kSameBorder_voxels * voxel_m, kDetour * width);
        if (arc_length_to(e, same) > least_way) widths[i] = width;
      });
    }
  });
  return widths;
}

}  // namespace

double seam_gap_p95_mm(const Mesh& mesh, double voxel_m) {
  const std::vector<BorderEdge> edges = border_edges(mesh);
  const std::vector<BorderSegment> segments = cut(edges, voxel_m / 2);
  const std::vector<double> widths = gap_widths(edges, segments, voxel_m);
  std::vector<std::pair<double, double>> width_and_length;
  double all = 0;
  for (std::size_t i = 0; i < segments.size(); ++i) {
    if (!std::isfinite(widths[i])) continue;
    width_and_length.emplace_back(widths[i], segments[i].length_m());
    all += segments[i].length_m();
  }
  std::ranges::sort(width_and_length);
  double below = 0;
  for (const auto& [width, long_m] : width_and_length)
    if ((below += long_m) >= 0.95 * all) return width * 1000;
  return 0;
}

double boundary_length_m(const Mesh& mesh) {
  double sum = 0;
  for (const std::uint32_t h : border_half_edges(mesh))
    sum += length(position(mesh, kit::edge_to(mesh, h)) - position(mesh, kit::edge_from(mesh, h)));
  return sum;
}

}  // namespace mr::eval
