#pragma once

#include <deque>
#include <optional>

#include "mr/core/frame.h"

namespace mr::rate {

/// One link between two nodes, seen by its receiver: what comes over it, what it can carry, and how
/// much coarser what is sent has to be. The limit is that of the scene, or is measured: packets
/// that arrive later and later after they were sent wait in a queue, and what arrives meanwhile is
/// what the link carries. Only differences of delays count, so the clocks of the two nodes need not
/// agree. Time is an argument.
class LinkBudget {
 public:
  static constexpr int kCoarsest = 24;

  /// `limit_mbps`: of the scene; nothing: not known.
  explicit LinkBudget(std::optional<double> limit_mbps = {}) : scene_limit_mbps_(limit_mbps) {}

  /// The clocks of the two nodes are compared otherwise from now on.
  void forget_delays() { delays_.clear(), late_ = 0; }

  /// A packet arrived; `sent`: when its sender had finished it, if that is known.
  void arrived(double bytes, std::optional<TimePoint> sent, TimePoint came);

  /// Quantiser steps by which its sensors have to be coarser than planned, 0 to kCoarsest.
  int coarser() const { return coarser_; }
  /// Nothing: no limit is known.
  std::optional<double> limit_mbps() const;
  /// Of the last second.
  double mbps() const { return mbps_; }

 private:
  void measure(Duration delay, TimePoint came);
  void lower(double mbps, TimePoint now);
  void decide(TimePoint now);

  struct Arrival {
    TimePoint came;
    double bytes = 0;
  };
  struct Delay {
    TimePoint came;
    Duration delay{};
  };
  std::optional<double> scene_limit_mbps_, measured_mbps_;
  std::deque<Arrival> second_;  ///< of the last second
  std::deque<Delay> delays_;    ///< of the last seconds; only those that may become the shortest
  double mbps_ = 0;
  std::optional<TimePoint> first_, limit_changed_, decided_, lowered_;
  int late_ = 0;  ///< packets in a row that waited
  int coarser_ = 0;
};

}  // namespace mr::rate
