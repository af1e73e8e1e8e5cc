#include <algorithm>
#include <array>
#include <cstdint>
#include <iterator>
#include <queue>

#include "simplify_contenders.h"
#include "surfaces.h"

namespace mr::bench {
namespace {

constexpr double kBorderWeight = 10;  // of the planes that hold a border, against surface

/// The weighted sum of squared distances to planes dot(n, p) + d = 0.
struct Quadric {
  double xx = 0, xy = 0, xz = 0, yy = 0, yz = 0, zz = 0;
  Vec3d linear;
  double constant = 0;

  void add_plane(Vec3d n, double d, double weight) {
    xx += weight * n.x * n.x, xy += weight * n.x * n.y, xz += weight * n.x * n.z;
    yy += weight * n.y * n.y, yz += weight * n.y * n.z, zz += weight * n.z * n.z;
    linear += weight * d * n;
    constant += weight * d * d;
  }
  Quadric& operator+=(const Quadric& q) {
    xx += q.xx, xy += q.xy, xz += q.xz, yy += q.yy, yz += q.yz, zz += q.zz;
    linear += q.linear;
    constant += q.constant;
    return *this;
  }
  Vec3d rows_times(Vec3d p) const {
    return {dot({xx, xy, xz}, p), dot({xy, yy, yz}, p), dot({xz, yz, zz}, p)};
  }
  double at(Vec3d p) const { return dot(rows_times(p), p) + 2 * dot(linear, p) + constant; }

  /// Where it is least, by Cramer's rule; false where that is no single point.
  bool least(Vec3d& p) const {
    const Vec3d a{xx, xy, xz}, b{xy, yy, yz}, c{xz, yz, zz};
    const double determinant = dot(a, cross(b, c)), trace = xx + yy + zz;
    if (!(determinant > 1e-5 * trace * trace * trace)) return false;
    p = (cross(b, c) * linear.x + cross(c, a) * linear.y + cross(a, b) * linear.z) / -determinant;
    return true;
  }
};

/// Edges wait in one heap; those that have changed since stay in it and are passed over.
class HeapSimplifier {
 public:
  explicit HeapSimplifier(const Mesh& mesh)
      : triangles_(mesh.triangles),
        around_(mesh.positions.size()),
        quadrics_(mesh.positions.size()),
        version_(mesh.positions.size()),
        left_(mesh.triangles.size()) {
    for (const Vec3f p : mesh.positions) positions_.push_back(vec_cast<double>(p));
    for (std::uint32_t t = 0; t < triangles_.size(); ++t)
      for (const std::uint32_t v : triangles_[t]) around_[v].push_back(t);
    for (const Triangle& triangle : triangles_) add_planes(triangle);
    for (std::uint32_t v = 0; v < around_.size(); ++v)
      for (const std::uint32_t n : neighbours(v))
        if (v < n) push(v, n);
  }

  void run(std::size_t triangles) {
    while (left_ > triangles && !heap_.empty()) {
      const Edge edge = heap_.top();
      heap_.pop();
      if (edge.versions != version_[edge.keep] + version_[edge.drop]) continue;
      const Vec3d place = best_place(edge.keep, edge.drop);
      if (may_collapse(edge.keep, edge.drop, place)) collapse(edge.keep, edge.drop, place);
    }
  }

  Mesh mesh() const {
    Mesh out;
    std::vector<std::uint32_t> number(positions_.size());
    for (std::uint32_t v = 0; v < positions_.size(); ++v) {
      if (around_[v].empty()) continue;
      number[v] = static_cast<std::uint32_t>(out.positions.size());
      out.positions.push_back(vec_cast<float>(positions_[v]));
    }
    for (const Triangle& t : triangles_)
      if (t[0] != t[1]) out.triangles.push_back({number[t[0]], number[t[1]], number[t[2]]});
    return out;
  }

 private:
  struct Edge {
    double cost;
    std::uint32_t keep, drop;
    std::uint64_t versions;  ///< the sum of its ends'; versions only grow
    bool operator<(const Edge& other) const { return cost > other.cost; }  // the cheapest on top
  };

  Vec3d normal(const Triangle& t) const {
    return cross(positions_[t[1]] - positions_[t[0]], positions_[t[2]] - positions_[t[0]]);
  }

  bool has(std::uint32_t triangle, std::uint32_t v) const {
    return std::ranges::find(triangles_[triangle], v) != triangles_[triangle].end();
  }

  std::ptrdiff_t triangles_at(std::uint32_t a, std::uint32_t b) const {
    return std::ranges::count_if(around_[a], [&](std::uint32_t t) { return has(t, b); });
  }

