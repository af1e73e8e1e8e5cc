#include "mr/rate/feature_space.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

namespace mr::rate {
namespace {

// Those that tell scenes apart best; the deviations follow the energies.
constexpr std::array kNames{"color_spatial",  "color_temporal", "depth_spatial", "depth_temporal",
                            "moving_percent", "mask_percent",   "triangles",     "sensors"};

// Of a logarithm: in what is the same in all training scenes, others may not differ by much.
constexpr double kLeastDeviation = 0.02;

/// Energies of a still picture are 0.
std::optional<double> log_of(const std::vector<Feature>& features, const char* name) {
  const auto found = std::ranges::find(features, name, &Feature::name);
  if (found == features.end() || !std::isfinite(found->value)) return std::nullopt;
  return std::log1p(std::max(found->value, 0.0));
}

}  // namespace

std::vector<Feature> named(const SceneFeatures& features) {
  const auto& [color, depth, moving_pixels, mask_coverage, triangles] = features;
  return {{"color_spatial", color.spatial},
          {"color_temporal", color.temporal},
          {"color_spatial_deviation", color.spatial_deviation},
          {"color_temporal_deviation", color.temporal_deviation},
          {"color_temporal_gradient", std::abs(color.temporal_gradient)},
          {"color_pixel_deviation", color.pixel_deviation},
          {"depth_spatial", depth.spatial},
          {"depth_temporal", depth.temporal},
          {"depth_spatial_deviation", depth.spatial_deviation},
          {"depth_temporal_deviation", depth.temporal_deviation},
          {"depth_temporal_gradient", std::abs(depth.temporal_gradient)},
          {"depth_pixel_deviation", depth.pixel_deviation},
          {"moving_percent", 100 * moving_pixels},
          {"mask_percent", 100 * mask_coverage},
          {"triangles", triangles}};
}

std::vector<Feature> scene_features(std::span<const SensorFeatures> sensors) {
  std::vector<Feature> out = named(mean_features(sensors));
  out.push_back({"sensors", static_cast<double>(sensors.size())});
  return out;
}

std::span<const char* const> feature_names() { return kNames; }

std::size_t FeatureSpace::size() { return kNames.size(); }

FeatureSpace::FeatureSpace(std::span<const Sweep> training) {
  for (const char* name : kNames) {
    double sum = 0, squares = 0, n = 0;
    for (const Sweep& sweep : training)
      if (const auto value = log_of(sweep.features, name))
        sum += *value, squares += *value * *value, ++n;
    const double mean = n > 0 ? sum / n : 0;
    mean_.push_back(mean);
    deviation_.push_back(
        std::max(std::sqrt(std::max(n > 0 ? squares / n - mean * mean : 0, 0.0)), 1e-6));
  }
}

std::vector<double> FeatureSpace::at(const std::vector<Feature>& features) const {
  std::vector<double> out;
  for (std::size_t i = 0; i < kNames.size(); ++i) {
    const auto value = log_of(features, kNames[i]);
    const bool is_known = value && deviation_[i] > kLeastDeviation;
    out.push_back(is_known ? (*value - mean_[i]) / deviation_[i] : 0);
  }
  return out;
}

}  // namespace mr::rate
