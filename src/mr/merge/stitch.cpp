#include "mr/merge/stitch.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>
#include <span>

#include "mr/core/parallel.h"
#include "mr/kit/pair_map.h"
#include "mr/kit/topology.h"
#include "mr/merge/border_samples.h"
#include "mr/merge/point_grid.h"

namespace mr::merge {
namespace {

constexpr std::uint32_t kNone = 0xFFFFFFFFu;
constexpr int kMaxRounds = 24;
constexpr float kSameFacing = 0.5f;  // cosine between the surfaces
constexpr float kTurned = 0.03f;     // cosine by which a triangle may turn
constexpr float kNeedle = 1e-4f;     // roundness of a triangle that is none
constexpr std::size_t kMostCorners = 16;
constexpr float kSnapShare = 0.2f;  // of an edge

/// Where a border vertex would be sewn on.
struct Place {
  float distance_m = 0;
  std::uint32_t edge = kNone;  // in Joined::border
  float t = 0;                 // along it
};

/// A vertex that is put into an edge.
struct Inserted {
  std::uint32_t edge;
  float t;
  std::uint32_t vertex;
};

class Stitcher {
 public:
  Stitcher(Joined& joined, const StitchConfig& config)
      : joined_(joined), mesh_(joined.mesh), config_(config) {
    const std::size_t count = mesh_.positions.size();
    leaving_.assign(count, kNone), coming_.assign(count, kNone);
    for (std::uint32_t e = 0; e < joined.border.size(); ++e)
      leaving_[from(e)] = e, coming_[to(e)] = e;
  }

  void run() {
    find_places();
    find_touched();
    blocked_.assign(mesh_.positions.size(), 0);
    for (int round = 0; round < kMaxRounds; ++round) {
      plan();
      if (rebuild()) break;
      if (round + 2 == kMaxRounds) std::fill(blocked_.begin(), blocked_.end(), 1);
    }
    mesh_.positions = std::move(moved_);
    assemble();
    split_fans(joined_);
  }

 private:
  std::uint32_t from(std::uint32_t e) const { return kit::edge_from(mesh_, joined_.border[e]); }
  std::uint32_t to(std::uint32_t e) const { return kit::edge_to(mesh_, joined_.border[e]); }
  Vec3f at(std::uint32_t v) const { return mesh_.positions[v]; }
  Vec3f facing(std::uint32_t e) const {
    return normalized(mesh_.area_normal(joined_.border[e] / 3));
  }

  /// The samples that another part's border may be near; notes their edges.
  TaggedPoints near_other_parts(const TaggedPoints& samples, float reach) {
    const PartsNearby nearby(joined_, samples, reach);
    near_.assign(joined_.border.size(), 0);
    TaggedPoints out;
    for (std::size_t i = 0; i < samples.points.size(); ++i) {
      const std::uint32_t e = samples.tag[i];
      if (!nearby.has_other(samples.points[i], joined_.part[from(e)])) continue;
      near_[e] = 1;
      out.points.push_back(samples.points[i]), out.tag.push_back(e);
    }
    return out;
  }

  /// The nearest edge of another part's border that runs the other way, for every border vertex.
  void find_places() {
    const auto reach = static_cast<float>(config_.reach_m), spacing = 2 * reach;
    const TaggedPoints samples = near_other_parts(sample_border(joined_, spacing), 2 * reach);
    const PointGrid grid(samples.points, 2 * reach);
    places_.assign(joined_.border.size(), {});
    parallel_for(places_.size(), 512, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        const auto e = static_cast<std::uint32_t>(i);
        if (!near_[i]) continue;
        const std::uint32_t v = from(e);
        const Vec3f along =
            coming_[v] == kNone ? at(to(e)) - at(v) : at(to(e)) - at(from(coming_[v]));
        const Vec3f normal = facing(e);
        Place best{reach, kNone, 0};
        grid.within(at(v), reach + spacing / 2, [&](std::uint32_t k) {
          const std::uint32_t other = samples.tag[k];
          if (joined_.part[from(other)] == joined_.part[v]) return;
          const Vec3f a = at(from(other)), d = at(to(other)) - a;
          const float t = std::clamp(dot(at(v) - a, d) / std::max(dot(d, d), 1e-20f), 0.0f, 1.0f);
          const float distance = length(a + d * t - at(v));
          if (distance > best.distance_m || (distance == best.distance_m && other >= best.edge))
            return;
          if (dot(along, d) >= 0 || dot(normal, facing(other)) < kSameFacing) return;
          best = {distance, other, t};
        });
        places_[i] = best;
      }
    });
    order_.clear();
    for (std::uint32_t e = 0; e < places_.size(); ++e)
      if (places_[e].edge != kNone) order_.push_back(e);
    std::ranges::sort(order_, {},
                      [&](std::uint32_t e) { return std::pair(places_[e].distance_m, e); });
  }