  std::vector<std::uint32_t> neighbours(std::uint32_t v) const {
    std::vector<std::uint32_t> out;
    for (const std::uint32_t t : around_[v])
      for (const std::uint32_t n : triangles_[t])
        if (n != v) out.push_back(n);
    std::ranges::sort(out);
    out.erase(std::unique(out.begin(), out.end()), out.end());
    return out;
  }

  bool on_border(std::uint32_t v) const {
    return std::ranges::any_of(neighbours(v),
                               [&](std::uint32_t n) { return triangles_at(v, n) == 1; });
  }

  /// The triangle's, by area, and through its border edges planes that stand upright on it.
  void add_planes(const Triangle& triangle) {
    const Vec3d normal_area = normal(triangle), n = normalized(normal_area);
    for (int i = 0; i < 3; ++i) {
      const std::uint32_t a = triangle[i], b = triangle[(i + 1) % 3];
      quadrics_[a].add_plane(n, -dot(n, positions_[a]), length(normal_area) / 2);
      if (triangles_at(a, b) != 1) continue;
      const Vec3d along = positions_[b] - positions_[a], upright = normalized(cross(along, n));
      for (const std::uint32_t v : {a, b})
        quadrics_[v].add_plane(upright, -dot(upright, positions_[a]),
                               kBorderWeight * dot(along, along));
    }
  }

  Vec3d best_place(std::uint32_t a, std::uint32_t b) const {
    Quadric sum = quadrics_[a];
    sum += quadrics_[b];
    Vec3d best;
    if (sum.least(best)) return best;
    best = positions_[a];
    for (const Vec3d p : {positions_[b], (positions_[a] + positions_[b]) / 2.0})
      if (sum.at(p) < sum.at(best)) best = p;
    return best;
  }

  void push(std::uint32_t a, std::uint32_t b) {
    Quadric sum = quadrics_[a];
    sum += quadrics_[b];
    heap_.push({sum.at(best_place(a, b)), a, b, version_[a] + version_[b]});
  }

  /// Whether the surface stays what it is (no more shared neighbours than triangles at the edge, no
  /// two borders joined across it), and nothing is turned over.
  bool may_collapse(std::uint32_t a, std::uint32_t b, Vec3d place) const {
    const auto at_a = neighbours(a), at_b = neighbours(b);
    std::vector<std::uint32_t> shared;
    std::ranges::set_intersection(at_a, at_b, std::back_inserter(shared));
    const std::ptrdiff_t triangles = triangles_at(a, b);
    if (static_cast<std::ptrdiff_t>(shared.size()) != triangles) return false;
    if (triangles != 1 && on_border(a) && on_border(b)) return false;
    return !turns_over(a, b, place) && !turns_over(b, a, place);
  }

  bool turns_over(std::uint32_t moved, std::uint32_t other, Vec3d place) const {
    return std::ranges::any_of(around_[moved], [&](std::uint32_t t) {
      if (has(t, other)) return false;
      std::array<Vec3d, 3> p;
      for (int i = 0; i < 3; ++i)
        p[i] = triangles_[t][i] == moved ? place : positions_[triangles_[t][i]];
      return dot(cross(p[1] - p[0], p[2] - p[0]), normal(triangles_[t])) <= 0;
    });
  }

  void collapse(std::uint32_t keep, std::uint32_t drop, Vec3d place) {
    for (const std::uint32_t t : around_[drop]) {
      if (has(t, keep)) {
        for (const std::uint32_t v : triangles_[t])
          if (v != drop) std::erase(around_[v], t);
        triangles_[t] = {drop, drop, drop};
        --left_;
      } else {
        std::ranges::replace(triangles_[t], drop, keep);
        around_[keep].push_back(t);
      }
    }
    around_[drop].clear();
    positions_[keep] = place;
    quadrics_[keep] += quadrics_[drop];
    ++version_[keep], ++version_[drop];
    for (const std::uint32_t n : neighbours(keep)) push(keep, n);
  }

  std::vector<Triangle> triangles_;  ///< one vertex three times: gone
  std::vector<std::vector<std::uint32_t>> around_;
  std::vector<Vec3d> positions_;
  std::vector<Quadric> quadrics_;
  std::vector<std::uint64_t> version_;
  std::size_t left_;
  std::priority_queue<Edge> heap_;
};

class Heap final : public Work {
 public:
  explicit Heap(const SimplifyCase& input) : input_(input) {}

  void clear() override { small_ = {}; }
  void run(StageClock&) override {
    HeapSimplifier simplifier(*input_.mesh);
    simplifier.run(input_.triangles);
    small_ = simplifier.mesh();
  }
  Message result() override { return to_message(small_); }

 private:
  const SimplifyCase& input_;
  Mesh small_;
};

}  // namespace

Contender simplify_heap(const SimplifyCase& input) {
  return {"heap", 1, Message::object(), [&input] { return std::make_unique<Heap>(input); }};
}

}  // namespace mr::bench
