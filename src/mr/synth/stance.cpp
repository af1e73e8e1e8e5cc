#include "mr/synth/stance.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "mr/synth/bones.h"
#include "mr/synth/solid.h"

namespace mr::synth {
namespace {

/// Puts the bones where a stance wants them.
class PoseSolver {
 public:
  PoseSolver(const Skeleton& skeleton, const Stance& stance)
      : skeleton_(skeleton), stance_(stance) {}

  Posture pose(const Pose& T_world_floor) {
    for (const Side side : kSides) set_foot(side);
    put(pelvis, stance_.pelvis_attitude, stance_.pelvis_place);
    turn(waist, posture_[pelvis], stance_.waist);
    turn(chest, posture_[waist], stance_.chest);
    turn(neck, posture_[chest], stance_.neck);
    turn(head, posture_[neck], stance_.head);
    for (const Side side : kSides) set_leg(side);
    for (const Side side : kSides) set_arm(side, stance_.arms[side]);
    for (Pose& pose : posture_) pose = T_world_floor * pose;
    return posture_;
  }

 private:
  const Vec3d& joint(std::size_t bone) const { return skeleton_.joint[bone]; }

  /// A bone turned about its joint, carried by another.
  void turn(std::size_t bone, const Pose& carrier, const Mat3& by) {
    posture_[bone] = carrier * Pose{by, joint(bone) - by * joint(bone)};
  }
  /// A bone in a known attitude with its joint in a known place.
  void put(std::size_t bone, const Mat3& attitude, Vec3d place) {
    posture_[bone] = {attitude, place - attitude * joint(bone)};
  }

  void set_foot(Side side) {
    const FootPose& foot_pose = stance_.feet[side];
    put(bone_of(side, foot), foot_pose.rotation, foot_pose.ankle);
    turn(bone_of(side, toes), posture_[bone_of(side, foot)],
         rotation(kLeft, std::min(foot_pose.pitch_rad, 0.0)));
  }

  /// Bends the knee so that the foot is where it should be.
  void set_leg(Side side) {
    const std::size_t upper = bone_of(side, thigh), lower = bone_of(side, shin);
    const Vec3d hip = posture_[pelvis] * joint(upper), ankle = stance_.feet[side].ankle;
    const Vec3d rest_upper = joint(lower) - joint(upper),
                rest_lower = joint(bone_of(side, foot)) - joint(lower);
    const double a = length(rest_upper), b = length(rest_lower), far = length(ankle - hip);
    const double reach = std::min(far, 0.9999 * (a + b));
    const double cosine = (a * a + reach * reach - b * b) / (2 * a * reach);
    const Vec3d down = normalized(ankle - hip);
    const Vec3d toes_ahead =
        stance_.feet[side].rotation.column(0) + posture_[pelvis].rotation.column(0);
    const Vec3d ahead = normalized(toes_ahead - down * dot(toes_ahead, down));
    const double bend = std::acos(std::clamp(cosine, -1.0, 1.0));
    const Vec3d knee = hip + down * (a * std::cos(bend)) + ahead * (a * std::sin(bend));
    const auto attitude = [&](Vec3d rest, Vec3d now) {
      return frame_along(now, ahead) * transposed(frame_along(rest, kAhead));
    };
    put(upper, attitude(rest_upper, knee - hip), hip);
    put(lower, attitude(rest_lower, ankle - knee), knee);
  }

  void set_arm(Side side, const ArmPose& pose) {
    const auto own = [&](Vec3d v) { return side == left ? v : mirrored(v); };
    const auto at = [&](int bone) { return bone_of(side, bone); };
    const Vec3d upper = normalized(own(pose.upper)), fore = normalized(own(pose.fore));
    const Vec3d rest_upper = normalized(joint(at(forearm)) - joint(at(shoulder))),
                rest_fore = normalized(joint(at(hand)) - joint(at(forearm)));
    const Mat3& trunk = posture_[chest].rotation;
    // A raised arm lifts its shoulder.
    const double lift = 0.22 * std::max(0.0, upper.z - rest_upper.z);
    turn(at(clavicle), posture_[chest], rotation(kAhead, sign_of(side) * lift));
    const Vec3d top = posture_[at(clavicle)] * joint(at(shoulder));
    const Vec3d hinge = cross(upper, fore), rest_hinge = cross(rest_upper, rest_fore);
    const auto attitude = [&](Vec3d rest, Vec3d now) {
      return trunk * frame_along(now, hinge) * transposed(frame_along(rest, rest_hinge));
    };
    put(at(shoulder), trunk * turn_between(rest_upper, upper), top);
    put(at(upper_arm), attitude(rest_upper, upper), top);
    const Vec3d elbow = posture_[at(upper_arm)] * joint(at(forearm));
    put(at(forearm), attitude(rest_fore, fore), elbow);
    const double twist = sign_of(side) * pose.twist_rad;
    turn(at(wrist), posture_[at(forearm)], rotation(rest_fore, 0.5 * twist));
    turn(at(hand), posture_[at(forearm)], rotation(rest_fore, twist));
    set_fingers(side, pose);
  }

