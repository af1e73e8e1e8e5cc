#pragma once

#include <vector>

#include "mr/synth/floor_plan.h"
#include "mr/synth/gait.h"

namespace mr::synth {

/// A path through a room that avoids furniture where it can (Dijkstra on a grid), with rounded
/// corners.
class FloorPath final : public WalkPath {
 public:
  /// From the first point straight to the second, from there on to the last. At least two points.
  FloorPath(const FloorPlan& plan, Vec2d first, Vec2d second, Vec2d last);

  double length_m() const override { return along_.back(); }
  FloorPose at(double part) const override;

  /// The same path in the opposite direction.
  FloorPath reversed() const;

 private:
  FloorPath() = default;
  void measure();
  Vec2d point(double along_m) const;

  std::vector<Vec2d> points_;
  std::vector<double> along_;  // [points_] metres
};

}  // namespace mr::synth
