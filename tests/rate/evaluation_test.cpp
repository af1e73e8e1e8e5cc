#include "mr/rate/evaluation.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "mr/rate/hull_targets.h"
#include "rate/made_sweeps.h"

namespace mr::rate {
namespace {

/// Always the same choice; records what it is asked.
class FixedModel final : public Model {
 public:
  explicit FixedModel(Setting setting, std::vector<Observation>* asked = nullptr)
      : setting_(setting), asked_(asked) {}
  Setting choose(const Observation& observed, double) const override {
    if (asked_) asked_->push_back(observed);
    return setting_;
  }

 private:
  Setting setting_;
  std::vector<Observation>* asked_;
};

const std::vector<RatePoint>& hull() {
  static const std::vector<RatePoint> points{{{}, 2, 0.5}, {{}, 4, 0.8}, {{}, 10, 0.9}};
  return points;
}

std::vector<double> three_targets(const std::vector<RatePoint>& of, double) {
  return targets_of(of, 3);
}

TEST(GapToHull, IsWhatQualityStaysBehind) {
  EXPECT_NEAR(gap_to_hull(hull(), 7, {{}, 6, 0.8}), 0.05, 1e-12);
  EXPECT_NEAR(gap_to_hull(hull(), 7, {{}, 7, 0.85}), 0, 1e-12);
  EXPECT_EQ(gap_to_hull(hull(), 7, {{}, 7.2, 0.86}), 0) << "no credit";
}

TEST(GapToHull, AResultOverItsTargetCountsAsTheLowestPoint) {
  EXPECT_NEAR(gap_to_hull(hull(), 7, {{}, 7 * 1.029, 0.84}), 0.01, 1e-12);
  EXPECT_NEAR(gap_to_hull(hull(), 7, {{}, 7 * 1.031, 0.84}), 0.35, 1e-12);
  EXPECT_NEAR(gap_to_hull(hull(), 7, {{}, 100, 0.9}), 0.35, 1e-12);
}

TEST(GapToHull, ATargetThatNothingMeetsIsMetByTheLowestPoint) {
  EXPECT_EQ(gap_to_hull(hull(), 0.1, {{}, 2, 0.5}), 0);
  EXPECT_NEAR(gap_to_hull(hull(), 0.1, {{}, 2, 0.45}), 0.05, 1e-12);
  EXPECT_EQ(gap_to_hull(hull(), 0.1, {{}, 4, 0.8}), 0) << "counts as the lowest point";
}

TEST(GapStatistics, AreMeanPercentileAndGreatest) {
  std::vector<Prediction> predictions;
  for (int i = 1; i <= 100; ++i) {
    Prediction& p = predictions.emplace_back();
    p.target_mbps = p.limit_mbps = 10, p.gap = i * 0.001;
    p.got = {{}, i <= 20 ? 10.4 : 9.0, 0.5}, p.usual = {{}, 8, i <= 50 ? 0.6 : 0.45};
  }
  std::ranges::reverse(predictions);
  const GapStatistics s = statistics(predictions);
  EXPECT_NEAR(s.mean, 0.0505, 1e-12);
  EXPECT_NEAR(s.p95, 0.095, 1e-12);
  EXPECT_NEAR(s.max, 0.1, 1e-12);
  EXPECT_NEAR(s.over, 0.2, 1e-12);
  EXPECT_NEAR(s.rate_error, 0.2 * 0.04 + 0.8 * 0.1, 1e-12);
  EXPECT_NEAR(s.mean_loss, 0.025, 1e-12);
  EXPECT_NEAR(s.most_loss, 0.1, 1e-12);
  EXPECT_EQ(statistics({}).mean, 0);
}

TEST(LeaveOneOut, NeverTrainsOnTheSceneItPredicts) {
  std::vector<Sweep> sweeps;
  for (const MadeScene& scene : made_scenes())
    for (const bool layers : {true, false}) {  // two sweeps of each scene
      sweeps.push_back(made_sweep(scene));
      sweeps.back().layers = layers;
    }
  std::vector<std::set<std::string>> trained_on;
  const auto train = [&](std::span<const Sweep> training) {
    std::set<std::string>& names = trained_on.emplace_back();
    for (const Sweep& sweep : training) names.insert(sweep.scene);
    EXPECT_EQ(training.size(), sweeps.size() - 2);
    return std::make_unique<FixedModel>(kUsualSetting);
  };
  const auto predictions = leave_one_out(sweeps, train, three_targets, {});
  ASSERT_EQ(trained_on.size(), made_scenes().size()) << "once for each scene";
  ASSERT_EQ(predictions.size(), 3 * sweeps.size());
  for (std::size_t i = 0; i < predictions.size(); ++i) {
    EXPECT_EQ(predictions[i].scene, sweeps[i / 3].scene);
    EXPECT_EQ(predictions[i].layers, sweeps[i / 3].layers);
    EXPECT_FALSE(trained_on[i / 6].contains(predictions[i].scene));
    EXPECT_EQ(trained_on[i / 6].size(), made_scenes().size() - 1);
  }
}

TEST(LeaveOneOut, TakesWhatASettingCostsFromTheLeftOutSweep) {
  const auto sweeps = made_sweeps(made_scenes());
  const Setting setting{2, 10, 0.7, 38};
  const auto train = [&](auto) { return std::make_unique<FixedModel>(setting); };
  const auto predictions = leave_one_out(sweeps, train, three_targets, {});
  for (std::size_t i = 0; i < predictions.size(); ++i) {
    const RateSurface truth(grid_values(sweeps[i / 3]));
    const auto best = convex_hull(candidate_points(truth));
    EXPECT_EQ(predictions[i].got.setting, setting);
    EXPECT_EQ(predictions[i].got.mbps, truth.at(setting).mbps);
    EXPECT_EQ(predictions[i].usual.ssim, truth.at(kUsualSetting).ssim);
    EXPECT_EQ(predictions[i].target_mbps, targets_of(best, 3)[i % 3]);
    EXPECT_EQ(predictions[i].gap,
              gap_to_hull(best, predictions[i].target_mbps, predictions[i].got));
    EXPECT_GE(predictions[i].decision_ms, 0);
  }
}

/// What a model was asked for the only target of the first of two scenes.
std::vector<Observation> asked(const Corrections& corrections, const Setting& answer) {
  std::vector<Observation> out;
  const auto train = [&](auto) { return std::make_unique<FixedModel>(answer, &out); };
  const auto one_target = [](const auto& of, double) { return std::vector{of.front().mbps}; };
  leave_one_out(made_sweeps({{.name = "a"}, {.name = "b"}}), train, one_target, corrections);
  out.resize(out.size() / 2);
  return out;
}

TEST(LeaveOneOut, ShowsAModelWhatItsChoicesProduced) {
  const Setting answer{2, 10, 0.7, 38};
  const auto all = asked({.choices = 5}, answer);
  ASSERT_EQ(all.size(), 2u) << "until the choice stays";
  const Sweep sweep = made_sweep({.name = "a"});
  const RateSurface truth(grid_values(sweep));
  EXPECT_EQ(all[0].features, sweep.features);
  ASSERT_EQ(all[0].produced.size(), 1u);
  EXPECT_EQ(all[0].produced[0].setting, kUsualSetting);
  EXPECT_EQ(all[0].produced[0].mbps(), made_produced(truth, kUsualSetting).mbps());
  ASSERT_EQ(all[1].produced.size(), 2u);
  EXPECT_EQ(all[1].produced[1].setting, answer);
  EXPECT_EQ(all[1].produced[1].texture_mbps, truth.texture_mbps(0.7, 38));
  EXPECT_EQ(asked({.choices = 1}, answer).size(), 1u);
}

TEST(LeaveOneOut, TellsTargetsWhatTheUsualSettingCosts) {
  const auto train = [](auto) { return std::make_unique<FixedModel>(kUsualSetting); };
  const auto sweeps = made_sweeps(made_scenes());
  const auto usual = [](const auto&, double usual_mbps) { return std::vector{usual_mbps}; };
  for (const Prediction& p : leave_one_out(sweeps, train, usual, {}))
    EXPECT_EQ(p.target_mbps, p.got.mbps);
}

TEST(LeaveOneOut, ShowsNothingThatWasProducedWhereFeaturesAloneCount) {
  for (const Observation& observed : asked({.choices = 3, .sees_produced = false}, kUsualSetting))
    EXPECT_TRUE(observed.produced.empty());
}

}  // namespace
}  // namespace mr::rate