  void set_fingers(Side side, const ArmPose& pose) {
    const HandAxes axes = left_hand_axes(skeleton_);
    // Turning about the thumb's direction bends fingers into the palm; mirroring reverses turns.
    for (int f = 0; f < kFingers; ++f) {
      const Vec3d along = joint(finger_bone(left, f, 1)) - joint(finger_bone(left, f, 0));
      const Vec3d toward = f == 0 ? axes.palm * 0.7 - axes.thumb : axes.palm;
      const Vec3d axis_left = normalized(cross(along, toward));
      const Vec3d axis = side == left ? axis_left : -mirrored(axis_left);
      const double first = f == 0 ? 0.6 : 1.35, second = f == 0 ? 1.0 : 1.75;
      turn(finger_bone(side, f, 0), posture_[bone_of(side, hand)],
           rotation(axis, first * pose.curl[f]));
      turn(finger_bone(side, f, 1), posture_[finger_bone(side, f, 0)],
           rotation(axis, second * pose.curl[f]));
    }
  }

  const Skeleton& skeleton_;
  const Stance& stance_;
  Posture posture_;
};

double leg_length(const Skeleton& skeleton, Side side) {
  const Vec3d knee = skeleton.joint[bone_of(side, shin)];
  return length(knee - skeleton.joint[bone_of(side, thigh)]) +
         length(knee - skeleton.joint[bone_of(side, foot)]);
}

/// For a leg to reach its foot with a slightly bent knee.
double reachable_by(const Skeleton& skeleton, const Stance& stance, Side side, Vec3d pelvis_place) {
  const FootPose& at = stance.feet[side];
  const Vec3d hip = pelvis_place + stance.pelvis_attitude * (skeleton.joint[bone_of(side, thigh)] -
                                                             skeleton.joint[pelvis]);
  const Vec3d way = at.ankle - hip;
  const double reach = 0.99 * leg_length(skeleton, side), across2 = way.x * way.x + way.y * way.y;
  return at.ankle.z + std::sqrt(std::max(reach * reach - across2, 0.01)) + pelvis_place.z - hip.z;
}

/// The turn by a share of the way from one attitude to another.
Mat3 turned(const Mat3& a, const Mat3& b, double share) {
  const Mat3 by = transposed(a) * b;
  const Vec3d twice_sine{by(2, 1) - by(1, 2), by(0, 2) - by(2, 0), by(1, 0) - by(0, 1)};
  const double sine = 0.5 * length(twice_sine);
  const double angle = std::atan2(sine, 0.5 * (by(0, 0) + by(1, 1) + by(2, 2) - 1));
  return sine < 1e-9 ? a : a * rotation(normalized(twice_sine), share * angle);
}

FootPose stepped(const FootPose& a, const FootPose& b, double share) {
  const Vec3d way = b.ankle - a.ankle;
  FootPose out{a.ankle + way * share, turned(a.rotation, b.rotation, share),
               a.pitch_rad + (b.pitch_rad - a.pitch_rad) * share};
  out.ankle.z += std::min(0.04, 0.3 * length(way)) * std::sin(std::numbers::pi * share);
  return out;
}

FootPose flat_foot(const Skeleton& skeleton, const FloorPose& spot, Side side) {
  const double apart = sign_of(side) * 0.095 * skeleton.scale;
  const Vec3d place = spot.on_floor() + spot.facing() * Vec3d{-0.02 * skeleton.scale, apart, 0};
  return {place + Vec3d{0, 0, skeleton.joint[bone_of(side, foot)].z},
          rotation(kUp, spot.heading_rad + sign_of(side) * 0.10), 0};
}

}  // namespace

Posture posture_of(const Skeleton& skeleton, const Stance& stance, const Pose& T_world_floor) {
  return PoseSolver(skeleton, stance).pose(T_world_floor);
}

double reachable_height(const Skeleton& skeleton, const Stance& stance) {
  Vec3d place = stance.pelvis_place;
  for (const Side side : kSides)
    place.z = smooth_min(place.z, reachable_by(skeleton, stance, side, place), 0.025);
  return place.z;
}

Stance blended(const Stance& a, const Stance& b, double share) {
  Stance out;
  for (const Side side : kSides) {
    out.feet[side] = stepped(a.feet[side], b.feet[side], share);
    out.arms[side] = blended(a.arms[side], b.arms[side], share);
  }
  out.pelvis_attitude = turned(a.pelvis_attitude, b.pelvis_attitude, share);
  out.pelvis_place = a.pelvis_place + (b.pelvis_place - a.pelvis_place) * share;
  out.waist = turned(a.waist, b.waist, share), out.chest = turned(a.chest, b.chest, share);
  out.neck = turned(a.neck, b.neck, share), out.head = turned(a.head, b.head, share);
  return out;
}

Stance standing_stance(const Skeleton& skeleton, const FloorPose& spot) {
  Stance out;
  for (const Side side : kSides) {
    out.feet[side] = flat_foot(skeleton, spot, side);
    out.arms[side] = hanging_arm(0);
  }
  out.pelvis_attitude = spot.facing() * rotation(kLeft, 0.02);
  out.pelvis_place = spot.on_floor() + spot.facing() * Vec3d{skeleton.joint[pelvis].x, 0, 0};
  out.pelvis_place.z = skeleton.joint[pelvis].z;
  out.pelvis_place.z = reachable_height(skeleton, out);
  out.neck = rotation(kLeft, 0.03), out.head = rotation(kLeft, 0.03);
  return out;
}

Stance seated_stance(const Skeleton& skeleton, const FloorPose& seat, double seat_m,
                     double feet_ahead_m, double lean_rad) {
  constexpr double kHips_m = 0.125;  // the pelvis' joint over what it sits on
  FloorPose feet = seat;
  const Vec3d ahead = seat.facing() * kAhead;
  feet.place = feet.place + Vec2d{ahead.x, ahead.y} * feet_ahead_m;
  Stance out = standing_stance(skeleton, feet);
  out.pelvis_attitude = seat.facing() * rotation(kLeft, -0.6 * lean_rad);
  out.pelvis_place = seat.on_floor() - ahead * 0.04;
  out.pelvis_place.z = seat_m + kHips_m * skeleton.scale;
  out.waist = rotation(kLeft, -0.4 * lean_rad);
  out.chest = rotation(kLeft, 0.06);
  out.neck = rotation(kLeft, 0.08 + 0.5 * lean_rad), out.head = rotation(kLeft, 0.10);
  for (ArmPose& arm : out.arms)  // hands on the thighs
    arm = {{0.26, 0.16, -0.95}, {0.84, -0.06, -0.66}, -0.5, {0.15, 0.2, 0.2, 0.2, 0.25}};
  return out;
}

Stance crouching_stance(const Skeleton& skeleton, const Stance& standing, const Stance& seated) {
  Stance out = blended(standing, seated, 0.5);
  const Vec3d ahead = standing.pelvis_attitude * kAhead;
  out.pelvis_attitude = rotation(kUp, std::atan2(ahead.y, ahead.x)) * rotation(kLeft, 0.45);
  out.pelvis_place.z -= 0.02 * skeleton.scale;
  out.waist = rotation(kLeft, 0.15);
  out.neck = rotation(kLeft, -0.15);
  for (ArmPose& arm : out.arms)
    arm = {{0.5, 0.2, -0.9}, {0.95, -0.05, -0.4}, 0, {0.15, 0.2, 0.2, 0.2, 0.25}};
  return out;
}

Stance reaching_stance(const Skeleton& skeleton, const FloorPose& spot) {
  Stance out = standing_stance(skeleton, spot);
  out.pelvis_attitude = spot.facing() * rotation(kLeft, 0.75);
  out.pelvis_place = out.pelvis_place - spot.facing() * kAhead * (0.14 * skeleton.scale);
  out.pelvis_place.z = 0.60 * skeleton.scale;
  out.waist = rotation(kLeft, 0.30), out.chest = rotation(kLeft, 0.22);
  out.neck = rotation(kLeft, -0.30), out.head = rotation(kLeft, -0.2);
  for (ArmPose& arm : out.arms)
    arm = {{0.95, 0.24, -0.22}, {0.98, -0.16, -0.16}, 0, {0.2, 0.35, 0.35, 0.35, 0.35}};
  return out;
}

std::array<ArmPose, 2> holding_arms() {
  const ArmPose arm{{0.30, 0.28, -0.92}, {0.95, -0.16, -0.02}, 0, {0.2, 0.35, 0.35, 0.35, 0.35}};
  return {arm, arm};
}

}  // namespace mr::synth
