#include "mr/core/trajectory.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

namespace mr {
namespace {

/// The rotation by `angle` about a unit vector (Rodrigues).
Mat3 rotation_about(Vec3d axis, double angle) {
  const double c = std::cos(angle), s = std::sin(angle), t = 1 - c;
  const auto [x, y, z] = std::array{axis.x, axis.y, axis.z};
  return {{t * x * x + c, t * x * y - s * z, t * x * z + s * y,  //
           t * x * y + s * z, t * y * y + c, t * y * z - s * x,  //
           t * x * z - s * y, t * y * z + s * x, t * z * z + c}};
}

/// The axis of a rotation by half a turn: the largest column of R + I.
Vec3d half_turn_axis(const Mat3& R) {
  Vec3d best;
  for (int c = 0; c < 3; ++c) {
    Vec3d column = R.column(c);
    (c == 0 ? column.x : c == 1 ? column.y : column.z) += 1;
    if (length(column) > length(best)) best = column;
  }
  return normalized(best);
}

/// The share `s` of a rotation, about its own axis.
Mat3 part_of(const Mat3& R, double s) {
  const Vec3d twice{R(2, 1) - R(1, 2), R(0, 2) - R(2, 0), R(1, 0) - R(0, 1)};  // axis · 2 sin
  const double angle = std::atan2(length(twice), R(0, 0) + R(1, 1) + R(2, 2) - 1);
  if (angle < 1e-12) return {};
  const Vec3d axis = length(twice) > 1e-9 ? normalized(twice) : half_turn_axis(R);
  return rotation_about(axis, s * angle);
}

Pose between(const Pose& a, const Pose& b, double s) {
  return {a.rotation * part_of(transposed(a.rotation) * b.rotation, s),
          a.translation + (b.translation - a.translation) * s};
}

double seconds(Duration d) { return std::chrono::duration<double>(d).count(); }

}  // namespace

Trajectory::Trajectory(std::vector<TimedPose> poses) : poses_(std::move(poses)) {
  std::ranges::stable_sort(poses_, {}, &TimedPose::at);
  const auto same_time = [](const TimedPose& a, const TimedPose& b) { return a.at == b.at; };
  poses_.erase(std::unique(poses_.begin(), poses_.end(), same_time), poses_.end());
}

Result<Pose> Trajectory::at(TimePoint time) const {
  const auto none = [&](const char* why) {
    return Error{Error::Cause::not_found,
                 "no pose at " + std::to_string(seconds(time.time_since_epoch())) + " s: " + why};
  };
  const auto after = std::ranges::lower_bound(poses_, time, {}, &TimedPose::at);
  if (after != poses_.end() && after->at == time) return after->T_world_sensor;
  if (after == poses_.begin())
    return after != poses_.end() && after->at - time <= kReach
               ? Result<Pose>(after->T_world_sensor)
               : none("the trajectory begins later");
  const auto before = after - 1;
  if (after == poses_.end())
    return time - before->at <= kReach ? Result<Pose>(before->T_world_sensor)
                                       : none("the trajectory ends earlier");
  if (after->at - before->at > kMostApart) return none("the trajectory has a gap");
  const double s = seconds(time - before->at) / seconds(after->at - before->at);
  return between(before->T_world_sensor, after->T_world_sensor, s);
}

}  // namespace mr
