#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>

#include "mr/rate/classifier.h"
#include "mr/rate/curve_predictor.h"
#include "mr/rate/hull_targets.h"
#include "mr/rate/lookup_table.h"
#include "mr/rate/nominal_rates.h"
#include "rate/made_sweeps.h"

namespace mr::rate {
namespace {

/// With what a choice for a training scene may be off: over the target, and behind the hull.
struct NamedModel {
  const char* name;
  std::shared_ptr<const Model> model;
  double over, behind;
};

std::vector<NamedModel> models_of(const std::vector<Sweep>& training) {
  return {{"classifier", std::make_shared<Classifier>(Classifier::train(training)), 0.15, 0.06},
          {"lookup", std::make_shared<LookupTable>(LookupTable::train(training)), 1e-9, 0.01},
          {"ours", std::make_shared<CurvePredictor>(CurvePredictor::train(training)), 0.15, 0.02}};
}

const std::vector<NamedModel>& models() {
  static const auto all = models_of(made_training());
  return all;
}

/// Of a scene after it was coded in the usual setting.
Observation seen(const Sweep& sweep) {
  return {sweep.layers,
          sweep.features,
          {made_produced(RateSurface(grid_values(sweep)), kUsualSetting)},
          kBits};
}

bool is_candidate(Setting setting) {
  setting.bits = kBits;  // or any other
  return std::ranges::find(candidates(), setting) != candidates().end();
}

TEST(Models, GiveSettingsThatFitScenesTheyKnow) {
  for (const auto& [name, model, over, behind] : models())
    for (const Sweep& sweep : made_training()) {
      const RateSurface truth(grid_values(sweep));
      const auto hull = convex_hull(candidate_points(truth, kBits));
      for (const double target : targets_of(hull, 6)) {
        const RatePoint got = truth.at(model->choose(seen(sweep), target));
        EXPECT_TRUE(is_candidate(got.setting));
        EXPECT_EQ(got.setting.bits, kBits) << name << ": the lattice in force";
        EXPECT_LE(got.mbps, (1 + over) * target) << name << ' ' << sweep.scene;
        EXPECT_GE(got.ssim, hull_ssim(hull, target) - behind) << name << ' ' << sweep.scene;
      }
    }
}

TEST(Models, ALowerTargetIsNotGivenAHigherRate) {
  for (const auto& [name, model, over, behind] : models()) {
    if (std::string(name) == "classifier") continue;  // its machines do not know one another
    for (const Sweep& sweep : made_training()) {
      const RateSurface truth(grid_values(sweep));
      double before = 0;
      for (const double target : log_spaced(0.2, 60, 40)) {
        const double mbps = truth.at(model->choose(seen(sweep), target)).mbps;
        EXPECT_GE(mbps, before - 1e-9) << name << ' ' << sweep.scene << ' ' << target;
        before = mbps;
      }
    }
  }
}

TEST(Models, AnyTargetGivesACandidate) {
  const Sweep sweep = made_sweep();
  for (const auto& [name, model, over, behind] : models())
    for (const double target : {0.0, -5.0, 1e-300, 1e9, kNan, kInfinite, -kInfinite})
      for (const bool knows : {false, true}) {
        const Observation observed = knows ? seen(sweep) : Observation{};
        EXPECT_TRUE(is_candidate(model->choose(observed, target))) << name << ' ' << target;
      }
}

TEST(Models, AnyObservationGivesACandidate) {
  for (const auto& [name, model, over, behind] : models())
    for (const double value : {0.0, -1.0, 1e-300, 1e300, kNan, kInfinite})
      for (const bool layers : {true, false}) {
        Observation observed{layers, {}, {}};
        for (const char* feature : feature_names()) observed.features.push_back({feature, value});
        EXPECT_TRUE(is_candidate(model->choose(observed, 5))) << name << ' ' << value;
        observed.produced.assign(9, {kUsualSetting, value, value});
        EXPECT_TRUE(is_candidate(model->choose(observed, 5))) << name << ' ' << value;
      }
}

TEST(Models, OfOneKindServeTheOther) {
  for (const bool layers : {true, false}) {
    const auto of_one = models_of(made_sweeps(made_scenes(layers)));
    const Sweep other = made_sweep({.layers = !layers});
    for (const auto& [name, model, over, behind] : of_one)
      EXPECT_TRUE(is_candidate(model->choose(seen(other), 4))) << name;
  }
}

TEST(Models, ChooseAmongTheKindsByLayers) {
  const Sweep sweep = made_sweep();
  for (const auto& [name, model, over, behind] : models()) {
    Observation observed{true, sweep.features, {}};
    const Setting layers = model->choose(observed, 3);
    observed.layers = false;  // the same features; costs several times as much
    EXPECT_NE(layers, model->choose(observed, 3)) << name;
  }
}

TEST(LookupTable, TakesTheEntryBelowTheTarget) {
  const Setting coarse{6, 10, 0.5, 50}, middle{1, 10, 0.7, 38}, fine{0.5, 10, 1, 18};
  const std::vector<double> zero(FeatureSpace::size(), 0), one(FeatureSpace::size(), 1);
  const FeatureSpace space(zero, one);
  const LookupTable table(
      space, {{true, zero, {{1, coarse}, {2, middle}, {8, fine}}}, {true, one, {{1, fine}}}});
  for (const auto& [target, setting] :
       {std::pair{0.5, coarse}, {1.5, coarse}, {2.0, middle}, {7.9, middle}, {8.0, fine}})
    EXPECT_EQ(table.choose({true, {{"sensors", 0}}, {}}, target), setting) << target;
  std::vector<Feature> near_one;
  for (const char* name : feature_names()) near_one.push_back({name, std::exp(0.8) - 1});
  EXPECT_EQ(table.choose({true, near_one, {}}, 0.5), fine);
}

TEST(FeatureSpace, HasMeanZeroAndDeviationOneOverItsScenes) {
  const auto training = made_sweeps(made_scenes());
  const FeatureSpace space(training);
  for (std::size_t i = 0; i < FeatureSpace::size(); ++i) {
    double sum = 0, squares = 0;
    for (const Sweep& sweep : training) {
      const double v = space.at(sweep.features)[i];
      sum += v, squares += v * v;
    }
    const double n = static_cast<double>(training.size());
    EXPECT_NEAR(sum / n, 0, 1e-9) << i;
    if (std::string(feature_names()[i]) != "sensors") {
      EXPECT_NEAR(squares / n, 1, 1e-6) << i;
    }
  }
  EXPECT_EQ(space.at({}), std::vector<double>(FeatureSpace::size(), 0));
  EXPECT_EQ(space.at({{"sensors", kNan}, {"another", 3}}),
            std::vector<double>(FeatureSpace::size(), 0));
}

TEST(NominalRates, TellWhatTheUsualSettingWouldHaveCost) {
  const MadeScene scene;
  const std::vector<Sweep> one{made_sweep(scene)};
  const NominalRates nominal = NominalRates::train(one);
  const RateSurface truth(grid_values(one[0]));
  const auto usual = made_produced(truth, kUsualSetting);
  for (const Setting& setting : candidates()) {
    const auto log_mbps = nominal.usual_log_mbps(made_produced(truth, setting));
    ASSERT_EQ(log_mbps.size(), 2u);
    EXPECT_NEAR(log_mbps[0], std::log(usual.geometry_mbps), 1e-9);
    EXPECT_NEAR(log_mbps[1], std::log(usual.texture_mbps), 1e-9);
  }
}

}  // namespace
}  // namespace mr::rate
