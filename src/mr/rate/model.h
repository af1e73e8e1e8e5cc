#pragma once

#include "mr/rate/observation.h"
#include "mr/rate/setting.h"

namespace mr::rate {

/// Chooses the setting for a rate (paper 4.2, Joint Rate Allocation Model). Immutable; any thread.
class Model {
 public:
  virtual ~Model() = default;
  /// The setting that is to give the best picture within a rate of the moving surface and the live
  /// tiles; of the lowest rate where none is known to fit.
  virtual Setting choose(const Observation& observed, double target_mbps) const = 0;
};

}  // namespace mr::rate
