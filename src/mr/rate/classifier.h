#pragma once

#include <span>
#include <vector>

#include "mr/rate/feature_space.h"
#include "mr/rate/model.h"
#include "mr/rate/nominal_rates.h"
#include "mr/rate/svm.h"

namespace mr::rate {

/// The paper's joint classifier (4.2): one support vector machine for each parameter, all fed the
/// same features and the target, trained together on the points of the training scenes' hulls. A
/// combination that lies on no hull snaps to the nearest that does, of the lattice in force:
/// another one is chosen only where an epoch begins. The features are the scene's energies, and
/// what the encoders produced lately.
class Classifier final : public Model {
 public:
  /// Of one kind of scenes, with or without layers.
  struct Machines {
    NominalRates nominal;
    Svm error, bits, scale, qp;
    std::vector<Setting> hull;  ///< settings on the training hulls, each lattice's
  };
  struct Kinds {
    std::vector<Machines> layers, without_layers;  ///< at most one of each; not both are empty
  };

  Classifier() = default;
  Classifier(FeatureSpace space, Kinds kinds)
      : space_(std::move(space)), kinds_(std::move(kinds)) {}
  static Classifier train(std::span<const Sweep> training);

  Setting choose(const Observation& observed, double target_mbps) const override;

  const FeatureSpace& space() const { return space_; }
  const Kinds& kinds() const { return kinds_; }

 private:
  FeatureSpace space_;
  Kinds kinds_;
};

}  // namespace mr::rate
