#include "mr/simplify/collapser.h"

#include <algorithm>
#include <bit>
#include <cmath>

namespace mr::simplify {

namespace {

constexpr float kBorderWeight = 10;   // of a border's planes against the surface's
constexpr float kTipWeight = 3;       // of a border's sharp tips against its planes
constexpr float kHold = 0.01f;        // of relax()
constexpr float kMostTurn = 0.6f;     // cosine of the most that a triangle may turn
constexpr float kLeastAngle = 0.01f;  // sine, at a corner of a triangle that moves
constexpr int kTries = 2;             // neighbours tried before a vertex waits

// Costs are not negative, so their bits sort like them: exponent and one bit are the bucket.
constexpr int kBucketShift = 22;
constexpr int kBuckets = 0x7F800000 >> kBucketShift;
constexpr int kRetry = 4;  // buckets further on, where nothing was allowed
constexpr std::uint64_t kForbidden = std::uint64_t{0x7F800000} << 32;

int bucket_of(std::uint64_t rated) { return static_cast<int>(rated >> (32 + kBucketShift)); }

/// Bits that differ much between vertices, so that sums tell sets of vertices apart.
std::uint64_t signature(std::uint32_t v) {
  std::uint64_t h = (v + std::uint64_t{1}) * 0x9E3779B97F4A7C15ull;
  h ^= h >> 29;
  return h * 0xBF58476D1CE4E5B9ull;
}

/// The error at `to` once the planes of `from`, whose quadric is given, have moved there.
float merged_error(const Place& from, const Quadric& quadric, const Place& to) {
  const float error = to.error + (from.error + quadric.growth(to.at - from.at));
  return error > 0 ? error : 0;  // rounding
}

}  // namespace

Collapser::Collapser(const Mesh& mesh)
    : stars_(mesh),
      places_(mesh.positions.size()),
      quadrics_(mesh.positions.size()),
      kinds_(mesh.positions.size(), Kind::inner),
      along_(mesh.positions.size()),
      buckets_(kBuckets),
      behind_(mesh.positions.size(), kNobody) {
  for (std::size_t v = 0; v < places_.size(); ++v) places_[v].at = mesh.positions[v];
  add_planes(mesh);
}

void Collapser::add_planes(const Mesh& mesh) {
  // Each inner edge leaves a vertex once and comes back once; a sum that is not zero is a border.
  std::vector<std::uint64_t> unmatched(places_.size(), 0);
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const auto& [a, b, c] = mesh.triangles[t];
    if (a == b || b == c || c == a) continue;
    const Vec3f normal = mesh.area_normal(t);
    const float twice_area = length(normal);
    Quadric plane;
    if (twice_area > 0) plane.add_plane(normal / twice_area, twice_area / 2);
    const std::uint64_t at_a = signature(a), at_b = signature(b), at_c = signature(c);
    quadrics_[a] += plane, unmatched[a] += at_b - at_c;
    quadrics_[b] += plane, unmatched[b] += at_c - at_a;
    quadrics_[c] += plane, unmatched[c] += at_a - at_b;
  }
  for (std::uint32_t v = 0; v < places_.size(); ++v)
    if (unmatched[v] != 0) add_border(v);
}

void Collapser::add_border(std::uint32_t v) {
  const auto star = stars_.of(v);
  const Vec3f here = places_[v].at;
  int ends[2] = {0, 0};
  for (const Opposite o : star) {
    const Vec3f normal = cross(places_[o.a].at - here, places_[o.b].at - here);
    for (const int back : {0, 1}) {
      const std::uint32_t u = back ? o.b : o.a;
      if (std::any_of(star.begin(), star.end(),
                      [&](Opposite k) { return (back ? k.a : k.b) == u; }))
        continue;
      ++ends[back], along_[v][back] = u;
      const Vec3f edge = places_[u].at - here;
      quadrics_[v].add_plane(normalized(cross(edge, normal)), kBorderWeight * dot(edge, edge));
    }
  }
  kinds_[v] = ends[0] == 1 && ends[1] == 1 ? Kind::border : Kind::fixed;
  if (kinds_[v] == Kind::fixed) return;
  // Both planes of a thin tip pass near its root: without this it would be pulled in for nothing.
  const float sharp = dot(places_[along_[v][0]].at - here, places_[along_[v][1]].at - here);
  if (sharp > 0) quadrics_[v].add_point(kTipWeight * kBorderWeight * sharp);
}

