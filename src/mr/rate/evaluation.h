#pragma once

#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "mr/rate/model.h"
#include "mr/rate/swept_surface.h"

namespace mr::rate {

/// One prediction for a scene that the model was not trained on.
struct Prediction {
  std::string scene;
  bool layers = true;
  double target_mbps = 0;
  double limit_mbps = 0;   ///< the target, or the scene's lowest rate where the target is below it
  RatePoint got;           ///< what the setting really costs and gives
  RatePoint usual;         ///< what the usual setting does
  double moving_loss = 0;  ///< of the quality of what moves, against the usual setting
  double gap = 0;          ///< to the Pareto hull at the target (gap_to_hull())
  double decision_ms = 0;  ///< of one choice
};

/// By how much quality stays behind the hull at the target. A result over its target by more than
/// 3 % counts as the hull's lowest point.
double gap_to_hull(const std::vector<RatePoint>& hull, double target_mbps, const RatePoint& got);

/// Mean, 95th percentile and greatest of the gaps; share of the results over their limit by more
/// than 3 %; mean of |rate / limit - 1|.
struct GapStatistics {
  double mean = 0, p95 = 0, max = 0, over = 0, rate_error = 0;
  /// Of quality, against the usual setting whatever that costs.
  double mean_loss = 0, most_loss = 0, mean_moving_loss = 0;
};
GapStatistics statistics(std::span<const Prediction> predictions);

/// How far what lies between the nodes of the grid is from what was measured there (by the
/// bisection): means and greatest, of the rate's ratio and of SSIM.
struct InterpolationError {
  std::size_t points = 0;
  double mean_rate = 0, most_rate = 0, mean_ssim = 0, most_ssim = 0;
};
InterpolationError interpolation_error(std::span<const Sweep> sweeps);

/// How far our model's predictions of the room are off, with features alone, for scenes it was not
/// trained on: means over these and over the nodes.
struct RoomError {
  std::size_t scenes = 0;
  double plate_bytes = 0, still_bytes = 0;  ///< |predicted / true - 1|
  double plate_loss = 0, still_loss = 0;    ///< of SSIM
};
RoomError room_error(std::span<const Sweep> sweeps);

using Trainer = std::function<std::unique_ptr<Model>(std::span<const Sweep>)>;
/// The targets for a scene, given its hull and what its usual setting costs.
using Targets =
    std::function<std::vector<double>(const std::vector<RatePoint>& hull, double usual_mbps)>;

/// How often a model corrects itself by what was produced before it is judged. Before the first
/// choice the scene was coded in the usual setting.
struct Corrections {
  int choices = 1;
  bool sees_produced = true;  ///< false: features alone
  double moving_weight = 0;   ///< in what the model looks for; gaps are of the whole picture
};

/// Leaves each scene out in turn: trains on the others, predicts for all its sweeps. Every
/// setting's real cost is taken from its sweep (RateSurface). Sweeps of one scene must follow each
/// other.
std::vector<Prediction> leave_one_out(std::span<const Sweep> sweeps, const Trainer& train,
                                      const Targets& targets, const Corrections& corrections);

}  // namespace mr::rate
