#pragma once

#include <array>
#include <cstdint>

#include "mr/core/vec.h"

namespace mr::synth {

/// What an arm and its hand do. Directions in the frame of the chest (x ahead, z up), as of a left
/// arm; a right arm does the mirror image.
struct ArmPose {
  Vec3d upper, fore;     ///< where the upper arm and the forearm point; never along one line
  double twist_rad = 0;  ///< palm up is positive
  std::array<double, 5> curl{};  ///< thumb to little finger: 0 straight, 1 a fist
};

/// An arm that hangs and swings ahead.
ArmPose hanging_arm(double swing_rad);

/// On the way from one pose to another, 0 to 1: the forearm goes up in front, not through the body.
ArmPose blended(const ArmPose& a, const ArmPose& b, double share);

/// Both arms of someone who walks and now and then waves, points, talks with the hands, scratches
/// the head or opens and closes a hand. `period`: part of the walk's period, repeats after 1;
/// `swing_rad`: how far the left arm swings ahead, the right one swings back.
std::array<ArmPose, 2> arm_poses(std::uint64_t seed, double period_s, double period,
                                 double swing_rad);

}  // namespace mr::synth
