#pragma once

#include <span>
#include <vector>

#include "mr/rate/observation.h"
#include "mr/rate/sweep.h"

namespace mr::rate {

/// What settings cost on average over the training scenes, by which what was produced under one
/// setting is compared with what another would cost.
class NominalRates {
 public:
  NominalRates() = default;
  /// `log_mbps`: at the grid's nodes, of geometry and then of texture; as stored in a model file.
  explicit NominalRates(std::vector<double> log_mbps) : log_mbps_(std::move(log_mbps)) {}
  /// Means over these sweeps, which must not be none.
  static NominalRates train(std::span<const Sweep> sweeps);
  static std::size_t size();

  /// Logarithms of what geometry and texture would cost in the usual setting.
  std::vector<double> usual_log_mbps(const Observation::Produced& produced) const;
  const std::vector<double>& log_mbps() const { return log_mbps_; }

 private:
  std::vector<double> log_mbps_;
};

}  // namespace mr::rate
