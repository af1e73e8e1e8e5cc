#pragma once

#include <vector>

#include "mr/core/frame.h"
#include "mr/core/pose.h"
#include "mr/core/result.h"

namespace mr {

/// A pose and when it held.
struct TimedPose {
  TimePoint at{};
  Pose T_world_sensor;
  friend bool operator==(const TimedPose&, const TimedPose&) = default;
};

/// The way of a moving sensor: poses with their own time stamps, which need not be those of the
/// sensor's frames.
class Trajectory {
 public:
  /// Poses farther apart than this are not interpolated; nor is one that is nearer than kReach
  /// beyond the first or last pose extrapolated: it is that pose.
  static constexpr Duration kMostApart = std::chrono::milliseconds(500);
  static constexpr Duration kReach = std::chrono::milliseconds(20);

  Trajectory() = default;
  /// In any order; of several poses of one time the first is kept.
  explicit Trajectory(std::vector<TimedPose> poses);

  /// The pose at a time: translation linearly, rotation along the shortest arc (slerp). Error
  /// not_found: before the first pose, after the last, or between two that are too far apart.
  Result<Pose> at(TimePoint time) const;

  const std::vector<TimedPose>& poses() const { return poses_; }  ///< by time
  friend bool operator==(const Trajectory&, const Trajectory&) = default;

 private:
  std::vector<TimedPose> poses_;
};

}  // namespace mr
