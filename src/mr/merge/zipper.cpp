#include "mr/merge/zipper.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <nanoflann.hpp>
#include <queue>
#include <tuple>

#include "mr/kit/topology.h"
#include "mr/merge/front.h"

namespace mr::merge {
namespace {

constexpr int kMaxCuts = 6;          // halvings of a border edge
constexpr int kSmallLoop = 12;       // loops of so few edges are closed even inside one part

/// All parts in one mesh, and which part a vertex belongs to.
struct Joined {
  Mesh mesh;
  std::vector<std::uint32_t> part;  // [V]
};

/// Points for nanoflann.
struct PointCloud {
  std::vector<Vec3f> points;
  std::vector<std::uint32_t> tag;

  std::size_t kdtree_get_point_count() const { return points.size(); }
  float kdtree_get_pt(std::size_t i, std::size_t axis) const { return points[i][static_cast<int>(axis)]; }
  template <typename Box>
  bool kdtree_get_bbox(Box&) const { return false; }
};
using KdTree = nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<float, PointCloud>,
                                                   PointCloud, 3>;

/// Places of all points within `radius`, nearest first.
void within(const KdTree& tree, Vec3f p, double radius,
            std::vector<std::pair<std::uint32_t, float>>& found) {
  found.clear();
  const float query[3] = {p.x, p.y, p.z};
  // nanoflann's L2 radius is the square.
  tree.radiusSearch(query, static_cast<float>(radius * radius), found, nanoflann::SearchParams(32, 0, false));
  std::sort(found.begin(), found.end(), [](const auto& a, const auto& b) {
    return std::tie(a.second, a.first) < std::tie(b.second, b.first);
  });
}

Joined join_parts(std::span<const Mesh> parts) {
  Joined out;
  for (std::uint32_t i = 0; i < parts.size(); ++i) {
    Mesh part = split_bowties(parts[i]);
    part.runs.clear();
    append(out.mesh, part);
    out.part.resize(out.mesh.positions.size(), i);
  }
  return out;
}

/// Points along all border edges, at most `spacing` apart, tagged with their part.
PointCloud sample_borders(const Joined& joined, const kit::EdgeTable& table, double spacing) {
  PointCloud cloud;
  for (std::uint32_t h = 0; h < table.uses.size(); ++h) {
    if (table.uses[h] != 1) continue;
    const std::uint32_t a = kit::edge_from(joined.mesh, h);
    const Vec3f p = joined.mesh.positions[a], q = joined.mesh.positions[kit::edge_to(joined.mesh, h)];
    const int steps = std::max(1, static_cast<int>(std::ceil(length(q - p) / spacing)));
    for (int i = 0; i < steps; ++i) {
      cloud.points.push_back(p + (q - p) * (static_cast<float>(i) / static_cast<float>(steps)));
      cloud.tag.push_back(joined.part[a]);
    }
  }
  return cloud;
}

float distance_to_segment(Vec3f p, Vec3f a, Vec3f b) {
  const Vec3f d = b - a;
  const float along = std::clamp(dot(p - a, d) / std::max(dot(d, d), 1e-20f), 0.0f, 1.0f);
  return length(p - (a + d * along));
}

/// Halves the long border edges that have another part's border near, once. Returns whether any was.
bool cut_borders(Joined& joined, const ZipperConfig& config) {
  const Mesh& mesh = joined.mesh;
  const kit::EdgeTable table = kit::edge_table(mesh);
  const PointCloud cloud = sample_borders(joined, table, config.edge_m);
  if (cloud.points.empty()) return false;
  const KdTree tree(3, cloud, nanoflann::KDTreeSingleIndexAdaptorParams(16));
  std::vector<std::uint8_t> split(table.uses.size(), 0);
  std::vector<std::pair<std::uint32_t, float>> near;
  bool any = false;
  for (std::uint32_t h = 0; h < split.size(); ++h) {
    if (table.uses[h] != 1) continue;
    const std::uint32_t part = joined.part[kit::edge_from(mesh, h)];
    const Vec3f a = mesh.positions[kit::edge_from(mesh, h)], b = mesh.positions[kit::edge_to(mesh, h)];
    const float span = length(b - a);
    if (span <= config.edge_m * 1.5) continue;
    within(tree, (a + b) * 0.5f, span / 2 + config.max_gap_m, near);
    split[h] = std::any_of(near.begin(), near.end(), [&](const auto& n) {
      return cloud.tag[n.first] != part &&
             distance_to_segment(cloud.points[n.first], a, b) <= config.max_gap_m;
    });
    any |= split[h] != 0;
  }
  if (!any) return false;
  // A new vertex lies on an edge of one part.
  Mesh fine = kit::refine(mesh, split).mesh;
  std::vector<std::uint32_t> part = joined.part;
  part.resize(fine.positions.size(), 0);
  for (std::size_t t = 0; t < fine.triangles.size(); ++t) {
    const Triangle& tri = fine.triangles[t];
    for (const std::uint32_t v : tri)
      if (v >= joined.part.size())
        for (const std::uint32_t o : tri)
          if (o < joined.part.size()) part[v] = joined.part[o];
  }
  joined = {std::move(fine), std::move(part)};
  return true;
}

/// A way to fill a bit of the gap: a triangle from a border edge to a corner.
struct Filling {
  double cost = 0;
  std::uint32_t edge = 0, corner = 0;

