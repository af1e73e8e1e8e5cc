#pragma once

#include <span>
#include <vector>

#include "mr/rate/feature_space.h"
#include "mr/rate/model.h"
#include "mr/rate/room.h"
#include "mr/rate/swept_surface.h"

namespace mr::rate {

/// Our model. A scene is one vector: its features, the logarithms of its rates at the grid's nodes,
/// those of its losses of quality against the best, and the same of its room: plates and still
/// surface. Vectors of scenes are taken to be Gaussian,
/// with the mean and the (shrunk) covariance of the training sweeps. Features, and what the
/// encoders really produced, are readings of some of its values; the others are predicted by
/// conditioning on them, as an ensemble Kalman filter does (Evensen 1994). The rates are at last
/// scaled so that they agree with the newest readings. So rate and quality of every setting are
/// predicted, moving surface and live tiles apart, and any target can be solved for.
class CurvePredictor final : public Model {
 public:
  /// A training sweep's values; of one kind, with or without layers.
  struct Member {
    std::vector<double> features;  ///< [FeatureSpace::size()]
    std::vector<double> values;    ///< [value_count()]
  };
  struct Members {
    std::vector<Member> layers, without_layers;
  };
  static std::size_t value_count();

  CurvePredictor() = default;
  CurvePredictor(FeatureSpace space, Members members);
  static CurvePredictor train(std::span<const Sweep> training);

  /// The rate of every setting, and its quality, what moves weighted as the observation says.
  RateSurface predict(const Observation& observed) const;
  /// What the still surface and the plates take and lose.
  RoomValues predict_room(const Observation& observed) const;

  Setting choose(const Observation& observed, double target_mbps) const override;
  double backlog_share(const Observation& observed, const Backlog& backlog,
                       double target_mbps) const override;

  const FeatureSpace& space() const { return space_; }
  const Members& members() const { return members_; }

 private:
  std::vector<double> values_given(const Observation& observed) const;
  std::vector<RatePoint> allowed_points(const Observation& observed) const;

  FeatureSpace space_;
  Members members_;
};

}  // namespace mr::rate
