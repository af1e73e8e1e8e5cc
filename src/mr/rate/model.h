#pragma once

#include "mr/rate/backlog_share.h"
#include "mr/rate/observation.h"
#include "mr/rate/room.h"
#include "mr/rate/setting.h"

namespace mr::rate {

/// Chooses the setting for a rate (paper 4.2, Joint Rate Allocation Model). Immutable; any thread.
class Model {
 public:
  virtual ~Model() = default;
  /// The setting that is to give the best picture within a rate of the moving surface and the live
  /// tiles; of the lowest rate where none is known to fit.
  virtual Setting choose(const Observation& observed, double target_mbps) const = 0;
  /// What a backlog is to get of a rate, 0 to 1, while it waits; the moving surface and the live
  /// tiles get the rest. The paper has no backlog: its models give it the usual share.
  virtual double backlog_share(const Observation& /*observed*/, const Backlog& /*backlog*/,
                               double /*target_mbps*/) const {
    return kUsualBacklogShare;
  }
};

}  // namespace mr::rate
