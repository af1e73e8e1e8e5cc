#pragma once

#include <array>
#include <cstdint>

#include "mr/core/pose.h"

namespace mr::synth {

inline constexpr std::size_t kBones = 45;  ///< numbered in bones.h

/// A person's joints in the rest pose. Person frame, metres.
struct Skeleton {
  std::array<Vec3d, kBones> joint;  ///< what each bone turns about
  double scale = 1;                 ///< of the feet: stature over 1.75 m
};

/// What differs between skeletons of one stature, as factors.
struct Proportions {
  double shoulder_width = 1, hip_width = 1;
};

/// A skeleton 1.75 m tall: arms 50 degrees from the sides, legs a little apart, palms inwards.
Skeleton make_skeleton(const Proportions& proportions);

/// Directions of a left hand at rest: along the fingers, to the thumb, out of the palm.
struct HandAxes {
  Vec3d ahead, thumb, palm;
};
HandAxes left_hand_axes(const Skeleton& skeleton);

/// Tip of a finger of the left hand at rest (of its second bone).
Vec3d left_finger_tip(const Skeleton& skeleton, int finger);

/// A pose of the skeleton: each bone's transform from rest.
using Posture = std::array<Pose, kBones>;

/// Rotation by an angle about a unit axis (Rodrigues).
Mat3 rotation(Vec3d axis, double angle_rad);
/// The smallest rotation that takes one unit vector to another, which must not be its opposite.
Mat3 turn_between(Vec3d from, Vec3d to);
/// Columns: `ahead`, and the directions square to it of which the second is nearest to `side`.
Mat3 frame_along(Vec3d ahead, Vec3d side);

}  // namespace mr::synth