  friend bool operator>(const Filling& a, const Filling& b) {
    return std::tie(a.cost, a.edge, a.corner) > std::tie(b.cost, b.edge, b.corner);
  }
};

/// Closes the gaps of a front, shortest connections first.
class Zipper {
 public:
  Zipper(const Joined& joined, Front& front, const ZipperConfig& config)
      : joined_(joined), front_(front), config_(config), cloud_(corners(joined, front)),
        tree_(3, cloud_, nanoflann::KDTreeSingleIndexAdaptorParams(16)) {}

  void run() {
    if (cloud_.points.empty()) return;
    for (std::uint32_t e = 0; e < front_.size(); ++e) offer(e);
    drain();
    // Loops that have become small by now may be closed inside one part too.
    for (std::uint32_t e = 0; e < front_.size(); ++e)
      if (front_.edge(e).alive && front_.loop_length(e, kSmallLoop)) offer(e);
    drain();
  }

 private:
  static PointCloud corners(const Joined& joined, const Front& front) {
    PointCloud cloud;
    for (std::uint32_t e = 0; e < front.size(); ++e) {
      cloud.points.push_back(joined.mesh.positions[front.edge(e).from]);
      cloud.tag.push_back(front.edge(e).from);
    }
    return cloud;
  }

  void drain() {
    while (!queue_.empty()) {
      const Filling f = queue_.top();
      queue_.pop();
      if (!front_.edge(f.edge).alive) continue;
      if (!front_.fits(f.edge, f.corner)) {
        offer(f.edge);
        continue;
      }
      for (const std::uint32_t fresh : front_.fill(f.edge, f.corner)) offer(fresh);
    }
  }

  /// Queues the best filling from an edge, if there is one.
  void offer(std::uint32_t e) {
    const Front::Edge edge = front_.edge(e);
    if (!edge.alive) return;
    const Vec3f u = joined_.mesh.positions[edge.from], v = joined_.mesh.positions[edge.to];
    const double reach = config_.max_gap_m + 0.5 * length(v - u);
    const bool small_loop = front_.loop_length(e, kSmallLoop).has_value();
    within(tree_, (u + v) * 0.5f, reach, near_);
    Filling best{std::numeric_limits<double>::max(), e, 0};
    for (const auto& [place, squared] : near_) {
      const std::uint32_t w = cloud_.tag[place];
      const Vec3f p = joined_.mesh.positions[w];
      const double cost = length(p - u) + length(p - v);
      if (cost >= best.cost || length(p - u) > reach || length(p - v) > reach) continue;
      if (!small_loop && !joins_parts(edge, w)) continue;
      for (const std::uint32_t corner : front_.corners_at(w))
        if (front_.fits(e, corner)) best = {cost, e, corner};
    }
    if (best.cost < std::numeric_limits<double>::max()) queue_.push(best);
  }

  bool joins_parts(const Front::Edge& edge, std::uint32_t tip) const {
    const auto& part = joined_.part;
    return part[edge.from] != part[tip] || part[edge.to] != part[tip];
  }

  const Joined& joined_;
  Front& front_;
  const ZipperConfig& config_;
  PointCloud cloud_;
  KdTree tree_;
  std::priority_queue<Filling, std::vector<Filling>, std::greater<>> queue_;
  std::vector<std::pair<std::uint32_t, float>> near_;
};

}  // namespace

Mesh zip(std::span<const Mesh> parts, const ZipperConfig& config) {
  Joined joined = join_parts(parts);
  if (parts.size() > 1)
    for (int i = 0; i < kMaxCuts && cut_borders(joined, config); ++i) {
    }
  Front front(joined.mesh);
  if (parts.size() > 1) Zipper(joined, front, config).run();
  joined.mesh.triangles.insert(joined.mesh.triangles.end(), front.added().begin(), front.added().end());
  return std::move(joined.mesh);
}

}  // namespace mr::merge