/// Rates the neighbours that v may be pulled into; returns how many there are.
int Collapser::rate(std::uint32_t v) {
  const auto star = stars_.of(v);
  if (kinds_[v] == Kind::fixed || star.empty() || star.size() > Stars::kMaxSize) return 0;
  const Quadric quadric = quadrics_[v];
  const Place here = places_[v];
  const auto rated = [&](std::uint32_t u) {
    const float cost = merged_error(here, quadric, places_[u]);
    return std::uint64_t{std::bit_cast<std::uint32_t>(cost)} << 32 | u;
  };
  int n = 0;
  if (kinds_[v] == Kind::inner)
    for (const Opposite o : star) rated_[n++] = rated(o.a);
  else
    for (const std::uint32_t u : along_[v]) rated_[n++] = rated(u);
  return n;
}

std::uint64_t Collapser::cheapest(int candidates) const {
  std::uint64_t best = rated_[0];
  for (int i = 1; i < candidates; ++i) best = std::min(best, rated_[i]);
  return best;
}

/// Whether the triangles that stay keep their side and become no needles.
bool Collapser::keeps_facing() const {
  const Vec3f from = places_[plan_.v].at, to = places_[plan_.u].at;
  for (unsigned i = 0; i < plan_.kept; ++i) {
    const Vec3f a = places_[plan_.stays[i].a].at;
    const Vec3f side = places_[plan_.stays[i].b].at - a, arm = to - a;
    const Vec3f before = cross(side, from - a), after = cross(side, arm);
    const float along = dot(before, after), area2 = dot(after, after);
    const bool facing = (along > 0) &
                        (along * along > kMostTurn * kMostTurn * dot(before, before) * area2) &
                        (area2 > kLeastAngle * kLeastAngle * dot(side, side) * dot(arm, arm));
    if (!facing) return false;
  }
  return true;
}

/// Plans the collapse of v into u and tells whether it may be done.
bool Collapser::keeps_shape(std::uint32_t v, std::uint32_t u) {
  stars_.plan(v, u, plan_);
  return plan_.shared == (kinds_[v] == Kind::inner ? 2u : 1u) && keeps_facing() &&
         stars_.stays_manifold(plan_);
}

/// Does what was planned.
void Collapser::collapse() {
  const std::uint32_t v = plan_.v, u = plan_.u;
  places_[u].error = merged_error(places_[v], quadrics_[v], places_[u]);
  quadrics_[u] += quadrics_[v].moved(places_[u].at - places_[v].at);
  std::uint32_t end = u;
  if (kinds_[v] == Kind::border) {
    end = along_[v][1];
    const int to_u = along_[v][0] == u ? 0 : 1;
    const std::uint32_t other = along_[v][1 - to_u];
    along_[u][1 - to_u] = other;
    along_[other][to_u] = u;
  }
  stars_.collapse(plan_, end);
}

/// Removes v if that costs no more than `bucket`. Returns where v is to wait otherwise: a higher
/// bucket, or kBuckets and more when it is settled.
int Collapser::settle(std::uint32_t v, int bucket) {
  const int candidates = rate(v);
  if (candidates == 0) return kBuckets;
  for (int tried = 0; tried < kTries; ++tried) {
    const std::uint64_t best = cheapest(candidates);
    if (best == kForbidden) break;
    if (bucket_of(best) > bucket) return bucket_of(best);
    if (keeps_shape(v, static_cast<std::uint32_t>(best))) {
      collapse();
      return kBuckets;
    }
    std::replace(rated_.begin(), rated_.begin() + candidates, best, kForbidden);
  }
  return bucket + kRetry;
}

