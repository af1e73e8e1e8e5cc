#include "mr/atlas/label_regions.h"

#include <algorithm>
#include <numeric>
#include <utility>

#include "mr/kit/topology.h"

namespace mr::atlas {
namespace {

constexpr int kNone = LabelProblem::kNone;
constexpr std::uint32_t kNoRegion = 0xFFFFFFFFu;

constexpr double kLargestMoved_m2 = 0.3;  // larger regions are as they are for a good reason

}  // namespace

LabelRegions::LabelRegions(const LabelProblem& problem, std::vector<int>& label)
    : problem_(problem), label_(label), added_(problem.views), is_beside_(problem.views) {
  find_regions();
}

/// Numbers the regions by their lowest triangles.
void LabelRegions::find_regions() {
  std::vector<std::uint32_t> root(label_.size());
  std::iota(root.begin(), root.end(), 0u);
  const auto find = [&](std::uint32_t t) {
    while (root[t] != t) t = root[t] = root[root[t]];
    return t;
  };
  for (std::uint32_t h = 0; h < problem_.twin.size(); ++h) {
    const std::uint32_t other = problem_.twin[h];
    if (other == kit::kNoTwin || other < h || label_[h / 3] != label_[other / 3]) continue;
    const std::uint32_t a = find(h / 3), b = find(other / 3);
    root[std::max(a, b)] = std::min(a, b);
  }
  of_triangle_.assign(label_.size(), kNoRegion);
  for (std::uint32_t t = 0; t < label_.size(); ++t) {
    if (label_[t] == kNone) continue;
    const std::uint32_t first = find(t);
    if (first == t)
      of_triangle_[t] = static_cast<std::uint32_t>(regions_.size()), regions_.emplace_back();
    Region& region = regions_[of_triangle_[t] = of_triangle_[first]];
    region.area_m2 += problem_.area_m2[t], ++region.count;
    region.may_move &= problem_.may_move[t] != 0;
  }
  const auto is_listed = [](const Region& r) { return r.may_move && r.area_m2 < kLargestMoved_m2; };
  for (Region& region : regions_)
    if (is_listed(region)) region.triangles.reserve(region.count);
  for (std::uint32_t t = 0; t < label_.size(); ++t)
    if (label_[t] != kNone && is_listed(regions_[of_triangle_[t]]))
      regions_[of_triangle_[t]].triangles.push_back(t);
  joined_to_.resize(regions_.size());
  std::iota(joined_to_.begin(), joined_to_.end(), 0u);
}

bool LabelRegions::improve() { return move_regions(kLargestMoved_m2, false); }

bool LabelRegions::remove_below(double area_m2) { return move_regions(area_m2, true); }

/// `always`: also where that adds energy.
bool LabelRegions::move_regions(double largest_m2, bool always) {
  const auto is_small = [&](const Region& r) { return r.may_move && r.area_m2 < largest_m2; };
  for (std::uint32_t r = 0; r < regions_.size(); ++r)
    if (is_small(regions_[r])) queue_.emplace(regions_[r].area_m2, r);
  bool any = false;
  while (!queue_.empty()) {
    const auto [area, r] = queue_.top();
    queue_.pop();
    const Region& region = regions_[r];
    if (region.triangles.empty() || region.area_m2 != area) continue;
    const std::optional<Move> best = best_move(region);
    if (best && (always || best->energy < 0)) {
      const std::uint32_t into = move(r, best->label);
      if (is_small(regions_[into])) queue_.emplace(regions_[into].area_m2, into);
      any = true;
    } else if (!best && always) {
      any |= dissolve(r);
    }
  }
  return any;
}

/// The label of a neighbour that all triangles of the region allow and that adds least energy;
/// nothing: there is none.
std::optional<LabelRegions::Move> LabelRegions::best_move(const Region& region) {
  add_border(region);
  std::optional<Move> best;
  const int own = label_[region.triangles.front()];
  for (std::size_t v = 0; v < problem_.views; ++v) {
    const int to = static_cast<int>(v);
    if (!is_beside_[v]) continue;
    for (const std::uint32_t t : region.triangles) {
      added_[v] += problem_.cost_of(t, to) - problem_.cost_of(t, own);
      if (!problem_.allows(t, to)) break;
    }
    if (!(added_[v] < LabelProblem::kNotAllowed)) continue;
    if (!best || added_[v] < best->energy) best = Move{to, added_[v]};
  }
  return best;
}

/// Sets the labels beside a region, and the energy that its border adds with each of them.
void LabelRegions::add_border(const Region& region) {
  std::ranges::fill(added_, 0.0), std::ranges::fill(is_beside_, std::uint8_t{0});
  const int own = label_[region.triangles.front()];
  const auto for_each_border = [&](const auto& work) {
    for (const std::uint32_t t : region.triangles)
      for (std::uint32_t h = 3 * t; h < 3 * t + 3; ++h) {
        if (problem_.twin[h] == kit::kNoTwin) continue;
        const int other = label_[problem_.twin[h] / 3];
        if (other != own && other != kNone) work(h, other);
      }
  };
  for_each_border(
      [&](std::uint32_t, int other) { is_beside_[static_cast<std::size_t>(other)] = 1; });
  for_each_border([&](std::uint32_t h, int other) {
    const float before = problem_.seam(h, own, other);
    for (std::size_t v = 0; v < problem_.views; ++v)
      if (is_beside_[v]) added_[v] += problem_.seam(h, static_cast<int>(v), other) - before;
  });
}

/// Gives a region another label and joins it with the neighbours that have it. Returns the number
/// of the region that it then belongs to.
std::uint32_t LabelRegions::move(std::uint32_t r, int label) {
  std::vector<std::uint32_t> beside{r};
  for (const std::uint32_t t : regions_[r].triangles) {
    label_[t] = label;
    for (std::uint32_t h = 3 * t; h < 3 * t + 3; ++h)
      if (problem_.twin[h] != kit::kNoTwin && label_[problem_.twin[h] / 3] == label)
        beside.push_back(region_of(problem_.twin[h] / 3));
  }
  std::ranges::sort(beside);
  beside.erase(std::unique(beside.begin(), beside.end()), beside.end());
  const std::uint32_t into =
      *std::ranges::max_element(beside, {}, [&](std::uint32_t b) { return regions_[b].count; });
  for (const std::uint32_t b : beside) {
    if (b == into) continue;
    Region &to = regions_[into], from = std::exchange(regions_[b], {});
    to.triangles.insert(to.triangles.end(), from.triangles.begin(), from.triangles.end());
    to.area_m2 += from.area_m2, to.may_move &= from.may_move, to.count += from.count;
    joined_to_[b] = into;
  }
  return into;
}

std::uint32_t LabelRegions::region_of(std::uint32_t t) {
  std::uint32_t r = of_triangle_[t];
  while (joined_to_[r] != r) r = joined_to_[r] = joined_to_[joined_to_[r]];
  return of_triangle_[t] = r;
}

/// Of the triangle's neighbours of another label, the one whose label costs least; kNoTwin: the
/// triangle allows none of them.
std::uint32_t LabelRegions::best_neighbour(std::uint32_t t) const {
  std::uint32_t best = kit::kNoTwin;
  float least = LabelProblem::kNotAllowed;
  for (std::uint32_t h = 3 * t; h < 3 * t + 3; ++h) {
    const std::uint32_t other = problem_.twin[h];
    if (other == kit::kNoTwin) continue;
    const int to = label_[other / 3];
    if (to == kNone || to == label_[t]) continue;
    float cost = problem_.cost_of(t, to);
    for (std::uint32_t g = 3 * t; g < 3 * t + 3; ++g)
      if (problem_.twin[g] != kit::kNoTwin)
        cost += problem_.seam(g, to, label_[problem_.twin[g] / 3]);
    if (cost < least) best = other / 3, least = cost;
  }
  return best;
}

/// Gives a region's triangles, from its border inwards, to neighbours whose labels they allow;
/// undone where that leaves some of them.
bool LabelRegions::dissolve(std::uint32_t r) {
  std::vector<std::uint32_t> left = regions_[r].triangles;
  const int own = label_[left.front()];
  std::vector<std::pair<std::uint32_t, std::uint32_t>> given;  // triangle, neighbour that takes it
  for (std::size_t before = left.size() + 1; !left.empty() && left.size() < before;) {
    before = left.size();
    std::erase_if(left, [&](std::uint32_t t) {
      const std::uint32_t to = best_neighbour(t);
      if (to == kit::kNoTwin) return false;
      label_[t] = label_[to], given.emplace_back(t, to);
      return true;
    });
  }
  if (!left.empty()) {
    for (const auto& [t, to] : given) label_[t] = own;
    return false;
  }
  for (const auto& [t, to] : given) {
    Region& region = regions_[of_triangle_[t] = region_of(to)];
    region.triangles.push_back(t), region.area_m2 += problem_.area_m2[t], ++region.count;
  }
  regions_[r] = {};
  return true;
}

}  // namespace mr::atlas
