#pragma once

#include <span>
#include <vector>

#include "mr/rate/features.h"
#include "mr/rate/observation.h"
#include "mr/rate/sweep.h"

namespace mr::rate {

/// The features of a frame by their names, as sweeps store them.
std::vector<Feature> named(const SceneFeatures& features);

/// The features of a scene: their mean over its sensors, and how many there are.
std::vector<Feature> scene_features(std::span<const SensorFeatures> sensors);

/// The names of those that models use.
std::span<const char* const> feature_names();

/// Features as numbers of mean 0 and deviation 1 over the training scenes: logarithms of
/// feature_names(). One that is the same in all of these is left out.
class FeatureSpace {
 public:
  FeatureSpace() = default;
  explicit FeatureSpace(std::span<const Sweep> training);
  /// As stored in a model file.
  FeatureSpace(std::vector<double> mean, std::vector<double> deviation)
      : mean_(std::move(mean)), deviation_(std::move(deviation)) {}

  static std::size_t size();
  /// [size()]; what is not known is 0, the mean.
  std::vector<double> at(const std::vector<Feature>& features) const;

  const std::vector<double>& mean() const { return mean_; }
  const std::vector<double>& deviation() const { return deviation_; }

 private:
  std::vector<double> mean_, deviation_;
};

}  // namespace mr::rate
