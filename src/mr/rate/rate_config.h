#pragma once

namespace mr::rate {

struct RateConfig {
  enum class Model { fixed, lookup, classifier, ours } model = Model::fixed;
  double target_mbps = 20;
  friend bool operator==(const RateConfig&, const RateConfig&) = default;
};

}  // namespace mr::rate
