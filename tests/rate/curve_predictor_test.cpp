#include "mr/rate/curve_predictor.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "mr/rate/hull_targets.h"
#include "rate/made_sweeps.h"

namespace mr::rate {
namespace {

const CurvePredictor& predictor() {
  static const CurvePredictor model = CurvePredictor::train(made_training());
  return model;
}

/// Scenes unlike those of the training.
std::vector<MadeScene> other_scenes() {
  return {{"quiet", true, 0.6, 1.5, 0.1, 0.25, 6},
          {"full", true, 2.8, 0.9, 0.09, 0.35, 8},
          {"full without_layers", false, 1.8, 1.4, 0.1, 0.3, 5}};
}

/// Mean over all settings of how far the predicted rates are off: |log(predicted / true)|.
double rate_error(const RateSurface& predicted, const RateSurface& truth) {
  double sum = 0;
  for (const Setting& s : candidates())
    sum += std::abs(std::log(predicted.geometry_mbps(s.error_voxels) /
                             truth.geometry_mbps(s.error_voxels))) +
           std::abs(
               std::log(predicted.texture_mbps(s.scale, s.qp) / truth.texture_mbps(s.scale, s.qp)));
  return sum / static_cast<double>(candidates().size());
}

const std::vector<Setting>& read_settings() {
  static const std::vector<Setting> all{{0.5, 10, 1, 28}, {4, 10, 0.7, 40}, {2, 10, 0.5, 38},
                                        {6, 10, 0.5, 50}, {0.7, 10, 1, 19}, {1.4, 10, 1, 37},
                                        {2.8, 10, 1, 45}, {1, 10, 0.7, 31}, {6, 10, 0.5, 34}};
  return all;
}

TEST(CurvePredictor, AgreesWithTheNewestReading) {
  for (const MadeScene& scene : other_scenes()) {
    const Sweep sweep = made_sweep(scene);
    const RateSurface truth(grid_values(sweep));
    Observation observed{sweep.layers, sweep.features, {}};
    for (const Setting& setting : read_settings()) {
      observed.produced.push_back(made_produced(truth, setting));
      const auto& produced = observed.produced.back();
      const RateSurface predicted = predictor().predict(observed);
      EXPECT_NEAR(predicted.geometry_mbps(setting.error_voxels) / produced.geometry_mbps, 1, 1e-9);
      EXPECT_NEAR(predicted.texture_mbps(setting.scale, setting.qp) / produced.texture_mbps, 1,
                  1e-9);
    }
  }
}

TEST(CurvePredictor, AgreesWithTheNewestOfReadingsThatDisagree) {
  const Sweep sweep = made_sweep();
  const Setting setting{1.4, 10, 0.7, 35};
  Observation observed{true, sweep.features, {{setting, 1, 1}, {setting, 50, 7}, {setting, 3, 9}}};
  const RateSurface predicted = predictor().predict(observed);
  EXPECT_NEAR(predicted.geometry_mbps(1.4), 3, 1e-9);
  EXPECT_NEAR(predicted.texture_mbps(0.7, 35), 9, 1e-9);
}

TEST(CurvePredictor, PredictsBetterTheMoreWasProduced) {
  for (const MadeScene& scene : other_scenes()) {
    const Sweep sweep = made_sweep(scene);
    const RateSurface truth(grid_values(sweep));
    Observation observed{sweep.layers, sweep.features, {}};
    std::vector<double> errors{rate_error(predictor().predict(observed), truth)};
    for (const Setting& setting : read_settings()) {
      observed.produced.push_back(made_produced(truth, setting));
      errors.push_back(rate_error(predictor().predict(observed), truth));
    }
    EXPECT_LT(errors[1], errors[0]) << scene.name;
    EXPECT_LT(errors[3], errors[1]) << scene.name;
    EXPECT_LT(errors[6], 0.5 * errors[1]) << scene.name;
    EXPECT_LT(errors.back(), 0.05) << scene.name;
  }
}

TEST(CurvePredictor, ConvergesToTheBestSettingThatFits) {
  for (const MadeScene& scene : other_scenes()) {
    const Sweep sweep = made_sweep(scene);
    const RateSurface truth(grid_values(sweep));
    const auto hull = convex_hull(candidate_points(truth));
    for (const double target : targets_of(hull, 6)) {
      Observation observed{sweep.layers, sweep.features, {made_produced(truth, kUsualSetting)}};
      Setting setting;
      for (int i = 0; i < 6; ++i) {
        setting = predictor().choose(observed, 1.0001 * target);
        observed.produced.push_back(made_produced(truth, setting));
      }
      const RatePoint got = truth.at(setting);
      EXPECT_LT(got.mbps, 1.03 * target) << scene.name;
      EXPECT_GT(got.ssim, hull_ssim(hull, target) - 0.01) << scene.name << ' ' << target;
    }
  }
}

TEST(CurvePredictor, ForgetsAllButTheNewestReadings) {
  const Sweep sweep = made_sweep();
  const RateSurface truth(grid_values(sweep));
  Observation observed{true, sweep.features, {}}, later = observed;
  for (const Setting& setting : read_settings())
    observed.produced.push_back(made_produced(truth, setting));
  later.produced.assign(100, {kUsualSetting, 900, 900});
  later.produced.insert(later.produced.end(), observed.produced.begin(), observed.produced.end());
  const RateSurface a = predictor().predict(observed), b = predictor().predict(later);
  for (const Setting& s : candidates()) EXPECT_EQ(a.at(s).mbps, b.at(s).mbps);
}

TEST(CurvePredictor, RatesAndQualityFallWithTheQuantiser) {
  for (const Sweep& sweep : made_training()) {
    const RateSurface truth(grid_values(sweep));
    const RateSurface predicted =
        predictor().predict({sweep.layers, sweep.features, {made_produced(truth, kUsualSetting)}});
    for (const double scale : {1.0, 0.7, 0.5})
      for (const double error : kErrorNodes_voxels)
        for (int qp = 19; qp <= 50; ++qp) {
          const RatePoint fine = predicted.at({error, kBits, scale, qp - 1}),
                          coarse = predicted.at({error, kBits, scale, qp});
          EXPECT_LT(coarse.mbps, fine.mbps);
          EXPECT_LE(coarse.ssim, fine.ssim + 1e-12);
        }
  }
}

TEST(CurvePredictor, KnowsItsOnlySceneAlmostByHeart) {
  const Sweep sweep = made_sweep();
  const CurvePredictor one = CurvePredictor::train(std::vector<Sweep>{sweep});
  const RateSurface truth(grid_values(sweep)), predicted = one.predict({true, sweep.features, {}});
  for (const Setting& s : candidates()) {
    EXPECT_NEAR(predicted.at(s).mbps / truth.at(s).mbps, 1, 1e-9);
    EXPECT_NEAR(predicted.at(s).ssim, truth.at(s).ssim, 1e-9);
  }
}

TEST(CurvePredictor, WhatMovesIsWorthMoreWhereItWeighsMore) {
  const Sweep sweep = made_sweep();
  const RateSurface truth(grid_values(sweep));
  Observation observed{true, sweep.features, {made_produced(truth, kUsualSetting)}};
  for (const double mbps : {0.75, 0.9, 1.05}) {
    observed.moving_weight = 0;
    const Setting whole = predictor().choose(observed, mbps);
    observed.moving_weight = 0.8;
    const Setting moving = predictor().choose(observed, mbps);
    EXPECT_LT(moving.error_voxels, whole.error_voxels) << mbps;
    EXPECT_LE(truth.at(moving).mbps, 1.05 * mbps);
  }
}

TEST(CurvePredictor, KeepsTheLatticeInForce) {
  const Sweep sweep = made_sweep();
  for (const int bits : kLattices)
    for (const double mbps : {0.5, 2.0, 8.0}) {
      Observation observed{true, sweep.features, {}};
      observed.bits = bits;
      EXPECT_EQ(predictor().choose(observed, mbps).bits, bits);
    }
}

TEST(CurvePredictor, ChoosesTheLatticeWithTheTarget) {
  const Sweep sweep = made_sweep();
  const Observation observed{true, sweep.features, {}};
  EXPECT_EQ(predictor().choose(observed, 0.6).bits, 9) << "cheaper, for some quality";
  EXPECT_EQ(predictor().choose(observed, 500).bits, 11) << "the best there is";
}

TEST(CurvePredictor, ReadsRatesOnAnyLattice) {
  const Sweep sweep = made_sweep();
  const RateSurface truth(grid_values(sweep));
  Observation observed{true, sweep.features, {}};
  const Setting coarse{1, 9, 1, 28};
  observed.produced = {{coarse, truth.geometry_mbps(1, 9), truth.texture_mbps(1, 28)}};
  const RateSurface predicted = predictor().predict(observed);
  EXPECT_NEAR(predicted.at(coarse).mbps, truth.at(coarse).mbps, 1e-9);
  EXPECT_NEAR(predicted.at({1, 10, 1, 28}).mbps / truth.at({1, 10, 1, 28}).mbps, 1, 0.03);
}

}  // namespace
}  // namespace mr::rate
