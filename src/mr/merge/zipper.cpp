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

constexpr int kMaxCuts = 6;     // halvings of a border edge
constexpr int kSmallLoop = 30;  // edges of a loop that is closed at all costs

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
  float kdtree_get_pt(std::size_t i, std::size_t axis) const {
    return points[i][static_cast<int>(axis)];
  }
  template <typename Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }
};
using KdTree = nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<float, PointCloud>,
                                                   PointCloud, 3>;

/// Places of all points within `radius`, nearest first.
void within(const KdTree& tree, Vec3f p, double radius,
            std::vector<std::pair<std::uint32_t, float>>& found) {
  found.clear();
  const float query[3] = {p.x, p.y, p.z};
  // nanoflann's L2 radius is the square.
  tree.radiusSearch(query, static_cast<float>(radius * radius), found,
                    nanoflann::SearchParams(32, 0, false));
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
    const Vec3f p = joined.mesh.positions[a],
                q = joined.mesh.positions[kit::edge_to(joined.mesh, h)];
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

/// Halves the long border edges that have another part's border near, once. Returns whether any
/// was.
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
    const Vec3f a = mesh.positions[kit::edge_from(mesh, h)],
                b = mesh.positions[kit::edge_to(mesh, h)];
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
      : joined_(joined),
        front_(front),
        config_(config),
        original_edges_(front.size()),
        cloud_(corners(joined, front)),
        tree_(3, cloud_, nanoflann::KDTreeSingleIndexAdaptorParams(16)) {}

  void run() {
    if (cloud_.points.empty()) return;
    for (std::uint32_t e = 0; e < front_.size(); ++e) offer(e);
    drain();
    for (std::uint32_t e = 0; e < front_.size(); ++e)
      if (is_remainder(e)) close_small_loop(e);
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

  /// Whether `e` is on a small loop that strips left over, or around a pinhole.
  bool is_remainder(std::uint32_t e) const {
    if (!front_.edge(e).alive || !front_.loop_length(e, kSmallLoop)) return false;
    double around = 0;
    std::uint32_t k = e;
    bool left_over = false;
    do {
      around += length(at(front_.edge(k).to) - at(front_.edge(k).from));
      left_over |= k >= original_edges_;
      k = front_.edge(k).next;
    } while (k != e);
    return left_over || around < 2 * config_.max_gap_m;
  }

  /// Cuts off ears, the smallest first, until the small loop that `e` is on is closed or no ear
  /// fits.
  void close_small_loop(std::uint32_t e) {
    while (front_.edge(e).alive && front_.loop_length(e, kSmallLoop)) {
      double least = std::numeric_limits<double>::max();
      std::uint32_t best = e;
      std::uint32_t k = e;
      do {
        const Vec3f u = at(front_.edge(k).from), w = at(front_.edge(front_.ear_corner(k)).from);
        if (length(w - u) < std::min<double>(least, 2 * config_.max_gap_m) && front_.fits_as_ear(k))
          least = length(w - u), best = k;
        k = front_.edge(k).next;
      } while (k != e);
      if (least == std::numeric_limits<double>::max()) return;
      const auto fresh = front_.fill(best, front_.ear_corner(best));
      if (!front_.edge(e).alive && !fresh.empty()) e = fresh.front();
    }
  }

  void drain() {
    while (!queue_.empty()) {
      const Filling f = queue_.top();
      queue_.pop();
      if (!front_.edge(f.edge).alive) continue;
      look_around(f.edge);
      if (!front_.fits(f.edge, f.corner) || blocked(f.edge, front_.edge(f.corner).from)) {
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
    const Vec3f u = at(edge.from), v = at(edge.to);
    const double reach = look_around(e);
    Filling best{std::numeric_limits<double>::max(), e, 0};
    for (const auto& [place, squared] : near_) {
      const std::uint32_t w = cloud_.tag[place];
      const Vec3f p = at(w);
      const double cost = length(p - u) + length(p - v);
      if (cost >= best.cost || length(p - u) > reach || length(p - v) > reach) continue;
      if (!joins_parts(edge, w)) continue;
      for (const std::uint32_t corner : front_.corners_at(w))
        if (front_.fits(e, corner) && !blocked(e, w)) best = {cost, e, corner};
    }
    if (best.cost < std::numeric_limits<double>::max()) queue_.push(best);
  }

  /// Finds the border vertices that a triangle over `e` may reach or meet; returns how far it may
  /// reach.
  double look_around(std::uint32_t e) {
    const Vec3f u = at(front_.edge(e).from), v = at(front_.edge(e).to);
    const double reach = config_.max_gap_m + 0.5 * length(v - u);
    within(tree_, (u + v) * 0.5f, reach, near_);
    return reach;
  }

  /// Whether the triangle over `e` with tip `w` would lie across another border nearby: seen along
  /// its normal, a border vertex lies inside it or a border edge crosses one of its new edges.
  bool blocked(std::uint32_t e, std::uint32_t w) const {
    const Vec3f u = at(front_.edge(e).from), v = at(front_.edge(e).to), tip = at(w);
    const Vec3f normal = cross(u - v, tip - v);
    const auto side = [&](Vec3f a, Vec3f b, Vec3f p) { return dot(normal, cross(b - a, p - a)); };
    const float slack = 1e-4f * dot(normal, normal);
    const auto inside = [&](Vec3f p) {
      return side(v, u, p) > slack && side(u, tip, p) > slack && side(tip, v, p) > slack;
    };
    const auto cross_each_other = [&](Vec3f a, Vec3f b, Vec3f c, Vec3f d) {
      return side(a, b, c) * side(a, b, d) < 0 && side(c, d, a) * side(c, d, b) < 0 &&
             std::min(std::abs(side(a, b, c)), std::abs(side(a, b, d))) > slack;
    };
    for (const auto& [place, squared] : near_)
      for (const std::uint32_t corner : front_.corners_at(cloud_.tag[place])) {
        const Vec3f p = at(front_.edge(corner).from), q = at(front_.edge(corner).to);
        if (inside(p) || inside(q) || cross_each_other(u, tip, p, q) ||
            cross_each_other(tip, v, p, q))
          return true;
      }
    return false;
  }

  Vec3f at(std::uint32_t vertex) const { return joined_.mesh.positions[vertex]; }

  bool joins_parts(const Front::Edge& edge, std::uint32_t tip) const {
    const auto& part = joined_.part;
    return part[edge.from] != part[tip] || part[edge.to] != part[tip];
  }

  const Joined& joined_;
  Front& front_;
  const ZipperConfig& config_;
  std::size_t original_edges_;
  PointCloud cloud_;
  KdTree tree_;
  std::priority_queue<Filling, std::vector<Filling>, std::greater<>> queue_;
  std::vector<std::pair<std::uint32_t, float>> near_;
};

}  // namespace

Mesh zip(std::span<const Mesh> parts, const ZipperConfig& config) {
  if (parts.size() == 1) return {parts[0].positions, parts[0].triangles, {}};
  Joined joined = join_parts(parts);
  for (int i = 0; i < kMaxCuts && cut_borders(joined, config); ++i) {
  }
  Front front(joined.mesh);
  Zipper(joined, front, config).run();
  joined.mesh.triangles.insert(joined.mesh.triangles.end(), front.added().begin(),
                               front.added().end());
  return std::move(joined.mesh);
}

}  // namespace mr::merge