/// Up to which bucket collapses may be done in any order: so that about 8 in 10 of the vertices
/// that have to go go in the sweep. Judged by every 16th vertex.
int Collapser::cheap_bucket(std::size_t target) {
  std::vector<std::uint64_t> sample;
  for (std::uint32_t v = 0; v < places_.size(); v += 16)
    if (const int candidates = rate(v)) sample.push_back(cheapest(candidates));
  if (sample.empty()) return 0;
  const double to_go = static_cast<double>(stars_.triangle_count() - target) / 2;
  const double share = std::min(0.9, 1.1 * to_go / static_cast<double>(places_.size()));
  const auto middle =
      sample.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(sample.size()));
  std::nth_element(sample.begin(), middle, sample.end());
  return std::min(bucket_of(*middle), kBuckets - 1);
}

void Collapser::wait(std::uint32_t v, int bucket) {
  if (bucket >= kBuckets) return;
  Bucket& queue = buckets_[bucket];
  behind_[v] = kNobody;
  (queue.first == kNobody ? queue.first : behind_[queue.last]) = v;
  queue.last = v;
}

std::uint32_t Collapser::next(int bucket) {
  const std::uint32_t v = buckets_[bucket].first;
  if (v != kNobody) buckets_[bucket].first = behind_[v];
  return v;
}

void Collapser::reduce_to(std::size_t triangles) {
  if (stars_.triangle_count() <= triangles) return;
  const int cheap = cheap_bucket(triangles);
  for (std::uint32_t v = 0; v < places_.size() && stars_.triangle_count() > triangles; ++v)
    wait(v, settle(v, cheap));
  for (int bucket = cheap; bucket < kBuckets; ++bucket)
    while (stars_.triangle_count() > triangles) {
      const std::uint32_t v = next(bucket);
      if (v == kNobody) break;
      wait(v, settle(v, bucket));
    }
}

void Collapser::relax() {
  for (std::uint32_t v = 0; v < places_.size(); ++v) {
    const auto star = stars_.of(v);
    if (kinds_[v] != Kind::inner || star.empty()) continue;
    const Vec3f step = quadrics_[v].to_least_error(kHold);
    const Vec3f from = places_[v].at, to = from + step;
    const bool smooth = std::all_of(star.begin(), star.end(), [&](Opposite o) {
      const Vec3f a = places_[o.a].at, b = places_[o.b].at;
      const Vec3f before = cross(a - from, b - from), after = cross(a - to, b - to);
      const float along = dot(before, after);
      return along > 0 && along * along > 0.5f * dot(before, before) * dot(after, after);
    });
    if (!smooth) continue;
    places_[v].error = std::max(0.0f, places_[v].error + quadrics_[v].growth(step));
    places_[v].at = to;
    quadrics_[v] = quadrics_[v].moved(step);
  }
}

Mesh Collapser::mesh() const {
  Mesh out;
  out.triangles.reserve(stars_.triangle_count());
  std::vector<std::uint32_t> index(places_.size(), kNobody);
  for (std::uint32_t v = 0; v < places_.size(); ++v)
    for (const Opposite o : stars_.of(v)) {
      if (v > o.a || v > o.b) continue;  // each triangle once, from its first vertex
      Triangle triangle{v, o.a, o.b};
      for (std::uint32_t& corner : triangle) {
        if (index[corner] == kNobody) {
          index[corner] = static_cast<std::uint32_t>(out.positions.size());
          out.positions.push_back(places_[corner].at);
        }
        corner = index[corner];
      }
      out.triangles.push_back(triangle);
    }
  return out;
}

float Collapser::error_m() const {
  float worst = 0;
  for (std::uint32_t v = 0; v < places_.size(); ++v)
    if (!stars_.of(v).empty() && quadrics_[v].weight > 0)
      worst = std::max(worst, places_[v].error / quadrics_[v].weight);
  return std::sqrt(worst);
}

}  // namespace mr::simplify