  /// The triangles that sewing may change.
  void find_touched() {
    std::vector<std::uint8_t> moves(mesh_.positions.size(), 0);
    for (const std::uint32_t e : order_)
      moves[from(e)] = moves[from(places_[e].edge)] = moves[to(places_[e].edge)] = 1;
    is_touched_.assign(mesh_.triangles.size(), 0);
    for (std::uint32_t t = 0; t < mesh_.triangles.size(); ++t) {
      const auto& [a, b, c] = mesh_.triangles[t];
      is_touched_[t] = moves[a] | moves[b] | moves[c];
      if (is_touched_[t]) touched_.push_back(t);
    }
  }

  /// The triangles that stay as they are, then those as planned.
  void assemble() {
    std::vector<Triangle> all;
    all.reserve(mesh_.triangles.size() + triangles_.size());
    for (std::uint32_t t = 0; t < mesh_.triangles.size(); ++t)
      if (!is_touched_[t]) all.push_back(mesh_.triangles[t]);
    all.insert(all.end(), triangles_.begin(), triangles_.end());
    mesh_.triangles = std::move(all);
  }

  /// Decides which vertices go where, nearest first; each is sewn on once.
  void plan() {
    moved_ = mesh_.positions;
    merged_.resize(mesh_.positions.size());
    std::iota(merged_.begin(), merged_.end(), 0u);
    sewn_.assign(mesh_.positions.size(), 0);
    inserted_.clear();
    for (const std::uint32_t e : order_) {
      const std::uint32_t v = from(e);
      if (sewn_[v] || blocked_[v]) continue;
      const Place& place = places_[e];
      const std::uint32_t a = from(place.edge), b = to(place.edge);
      const float edge_m = length(at(b) - at(a));
      const float snap = std::max(static_cast<float>(config_.snap_m), kSnapShare * edge_m);
      const bool at_a = place.t * edge_m <= snap, at_b = (1 - place.t) * edge_m <= snap;
      if (at_a || at_b) {
        const std::uint32_t w = at_a && (!at_b || place.t <= 0.5f) ? a : b;
        if (blocked_[w] || length(at(w) - at(v)) > config_.reach_m) continue;
        if (sewn_[w]) {  // there already: the edge along the border goes
          const Vec3f there = moved_[merged_[w]];
          if (length(there - at(v)) > config_.reach_m / 2) continue;
          merged_[v] = merged_[w], moved_[v] = there, sewn_[v] = 1;
          continue;
        }
        merged_[w] = v;
        moved_[v] = moved_[w] = (at(v) + at(w)) * 0.5f;
        sewn_[v] = sewn_[w] = 1;
      } else {
        inserted_.push_back({place.edge, place.t, v});
        moved_[v] = (at(v) + at(a) + (at(b) - at(a)) * place.t) * 0.5f;
        sewn_[v] = 1;
      }
    }
    std::ranges::sort(inserted_, {},
                      [](const Inserted& i) { return std::tuple(i.edge, i.t, i.vertex); });
  }

  /// The triangles as planned. False where some would turn over or make an edge of three: then
  /// their vertices are blocked.
  bool rebuild() {
    triangles_.clear();
    std::vector<std::uint32_t> polygon_of(mesh_.triangles.size(), kNone);
    for (std::uint32_t i = 0; i < inserted_.size(); ++i)
      polygon_of[joined_.border[inserted_[i].edge] / 3] = i;
    bool sound = true;
    kit::PairMap edges(4 * inserted_.size() + 1024);
    std::vector<std::uint32_t> polygon;
    for (const std::uint32_t t : touched_) {
      const Triangle& old = mesh_.triangles[t];
      const bool touched = sewn_[old[0]] | sewn_[old[1]] | sewn_[old[2]];
      if (!touched && polygon_of[t] == kNone) {
        triangles_.push_back(old);
        continue;
      }
      polygon.clear();
      for (std::uint32_t i = 0; i < 3; ++i) {
        add_corner(polygon, merged_[old[i]]);
        if (polygon_of[t] != kNone) add_inserted(polygon, 3 * t + i);
      }
      if (polygon.size() > 1 && polygon.front() == polygon.back()) polygon.pop_back();
      if (!fill(polygon, mesh_.area_normal(t), edges)) {
        sound = false;
        block(old, polygon);
      }
    }
    return sound;
  }

  /// Of the vertices of a piece that cannot be, the one that moved farthest stays where it was.
  void block(const Triangle& old, const std::vector<std::uint32_t>& polygon) {
    std::uint32_t worst = kNone;
    float farthest = -1;
    const auto look = [&](std::uint32_t v) {
      if (!sewn_[v] || blocked_[v]) return;
      const float way = length(moved_[v] - mesh_.positions[v]);
      if (way > farthest) farthest = way, worst = v;
    };
    for (const std::uint32_t v : old) look(v);
    for (const std::uint32_t v : polygon) look(v);
    if (worst != kNone) blocked_[worst] = 1;
  }

