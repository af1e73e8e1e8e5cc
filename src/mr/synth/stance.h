#pragma once

#include <array>

#include "mr/synth/gesture.h"
#include "mr/synth/skeleton.h"

namespace mr::synth {

inline constexpr Vec3d kAhead{1, 0, 0}, kLeft{0, 1, 0}, kUp{0, 0, 1};

/// A planar pose: position on the floor and heading; floor frame.
struct FloorPose {
  Vec2d place;
  double heading_rad = 0;

  Mat3 facing() const { return rotation(kUp, heading_rad); }
  Vec3d on_floor() const { return {place.x, place.y, 0}; }
};

struct FootPose {
  Vec3d ankle;
  Mat3 rotation;
  double pitch_rad = 0;  ///< toes up is positive
};

/// A body's pose by its end effectors (feet, pelvis, trunk, arms), from which inverse kinematics
/// finds all bones. Floor frame: z up, floor at z = 0.
struct Stance {
  std::array<FootPose, 2> feet;
  Mat3 pelvis_attitude;
  Vec3d pelvis_place;
  Mat3 waist, chest, neck, head;  ///< rotations about their joints, relative to the parent bone
  std::array<ArmPose, 2> arms;
};

/// Inverse kinematics: bends the knees so that the feet are where the stance has them.
Posture posture_of(const Skeleton& skeleton, const Stance& stance, const Pose& T_world_floor);

/// The greatest height of the pelvis at which both legs reach their feet with slightly bent knees.
double reachable_height(const Skeleton& skeleton, const Stance& stance);

/// Interpolates between two stances, `share` 0 to 1; feet that move far are lifted.
Stance blended(const Stance& a, const Stance& b, double share);

/// Upright with arms that hang.
Stance standing_stance(const Skeleton& skeleton, const FloorPose& spot);
/// On a seat: the pelvis over `seat`, feet on the floor ahead of it. `lean_rad`: back is positive.
Stance seated_stance(const Skeleton& skeleton, const FloorPose& seat, double seat_m,
                     double feet_ahead_m, double lean_rad);
/// Halfway between standing over the feet of a seated stance and that.
Stance crouching_stance(const Skeleton& skeleton, const Stance& standing, const Stance& seated);
/// Bent down, both hands at something on the floor ahead.
Stance reaching_stance(const Skeleton& skeleton, const FloorPose& spot);
/// How arms hold something before the chest.
std::array<ArmPose, 2> holding_arms();

}  // namespace mr::synth
