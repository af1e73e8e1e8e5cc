#include "mr/rate/classifier.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <optional>
#include <utility>

#include "mr/core/assert.h"
#include "mr/rate/hull_targets.h"
#include "mr/rate/swept_surface.h"

namespace mr::rate {
namespace {

constexpr int kTargets = 24;     // of a training scene
constexpr double kMargin = 0.9;  // of a target: settings are trained to need less
constexpr double kScales[] = {1, 0.7, 0.5};
constexpr int kQpStep = 3;  // between classes

int error_class(double error_voxels) {
  return static_cast<int>(std::lround(2 * std::log2(error_voxels / kErrorNodes_voxels[0])));
}
double error_of(int error_class) { return kErrorNodes_voxels[0] * std::exp2(0.5 * error_class); }
int scale_class(double scale) {
  return static_cast<int>(std::ranges::find(kScales, scale) - std::begin(kScales));
}
int qp_class(int qp) { return (qp + kQpStep / 2) / kQpStep; }

/// The features with the target, as numbers of about the same size.
std::vector<double> input(std::vector<double> features, const NominalRates& nominal,
                          const std::optional<Observation::Produced>& produced,
                          double target_mbps) {
  std::vector<double> usual(2, 0);
  if (produced) usual = nominal.usual_log_mbps(*produced);
  features.insert(features.end(), usual.begin(), usual.end());
  features.push_back(std::log(std::max(target_mbps, 1e-3)));
  return features;
}
/// The same on a lattice, which is chosen first.
std::vector<double> on_lattice(std::vector<double> input, int bits) {
  input.push_back(bits - kBits);
  return input;
}

/// What a sweep's scene costs in the usual setting.
Observation::Produced usual(const RateSurface& surface) {
  return {kUsualSetting, surface.geometry_mbps(kUsualSetting.error_voxels),
          surface.texture_mbps(kUsualSetting.scale, kUsualSetting.qp)};
}

/// What a machine is trained on.
struct Samples {
  std::vector<std::vector<double>> features;
  std::vector<int> classes;

  void add(std::vector<double> of_sample, int of_class) {
    features.push_back(std::move(of_sample)), classes.push_back(of_class);
  }
  Svm train() const { return Svm::train(features, classes); }
};

/// How far settings lie apart: 1 is as much as one class.
double distance(const Setting& a, const Setting& b) {
  const double error = 2 * std::log2(a.error_voxels / b.error_voxels),
               scale = 4 * std::log2(a.scale / b.scale),
               qp = (a.qp - b.qp) / static_cast<double>(kQpStep);
  return error * error + scale * scale + qp * qp;
}

/// The setting on a hull that is nearest to the wanted one, of its lattice.
Setting nearest(const std::vector<Setting>& hull, const Setting& wanted) {
  MR_ASSERT(!hull.empty());
  return *std::ranges::min_element(hull, {}, [&](const Setting& setting) {
    return std::pair(setting.bits != wanted.bits, distance(setting, wanted));
  });
}

}  // namespace

Classifier Classifier::train(std::span<const Sweep> training) {
  Classifier out;
  out.space_ = FeatureSpace(training);
  for (const bool layers : {true, false}) {
    std::vector<Sweep> sweeps;
    std::ranges::copy_if(training, std::back_inserter(sweeps),
                         [&](const Sweep& sweep) { return sweep.layers == layers; });
    if (sweeps.empty()) continue;
    Samples lattices, errors, scales, qps;
    Machines machines;
    machines.nominal = NominalRates::train(sweeps);
    for (const Sweep& sweep : sweeps) {
      const RateSurface surface(grid_values(sweep));
      const auto at = [&](double mbps) {
        return input(out.space_.at(sweep.features), machines.nominal, usual(surface), mbps);
      };
      const auto hull = convex_hull(candidate_points(surface));
      for (const double mbps : targets_of(hull, kTargets))
        lattices.add(at(mbps), best_within(hull, kMargin * mbps).setting.bits);
      for (const int bits : kLattices) {
        const auto of_lattice = convex_hull(candidate_points(surface, bits));
        for (const RatePoint& p : of_lattice) machines.hull.push_back(p.setting);
        for (const double mbps : targets_of(of_lattice, kTargets)) {
          const Setting best = best_within(of_lattice, kMargin * mbps).setting;
          const std::vector<double> features = on_lattice(at(mbps), bits);
          errors.add(features, error_class(best.error_voxels));
          scales.add(features, scale_class(best.scale));
          qps.add(features, qp_class(best.qp));
        }
      }
    }
    std::ranges::sort(machines.hull);
    machines.hull.erase(std::unique(machines.hull.begin(), machines.hull.end()),
                        machines.hull.end());
    machines.bits = lattices.train(), machines.error = errors.train();
    machines.scale = scales.train(), machines.qp = qps.train();
    (layers ? out.kinds_.layers : out.kinds_.without_layers).push_back(std::move(machines));
  }
  return out;
}

Setting Classifier::choose(const Observation& observed, double target_mbps) const {
  const auto& kind = observed.layers ? kinds_.layers : kinds_.without_layers;
  const Machines& machines =
      !kind.empty() ? kind.front()
                    : (observed.layers ? kinds_.without_layers : kinds_.layers).front();
  const auto produced =
      observed.produced.empty() ? std::nullopt : std::optional(observed.produced.back());
  std::vector<double> in =
      input(space_.at(observed.features), machines.nominal, produced, target_mbps);
  const int bits = observed.bits.value_or(machines.bits.predict(in));
  in = on_lattice(std::move(in), bits);
  const auto scale = static_cast<std::size_t>(std::clamp(machines.scale.predict(in), 0, 2));
  Setting out = nearest(machines.hull, {error_of(machines.error.predict(in)), bits, kScales[scale],
                                        machines.qp.predict(in) * kQpStep});
  if (observed.bits) out.bits = *observed.bits;
  return out;
}

}  // namespace mr::rate
