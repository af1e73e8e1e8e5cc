#include "mr/atlas/label_problem.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <random>

#include "atlas/walls.h"
#include "mr/atlas/label_history.h"
#include "mr/kit/graph_cut.h"
#include "mr/kit/topology.h"
#include "support/meshes.h"

namespace mr {
namespace {

using atlas::LabelProblem;
constexpr int kViewCount = 4;

/// A wall of 1.2 x 1.2 m whose views cost what `cost(p, view)` says per area.
template <typename Cost>
LabelProblem problem_of(const Mesh& mesh, const Cost& cost) {
  LabelProblem out;
  out.mesh = &mesh, out.views = kViewCount;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    out.area_m2.push_back(0.5f * length(mesh.area_normal(t)));
    for (int v = 0; v < kViewCount; ++v)
      out.cost.push_back(out.area_m2.back() * cost(mesh.centroid(t), v));
  }
  out.may_move.assign(mesh.triangles.size(), 1);
  out.twin = kit::edge_table(mesh).twin;
  return out;
}

std::vector<int> cheapest(const LabelProblem& problem) {
  std::vector<int> out;
  for (std::size_t t = 0; t < problem.area_m2.size(); ++t) {
    const auto first = problem.cost.begin() + static_cast<std::ptrdiff_t>(t * kViewCount);
    const auto best = std::min_element(first, first + kViewCount);
    out.push_back(*best < LabelProblem::kNotAllowed ? static_cast<int>(best - first)
                                                    : LabelProblem::kNone);
  }
  return out;
}

/// The graph cut's labels.
std::vector<int> oracle(const LabelProblem& problem) {
  std::vector<kit::CutEdge> edges;
  std::vector<std::uint32_t> half_edges;
  for (std::uint32_t h = 0; h < problem.twin.size(); ++h)
    if (problem.twin[h] != kit::kNoTwin && h < problem.twin[h])
      edges.push_back({h / 3, problem.twin[h] / 3}), half_edges.push_back(h);
  std::vector<int> label = cheapest(problem);
  const auto pair = [&](std::size_t e, int a, int b) { return problem.seam(half_edges[e], a, b); };
  kit::expand_labels(problem.cost, kViewCount, edges, pair, label);
  return label;
}

/// Areas of the regions of one label.
std::vector<double> regions(const LabelProblem& problem, const std::vector<int>& label) {
  std::vector<double> out;
  std::vector<std::uint8_t> is_done(label.size());
  for (std::uint32_t seed = 0; seed < label.size(); ++seed) {
    if (is_done[seed] || label[seed] == LabelProblem::kNone) continue;
    std::vector<std::uint32_t> queue{seed};
    is_done[seed] = 1;
    double area = 0;
    for (std::size_t i = 0; i < queue.size(); ++i) {
      area += problem.area_m2[queue[i]];
      for (std::uint32_t h = 3 * queue[i]; h < 3 * queue[i] + 3; ++h) {
        if (problem.twin[h] == kit::kNoTwin) continue;
        const std::uint32_t other = problem.twin[h] / 3;
        if (is_done[other] || label[other] != label[seed]) continue;
        is_done[other] = 1, queue.push_back(other);
      }
    }
    out.push_back(area);
  }
  return out;
}

void expect_allowed(const LabelProblem& problem, const std::vector<int>& label) {
  for (std::size_t t = 0; t < label.size(); ++t)
    EXPECT_TRUE(label[t] == LabelProblem::kNone || problem.allows(t, label[t])) << t;
}

/// Smooth quality with noise, like that of cameras beside each other, and shadows in which a view
/// is not allowed.
LabelProblem noisy_problem(const Mesh& mesh, unsigned seed) {
  std::mt19937 random(seed);
  const auto uniform = [&](float low, float high) {
    return low + (high - low) * static_cast<float>(random() % 10007) / 10006.0f;
  };
  std::array<Vec3f, kViewCount> best, shadow;
  for (int v = 0; v < kViewCount; ++v) {
    best[v] = {uniform(-0.6f, 0.6f), uniform(-0.6f, 0.6f), 2};
    shadow[v] = {uniform(-0.6f, 0.6f), uniform(-0.6f, 0.6f), 2};
  }
  return problem_of(mesh, [&](Vec3f p, int v) {
    if (length(p - shadow[v]) < 0.2f) return LabelProblem::kNotAllowed;
    return 0.4f * length(p - best[v]) + uniform(0, 0.15f);
  });
}

TEST(LabelProblem, EnergyIsCloseToThatOfAGraphCut) {
  const Mesh mesh = test::wall(0.6f, 30);
  double ours = 0, cut = 0, start = 0;
  for (unsigned seed = 1; seed <= 12; ++seed) {
    const LabelProblem problem = noisy_problem(mesh, seed);
    std::vector<int> label = cheapest(problem);
    start += energy(problem, label);
    solve_labels(problem, 0, label);
    expect_allowed(problem, label);
    const double best = energy(problem, oracle(problem)), mine = energy(problem, label);
    EXPECT_LT(mine, 1.08 * best) << seed;
    ours += mine, cut += best;
  }
  EXPECT_LT(ours, 1.05 * cut);
  EXPECT_GT(start, 1.5 * cut) << "the start must not be good already";
}

/// Two views that differ in brightness left of x = 0 only.
class HalfBright final : public atlas::ColorSampler {
 public:
  std::optional<Vec3f> at(const View& view, Vec3f p) const override {
    const float level = view.id == ViewId{1} && p.x < 0 ? 200 : 100;
    return Vec3f{level, level, level};
  }
};

TEST(LabelProblem, SpotsGoWherePicturesDiffer) {
  const Mesh mesh = test::wall(0.6f, 60);
  // Spots of 10 cm in which view 1 is better, 20 cm apart.
  const auto in_spot = [](Vec3f p) {
    const auto off = [](float x) {
      return std::abs(x - 0.1f - std::round((x - 0.1f) / 0.2f) * 0.2f);
    };
    return off(p.x) < 0.05f && off(p.y) < 0.05f;
  };
  LabelProblem problem = problem_of(mesh, [&](Vec3f p, int v) {
    return v > 1 ? LabelProblem::kNotAllowed : v == (in_spot(p) ? 1 : 0) ? 0.0f : 0.6f;
  });
  const std::vector<View> views = {
      test::view(ViewId{0}, {}, {0, 0, 2}), test::view(ViewId{1}, {}, {0, 0, 2}), {}, {}};
  const HalfBright sampler;
  atlas::SeamColors colors(mesh, views, &sampler);
  problem.colors = &colors;
  std::vector<int> label = cheapest(problem);
  solve_labels(problem, 0, label);
  std::array<double, 2> spots_m2{};  // left, right
  for (std::size_t t = 0; t < label.size(); ++t)
    if (label[t] == 1) spots_m2[mesh.centroid(t).x > 0] += problem.area_m2[t];
  EXPECT_EQ(spots_m2[0], 0);
  EXPECT_GT(spots_m2[1], 0.1);
  EXPECT_NEAR(colors.difference(0, 0, 1), 100.0f / 255, 0.01);  // its first edge lies on the left
}

TEST(LabelProblem, SmallRegionsTakeANeighboursView) {
  const Mesh mesh = test::wall(0.6f, 60);
  // Spots of 3 cm in which another view is much better.
  const LabelProblem problem = problem_of(mesh, [](Vec3f p, int v) {
    const bool in_spot = std::abs(p.x - std::round(p.x / 0.2f) * 0.2f) < 0.03f &&
                         std::abs(p.y - std::round(p.y / 0.2f) * 0.2f) < 0.03f;
    return v > 1 ? LabelProblem::kNotAllowed : v == (in_spot ? 1 : 0) ? 0.0f : 3.0f;
  });
  std::vector<int> label = cheapest(problem);
  EXPECT_GT(regions(problem, label).size(), 30u);
  solve_labels(problem, 0, label);
  EXPECT_GT(regions(problem, label).size(), 30u) << "as small as energy wants them";
  solve_labels(problem, 0.005, label);
  EXPECT_EQ(regions(problem, label).size(), 1u);
}

TEST(LabelProblem, ASmallRegionThatItsViewAloneSeesStays) {
  const Mesh mesh = test::wall(0.6f, 60);
  const LabelProblem problem = problem_of(mesh, [](Vec3f p, int v) {
    const bool in_spot = std::abs(p.x) < 0.03f && std::abs(p.y) < 0.03f;
    return v == (in_spot ? 1 : 0) ? 0.0f : LabelProblem::kNotAllowed;
  });
  std::vector<int> label = cheapest(problem);
  const std::vector<int> before = label;
  solve_labels(problem, 0.005, label);
  EXPECT_EQ(label, before);
}

TEST(LabelProblem, ASmallRegionBetweenTwoOthersIsDivided) {
  const Mesh mesh = test::wall(0.6f, 60);
  // A spot across x = 0, where view 0 ends and view 1 begins; neither sees all of it.
  const LabelProblem problem = problem_of(mesh, [](Vec3f p, int v) {
    const bool in_spot = std::abs(p.x) < 0.03f && std::abs(p.y) < 0.03f;
    if (v == 2) return in_spot ? 0.0f : LabelProblem::kNotAllowed;
    return v == (p.x < 0 ? 0 : 1) ? 1.0f : LabelProblem::kNotAllowed;
  });
  std::vector<int> label = cheapest(problem);
  ASSERT_GE(regions(problem, label).size(), 3u);
  solve_labels(problem, 0.005, label);
  EXPECT_EQ(regions(problem, label).size(), 2u);
  expect_allowed(problem, label);
}

TEST(LabelProblem, WhatMayNotMoveStays) {
  const Mesh mesh = test::wall(0.6f, 30);
  LabelProblem problem = noisy_problem(mesh, 3);
  std::vector<int> label = cheapest(problem);
  for (std::size_t t = 0; t < label.size(); t += 3) problem.may_move[t] = 0;
  const std::vector<int> before = label;
  solve_labels(problem, 0.005, label);
  for (std::size_t t = 0; t < label.size(); t += 3) EXPECT_EQ(label[t], before[t]);
}

TEST(LabelHistory, TellsTheViewAtAPlaceAndBesideIt) {
  Mesh mesh = test::wall(0.5f, 50);
  std::vector<ViewId> ids;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    ids.push_back(mesh.centroid(t).x < 0 ? ViewId{3} : ViewId{7});
  set_triangle_views(mesh, ids);
  const atlas::LabelHistory history(mesh);
  EXPECT_EQ(history.at({-0.3f, 0.1f, 2}), ViewId{3});
  EXPECT_EQ(history.at({0.3f, 0.1f, 2}), ViewId{7});
  EXPECT_EQ(history.at({0.3f, 0.1f, 1.97f}), ViewId{7});  // moved by 3 cm
  EXPECT_EQ(history.at({0.3f, 0.1f, 1.8f}), kNoView);
  EXPECT_EQ(atlas::LabelHistory().at({0.3f, 0.1f, 2}), kNoView);
}

}  // namespace
}  // namespace mr
