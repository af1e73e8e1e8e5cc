#include "mr/atlas/label_problem.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>

#include "mr/atlas/label_regions.h"
#include "mr/kit/topology.h"

namespace mr::atlas {

SeamColors::SeamColors(const Mesh& mesh, std::span<const View> views, const ColorSampler* sampler)
    : mesh_(mesh), views_(views), sampler_(sampler) {
  if (sampler) known_.assign(3 * mesh.triangles.size() * views.size(), kUnknown);
}

std::uint32_t SeamColors::color(std::uint32_t half_edge, int view) {
  std::uint32_t& known = known_[half_edge * views_.size() + static_cast<std::size_t>(view)];
  if (known != kUnknown) return known;
  constexpr Vec3f kMidGrey{128, 128, 128};
  const Vec3f middle = (mesh_.positions[kit::edge_from(mesh_, half_edge)] +
                        mesh_.positions[kit::edge_to(mesh_, half_edge)]) *
                       0.5f;
  const Vec3f c = sampler_->at(views_[static_cast<std::size_t>(view)], middle).value_or(kMidGrey);
  const auto byte = [](float v) { return static_cast<std::uint32_t>(std::lround(v)) & 255u; };
  return known = 1u << 24 | byte(c.x) << 16 | byte(c.y) << 8 | byte(c.z);
}

float SeamColors::difference(std::uint32_t half_edge, int view_a, int view_b) {
  if (!sampler_) return 0;
  const std::uint32_t a = color(half_edge, view_a), b = color(half_edge, view_b);
  int sum = 0;
  for (const int shift : {0, 8, 16})
    sum += std::abs(static_cast<int>(a >> shift & 255u) - static_cast<int>(b >> shift & 255u));
  return static_cast<float>(sum) / (3 * 255);
}

float LabelProblem::seam(std::uint32_t half_edge, int a, int b) const {
  if (a == b || a == kNone || b == kNone) return 0;
  // Both half-edges of an edge must cost the same: the lower one stands for both.
  const std::uint32_t h = std::min(half_edge, twin[half_edge]);
  const float difference = colors ? colors->difference(h, a, b) : 0;
  const float length_m =
      length(mesh->positions[kit::edge_to(*mesh, h)] - mesh->positions[kit::edge_from(*mesh, h)]);
  return kSeam_m * length_m * (1 + kPerDifference * difference);
}

double energy(const LabelProblem& problem, std::span<const int> label) {
  double sum = 0;
  for (std::uint32_t t = 0; t < label.size(); ++t) {
    if (label[t] == LabelProblem::kNone) continue;
    sum += problem.cost_of(t, label[t]);
    for (std::uint32_t h = 3 * t; h < 3 * t + 3; ++h)
      if (problem.twin[h] != kit::kNoTwin && h < problem.twin[h])
        sum += problem.seam(h, label[t], label[problem.twin[h] / 3]);
  }
  return sum;
}

namespace {

/// Iterated conditional modes: each triangle takes the label that costs least beside its
/// neighbours' ones, in index order; only triangles with changed neighbours are visited again.
class TriangleMoves {
 public:
  TriangleMoves(const LabelProblem& problem, std::vector<int>& label)
      : problem_(problem), label_(label), is_stale_(label.size(), 1) {}

  void run() {
    constexpr int kSweeps = 12;
    bool moved = true;
    for (int sweep = 0; sweep < kSweeps && moved; ++sweep) {
      moved = false;
      for (std::uint32_t t = 0; t < label_.size(); ++t)
        if (is_stale_[t]) is_stale_[t] = 0, moved |= move(t);
    }
  }

 private:
  /// Most triangles lie inside a region and have their best label.
  bool move(std::uint32_t t) {
    const int own = label_[t];
    if (own == LabelProblem::kNone || !problem_.may_move[t]) return false;
    std::array<std::uint32_t, 3> edge{};
    std::array<int, 3> beside{};
    int count = 0;
    bool any_other = false;
    for (std::uint32_t h = 3 * t; h < 3 * t + 3; ++h) {
      if (problem_.twin[h] == kit::kNoTwin) continue;
      const int other = label_[problem_.twin[h] / 3];
      if (other == LabelProblem::kNone) continue;
      edge[count] = h, beside[count++] = other;
      any_other |= other != own;
    }
    if (!any_other) return false;
    const auto cost = [&](int l) {
      float sum = problem_.cost_of(t, l);
      for (int i = 0; i < count; ++i) sum += problem_.seam(edge[i], l, beside[i]);
      return sum;
    };
    int best = own;
    float least = cost(own);
    for (int i = 0; i < count; ++i) {
      if (beside[i] == best || !problem_.allows(t, beside[i])) continue;
      if (const float c = cost(beside[i]); c < least) best = beside[i], least = c;
    }
    if (best == own) return false;
    label_[t] = best;
    for (int i = 0; i < count; ++i) is_stale_[problem_.twin[edge[i]] / 3] = 1;
    return true;
  }

  const LabelProblem& problem_;
  std::vector<int>& label_;
  std::vector<std::uint8_t> is_stale_;
};

}  // namespace

void solve_labels(const LabelProblem& problem, double least_region_m2, std::vector<int>& label) {
  TriangleMoves(problem, label).run();
  if (LabelRegions(problem, label).improve()) TriangleMoves(problem, label).run();
  LabelRegions regions(problem, label);
  regions.improve();
  regions.remove_below(least_region_m2);
}

}  // namespace mr::atlas
