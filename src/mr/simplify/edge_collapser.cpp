#include "mr/simplify/edge_collapser.h"

#include <algorithm>
#include <bit>

namespace mr::simplify {

namespace {

constexpr float kDamping = 0.01f;       // of relax()
constexpr float kMostTurn2 = 0.36f;     // square of the cosine of the most that a triangle may turn
constexpr float kMostRelax2 = 0.5f;     // the same in relax()
constexpr float kLeastQuality = 0.05f;  // of a triangle, 1 being equilateral, unless in its ring
constexpr float kWorse2 = 0.5f;         // one is worse: then this share of its square
constexpr float kStay = 1e-7f;          // m2 of error per m2 of way: where all is flat, the nearest
constexpr int kTries = 4;               // neighbours tried

}  // namespace

void EdgeCollapser::load(std::uint32_t v) {
  near_.load(mesh_.rings, mesh_.places.data(), v);
  measured_ = false;
}

float EdgeCollapser::rate(std::uint32_t v) {
  load(v);
  const Quadric& quadric = mesh_.quadrics[v];
  const float own = mesh_.places[v].error;
  const float stay = kStay * quadric.weight;
  for (std::uint32_t i = 0; i < near_.lanes(); i += 4) {
    const kit::Vec3x4 way = near_.arms(i);
    const kit::Float4 sum = near_.errors(i) + (own + quadric.growth(way));
    const kit::Float4 error = sum > 0 ? sum : kit::Float4{};  // less by rounding only
    const kit::Float4 cost = error + stay * dot(way, way);
    kit::store4(error, &error_[i]);
    kit::store4(near_.places(i) < near_.size() ? cost : kNever + kit::Float4{}, &cost_[i]);
  }
  const VertexKind kind = mesh_.kinds[v];
  if (kind == VertexKind::border)
    for (std::uint32_t i = 1; i + 1 < near_.size(); ++i) cost_[i] = kNever;
  if (kind == VertexKind::crease) {
    const VertexRings::Line& labels = mesh_.rings.labels(v);
    for (std::uint32_t i = 0; i < near_.size(); ++i)
      if (labels[i] == labels[i > 0 ? i - 1 : near_.size() - 1]) cost_[i] = kNever;
  }
  return choose();
}

/// Finds the best neighbour; the first of equals.
float EdgeCollapser::choose() {
  kit::Float4 least = kit::load4<kit::Float4>(&cost_[0]);
  for (std::uint32_t i = 4; i < near_.lanes(); i += 4) {
    const kit::Float4 cost = kit::load4<kit::Float4>(&cost_[i]);
    least = cost < least ? cost : least;
  }
  const float best = kit::min_lane(least);
  std::uint32_t found = 0;
  for (std::uint32_t i = 0; i < near_.lanes(); i += 4)
    found |= kit::sign_bits(kit::load4<kit::Float4>(&cost_[i]) == best) << i;
  best_ = static_cast<std::uint32_t>(std::countr_zero(found));
  return best;
}

/// 12 area2 / edges² is the square of 4 √3 area / edges, which is 1 for equilateral triangles.
void EdgeCollapser::measure_triangles() {
  kit::Float4 least = 1 + kit::Float4{};
  for (std::uint32_t i = 0; i < near_.lanes(); i += 4) {
    const kit::Vec3x4 a = near_.arms(i), b = near_.arms(i + 1), side = a - b, normal = cross(a, b);
    const kit::Float4 area2 = dot(normal, normal), edges = dot(a, a) + dot(b, b) + dot(side, side);
    kit::store4(normal.x, &nx_[i]), kit::store4(normal.y, &ny_[i]), kit::store4(normal.z, &nz_[i]);
    kit::store4(area2, &area2_[i]);
    const kit::Float4 quality2 = 12 * area2 / (edges * edges);
    const kit::Int4 counts = (near_.places(i) < near_.triangles()) & (quality2 < least);
    least = counts ? quality2 : least;
  }
  const float worst = kit::min_lane(least);
  least_quality2_ = std::min(kLeastQuality * kLeastQuality,
                             worst < kLeastQuality * kLeastQuality ? kWorse2 * worst : worst);
  measured_ = true;
}

/// Whether moving the vertex to `to` flips no remaining triangle and makes none a worse sliver than
/// the ring has now. Triangles with the neighbour at index `u` of the ring vanish. With most_turn2
/// = 0 only flips are refused.
bool EdgeCollapser::keeps_shape(std::uint32_t u, Vec3f to, float most_turn2) {
  if (!measured_) measure_triangles();
  const float least_quality2 = most_turn2 > 0 ? least_quality2_ : 0;
  const std::uint32_t vanishes[2] = {u, u == 0 ? near_.size() - 1 : u - 1};
  const kit::Vec3x4 there{to.x + kit::Float4{}, to.y + kit::Float4{}, to.z + kit::Float4{}};
  for (std::uint32_t i = 0; i < near_.lanes(); i += 4) {
    const kit::Vec3x4 a = near_.arms(i) - there, b = near_.arms(i + 1) - there, side = a - b;
    const kit::Vec3x4 before{kit::load4<kit::Float4>(&nx_[i]), kit::load4<kit::Float4>(&ny_[i]),
                             kit::load4<kit::Float4>(&nz_[i])};
    const kit::Vec3x4 after = cross(a, b);
    const kit::Float4 along = dot(before, after), area2 = dot(after, after);
    const kit::Float4 edges = dot(a, a) + dot(b, b) + dot(side, side);
    const kit::Float4 area2_before = kit::load4<kit::Float4>(&area2_[i]);
    const kit::Int4 turns = (along <= 0) | (along * along <= most_turn2 * area2_before * area2);
    const kit::Int4 thin = 12 * area2 < least_quality2 * edges * edges;
    const kit::UInt4 triangle = near_.places(i);
    const kit::Int4 stays =
        (triangle < near_.triangles()) & (triangle != vanishes[0]) & (triangle != vanishes[1]);
    if (kit::any(stays & (turns | thin))) return false;
  }
  return true;
}

bool EdgeCollapser::errs_more(std::uint32_t i, float error_m) const {
  if (error_m == kNever) return false;
  const float area = mesh_.quadrics[near_.id(i)].area + mesh_.quadrics[near_.vertex()].area;
  return error_[i] > error_m * error_m * area;
}

std::uint32_t EdgeCollapser::collapse_along(std::uint32_t i) {
  const std::uint32_t v = near_.vertex(), u = near_.id(i);
  mesh_.places[u].error = error_[i];
  mesh_.quadrics[u] += mesh_.quadrics[v].moved(near_.arm(i));
  mesh_.next[v] = kNever;
  return mesh_.rings.collapse(v, i);
}

std::uint32_t EdgeCollapser::collapse(float limit, float error_m) {
  for (int tried = 0; tried < kTries; ++tried, choose()) {
    const std::uint32_t i = best_;
    if (!(cost_[i] <= limit) || cost_[i] == kNever) return 0;
    if (keeps_shape(i, near_.arm(i), kMostTurn2) && mesh_.rings.may_collapse(near_.vertex(), i) &&
        !errs_more(i, error_m))
      return collapse_along(i);
    cost_[i] = kNever;
  }
  return 0;
}

std::uint32_t EdgeCollapser::collapse_into(std::uint32_t v, std::uint32_t i) {
  rate(v);
  if (cost_[i] == kNever || !mesh_.rings.may_collapse(v, i)) return 0;
  return collapse_along(i);
}

void EdgeCollapser::relax(std::uint32_t v) {
  const Quadric quadric = mesh_.quadrics[v];
  const Vec3f step = quadric.minimizer(kDamping);
  load(v);
  if (!keeps_shape(kNoVertex, step, kMostRelax2)) return;
  VertexPosition& place = mesh_.places[v];
  place.error = std::max(0.0f, place.error + quadric.growth(step));
  place.at = place.at + step;
  mesh_.quadrics[v] = quadric.moved(step);
}

}  // namespace mr::simplify