  static void add_corner(std::vector<std::uint32_t>& polygon, std::uint32_t v) {
    if (polygon.empty() || polygon.back() != v) polygon.push_back(v);
  }

  void add_inserted(std::vector<std::uint32_t>& polygon, std::uint32_t half_edge) const {
    const auto e = std::ranges::lower_bound(joined_.border, half_edge);
    if (e == joined_.border.end() || *e != half_edge) return;
    const auto number = static_cast<std::uint32_t>(e - joined_.border.begin());
    const auto range = std::ranges::equal_range(inserted_, number, {}, &Inserted::edge);
    for (const Inserted& i : range) add_corner(polygon, merged_[i.vertex]);
  }

  /// Cuts a polygon into triangles that face like the one it was; of all ways the one whose worst
  /// triangle is the roundest.
  bool fill(const std::vector<std::uint32_t>& polygon, Vec3f facing, kit::PairMap& edges) {
    const std::size_t n = polygon.size();
    if (n < 3) return true;
    if (n > kMostCorners) return false;
    std::array<std::array<float, kMostCorners>, kMostCorners> worst{};
    std::array<std::array<std::uint8_t, kMostCorners>, kMostCorners> tip{};
    for (std::size_t span = 1; span < n; ++span)
      for (std::size_t i = 0; i + span < n; ++i) {
        const std::size_t j = i + span;
        worst[i][j] = span == 1 ? std::numeric_limits<float>::max() : -1;
        for (std::size_t k = i + 1; k < j; ++k) {
          const float w = std::min(
              {worst[i][k], worst[k][j], roundness(polygon[i], polygon[k], polygon[j], facing)});
          if (w > worst[i][j]) worst[i][j] = w, tip[i][j] = static_cast<std::uint8_t>(k);
        }
      }
    std::vector<std::pair<std::size_t, std::size_t>> open{{0, n - 1}};
    while (!open.empty()) {
      const auto [i, j] = open.back();
      open.pop_back();
      if (j - i < 2) continue;
      const std::size_t k = tip[i][j];
      if (worst[i][j] <= 0 || !add({polygon[i], polygon[k], polygon[j]}, facing, edges))
        return false;
      open.emplace_back(i, k), open.emplace_back(k, j);
    }
    return true;
  }

  bool add(const Triangle& t, Vec3f facing, kit::PairMap& edges) {
    const auto& [a, b, c] = t;
    if (a == b || b == c || c == a) return false;
    const Vec3f normal = cross(moved_[b] - moved_[a], moved_[c] - moved_[a]);
    if (dot(normal, facing) < kTurned * length(normal) * length(facing)) return false;
    for (const auto& [p, q] : {std::pair(a, b), std::pair(b, c), std::pair(c, a)})
      if (sewn_[p] && sewn_[q] &&
          edges.get_or_add(static_cast<std::uint64_t>(p) << 32 | q, 0)++ > 0)
        return false;
    triangles_.push_back(t);
    return true;
  }

  /// Over 0 when a triangle faces like the one before and is no needle.
  float roundness(std::uint32_t a, std::uint32_t b, std::uint32_t c, Vec3f facing) const {
    const Vec3f ab = moved_[b] - moved_[a], bc = moved_[c] - moved_[b], ca = moved_[a] - moved_[c];
    const float around = dot(ab, ab) + dot(bc, bc) + dot(ca, ca);
    const float round = dot(cross(ab, bc), facing) / std::max(around * length(facing), 1e-30f);
    return round > kNeedle ? round : -1;
  }

  Joined& joined_;
  Mesh& mesh_;
  const StitchConfig& config_;
  std::vector<std::uint32_t> leaving_, coming_;  // [V] border edges
  std::vector<std::uint8_t> near_;               // [border] another part's may be near
  std::vector<Place> places_;                    // [border] of the vertex that the edge starts at
  std::vector<std::uint32_t> order_;             // border edges with a place, the nearest first
  std::vector<std::uint8_t> is_touched_;         // [T]
  std::vector<std::uint32_t> touched_;           // triangles
  std::vector<std::uint8_t> blocked_, sewn_;     // [V]
  std::vector<std::uint32_t> merged_;            // [V] the vertex that it became
  std::vector<Inserted> inserted_;
  std::vector<Vec3f> moved_;
  std::vector<Triangle> triangles_;
};

}  // namespace

void stitch(Joined& joined, const StitchConfig& config) {
  if (!joined.border.empty()) Stitcher(joined, config).run();
}

}  // namespace mr::merge
