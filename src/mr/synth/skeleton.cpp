#include "mr/synth/skeleton.h"

#include <cmath>
#include <numbers>

#include "mr/synth/bones.h"
#include "mr/synth/solid.h"

namespace mr::synth {
namespace {

constexpr double kDegree = std::numbers::pi / 180;

/// Of a finger, in the hand's axes from the wrist; metres.
struct Finger {
  Vec3d base;  ///< ahead, to the thumb, out of the palm
  double spread_rad;
  double first_m, rest_m;  ///< bone lengths
};

constexpr std::array<Finger, kFingers> kHand{{
    {{0.030, 0.026, 0.010}, 38 * kDegree, 0.046, 0.036},
    {{0.088, 0.0315, 0}, 8 * kDegree, 0.042, 0.036},
    {{0.091, 0.0105, 0}, 2 * kDegree, 0.046, 0.040},
    {{0.087, -0.0105, 0}, -4 * kDegree, 0.042, 0.037},
    {{0.080, -0.0305, 0}, -11 * kDegree, 0.034, 0.030},
}};

Vec3d in_hand(const HandAxes& axes, Vec3d v) {
  return axes.ahead * v.x + axes.thumb * v.y + axes.palm * v.z;
}

Vec3d finger_direction(const HandAxes& axes, int finger) {
  const double a = kHand[finger].spread_rad;
  const double into_palm = finger == 0 ? 0.25 : 0.06;
  return normalized(in_hand(axes, {std::cos(a), std::sin(a), into_palm}));
}

void set_arm(Skeleton& s, const Proportions& proportions) {
  constexpr double kAway = 50 * kDegree, kBend = 14 * kDegree;
  const auto joint = [&](int bone) -> Vec3d& { return s.joint[bone_of(left, bone)]; };
  const Vec3d down_out{0, std::sin(kAway), -std::cos(kAway)};
  const Vec3d ahead = normalized(down_out * std::cos(kBend) + Vec3d{std::sin(kBend), 0, 0});
  joint(clavicle) = {0, 0.02, 1.415};
  joint(shoulder) = joint(upper_arm) = {-0.012, 0.172 * proportions.shoulder_width, 1.390};
  joint(forearm) = joint(wrist) = joint(shoulder) + down_out * 0.285;
  joint(hand) = joint(forearm) + ahead * 0.25;
  const HandAxes axes = left_hand_axes(s);
  for (int f = 0; f < kFingers; ++f) {
    const Vec3d base = joint(hand) + in_hand(axes, kHand[f].base);
    s.joint[finger_bone(left, f, 0)] = base;
    s.joint[finger_bone(left, f, 1)] = base + finger_direction(axes, f) * kHand[f].first_m;
  }
}

void set_leg(Skeleton& s, const Proportions& proportions) {
  const auto joint = [&](int bone) -> Vec3d& { return s.joint[bone_of(left, bone)]; };
  const double hip_y = 0.088 * proportions.hip_width, spread = 0.105;
  joint(thigh) = {0, hip_y, 0.92};
  joint(shin) = {0.012, hip_y + 0.52 * spread, 0.495};
  joint(foot) = {-0.015, hip_y + spread, 0.085};
  joint(toes) = {0.115, hip_y + spread + 0.008, 0.02};
}

}  // namespace

Mat3 rotation(Vec3d axis, double angle) {
  const double c = std::cos(angle), s = std::sin(angle), k = 1 - c;
  const auto [x, y, z] = axis;
  return {{c + x * x * k, x * y * k - z * s, x * z * k + y * s,  //
           y * x * k + z * s, c + y * y * k, y * z * k - x * s,  //
           z * x * k - y * s, z * y * k + x * s, c + z * z * k}};
}

Mat3 turn_between(Vec3d from, Vec3d to) {
  const Vec3d axis = cross(from, to);
  const double sine = length(axis);
  return sine > 1e-9 ? rotation(axis / sine, std::atan2(sine, dot(from, to))) : Mat3{};
}

Mat3 frame_along(Vec3d ahead, Vec3d side) {
  const Vec3d x = normalized(ahead), y = normalized(side - x * dot(side, x)), z = cross(x, y);
  return {{x.x, y.x, z.x, x.y, y.y, z.y, x.z, y.z, z.z}};
}

HandAxes left_hand_axes(const Skeleton& s) {
  const Vec3d ahead = normalized(s.joint[bone_of(left, hand)] - s.joint[bone_of(left, forearm)]);
  const Vec3d thumb = normalized(Vec3d{1, 0, 0} - ahead * ahead.x);
  return {ahead, thumb, cross(ahead, thumb)};
}

Vec3d left_finger_tip(const Skeleton& s, int finger) {
  return s.joint[finger_bone(left, finger, 1)] +
         finger_direction(left_hand_axes(s), finger) * kHand[finger].rest_m;
}

Skeleton make_skeleton(const Proportions& proportions) {
  Skeleton s;
  s.joint[pelvis] = {-0.01, 0, 0.96};
  s.joint[waist] = {-0.01, 0, 1.06};
  s.joint[chest] = {-0.015, 0, 1.20};
  s.joint[neck] = {-0.015, 0, 1.465};
  s.joint[head] = {0.0, 0, 1.555};
  set_arm(s, proportions);
  set_leg(s, proportions);
  for (int b = 0; b < side_bones; ++b)
    s.joint[bone_of(right, b)] = mirrored(s.joint[bone_of(left, b)]);
  return s;
}

}  // namespace mr::synth
