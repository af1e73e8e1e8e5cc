#include "mr/synth/gait.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "mr/synth/bones.h"
#include "mr/synth/gesture.h"
#include "mr/synth/hash.h"
#include "mr/synth/solid.h"

namespace mr::synth {
namespace {

constexpr double kTurn = 2 * std::numbers::pi;
constexpr Vec3d kAhead{1, 0, 0}, kLeft{0, 1, 0}, kUp{0, 0, 1};

// Parts of a foot's cycle, which starts as the heel comes down.
constexpr double kRolledDown = 0.10, kMiddle = 0.27, kHeelRises = 0.38, kToeLeaves = 0.62,
                 kMostPitched = 0.68;

double part_of(double v) { return v - std::floor(v); }

// --- the way

/// A place on the floor and where ahead is.
struct Spot {
  Vec2d place;
  double heading_rad = 0;

  Mat3 facing() const { return rotation(kUp, heading_rad); }
  Vec3d on_floor() const { return {place.x, place.y, 0}; }
};

/// The ellipse, walked at an even speed.
class Way {
 public:
  explicit Way(const Walk& walk) : walk_(walk) {
    double sum = 0;
    for (int i = 0; i < kPieces; ++i) {
      length_[i] = sum;
      const Vec2d step = point((i + 1.0) / kPieces) - point(1.0 * i / kPieces);
      sum += std::hypot(step.x, step.y) + 1e-6;
    }
    length_[kPieces] = sum;
  }

  double length_m() const { return length_[kPieces]; }

  /// `period`: part of the walk's period, any number.
  Spot at(double period) const {
    const double turns = turns_at(part_of(period));
    const double angle = kTurn * turns, way = walk_.clockwise ? -1 : 1;
    const double dx = -way * walk_.radius.x * std::sin(angle),
                 dy = way * walk_.radius.y * std::cos(angle);
    const bool on_the_spot = std::hypot(dx, dy) < 1e-6;
    return {point(turns), on_the_spot ? angle + way * kTurn / 4 : std::atan2(dy, dx)};
  }

 private:
  static constexpr int kPieces = 1024;

  Vec2d point(double turns) const {
    return {walk_.center.x + walk_.radius.x * std::cos(kTurn * turns),
            walk_.center.y + walk_.radius.y * std::sin(kTurn * turns)};
  }

  double turns_at(double period) const {
    const double start = part_of(walk_.start_turns) * kPieces;
    const int piece = std::min(static_cast<int>(start), kPieces - 1);
    const double begun = length_[piece] + (start - piece) * (length_[piece + 1] - length_[piece]);
    const double walked = (walk_.clockwise ? -period : period) + begun / length_m();
    const double s = part_of(walked) * length_m();
    const auto next = std::upper_bound(length_.begin() + 1, length_.end() - 1, s);
    const auto i = next - length_.begin() - 1;
    return (static_cast<double>(i) + (s - length_[i]) / (length_[i + 1] - length_[i])) / kPieces;
  }

  const Walk& walk_;
  std::array<double, kPieces + 1> length_;  ///< from turn 0, metres
};

/// Steps of one foot in a period: at a natural cadence for the speed (step length over cadence is
/// about constant: Sekiya 1996).
int strides_of(const Walk& walk, double length_m) {
  constexpr double kWalkRatio = 0.0060;  // metres per (steps per minute)
  const double speed = length_m / walk.period_s;
  const double steps_per_s = std::sqrt(60 * speed / kWalkRatio) / 60;
  return std::max(2, static_cast<int>(std::lround(0.5 * steps_per_s * walk.period_s)));
}

// --- legs

struct FootPose {
  Vec3d ankle;
  Mat3 rotation;
  double pitch_rad = 0;  ///< toes up is positive
};

/// Pitch of a foot during its cycle for a stride of usual length.
double foot_pitch(double cycle) {
  constexpr double kStrike = 0.28, kPush = -0.62;
  if (cycle < kRolledDown) return kStrike * (1 - smooth_step(0, kRolledDown, cycle));
  if (cycle < kHeelRises) return 0;
  if (cycle < kMostPitched) return kPush * smooth_step(kHeelRises, kMostPitched, cycle);
  return kPush + (kStrike - kPush) * smooth_step(kMostPitched, 0.97, cycle);
}

class Walker {
 public:
  Walker(const Skeleton& skeleton, const Walk& walk)
      : skeleton_(skeleton), walk_(walk), way_(walk), strides_(strides_of(walk, way_.length_m())) {
    liveliness_ = std::min(1.0, way_.length_m() / strides_ / 1.0);
  }

  Posture at(double period) {
    period_ = period;
    set_feet();
    set_trunk();
    for (const Side side : kSides) set_leg(side);
    set_arms();
    for (Pose& pose : posture_) pose = walk_.T_world_room * pose;
    return posture_;
  }

  double cycle_of(Side side, double period) const {
    return period * strides_ + (side == left ? 0.0 : 0.5);
  }

 private:
  const Vec3d& joint(std::size_t bone) const { return skeleton_.joint[bone]; }
  double wave(double cycles) const { return std::sin(kTurn * cycles); }

  /// A bone turned about its joint, carried by another.
  void turn(std::size_t bone, const Pose& carrier, const Mat3& by) {
    posture_[bone] = carrier * Pose{by, joint(bone) - by * joint(bone)};
  }
  /// A bone in a known attitude with its joint in a known place.
  void put(std::size_t bone, const Mat3& attitude, Vec3d place) {
    posture_[bone] = {attitude, place - attitude * joint(bone)};
  }

  /// Where a foot stands in its stride number `stride`: the point under its ankle, while the body
  /// passes over it.
  Spot footprint(Side side, double stride) const {
    const double middle = (stride + kMiddle - (side == left ? 0.0 : 0.5)) / strides_;
    Spot spot = way_.at(middle);
    const double apart = sign_of(side) * 0.072 * skeleton_.scale;
    const Vec3d offset = spot.facing() * Vec3d{-0.02 * skeleton_.scale, apart, 0};
    spot.place = spot.place + Vec2d{offset.x, offset.y};
    spot.heading_rad += sign_of(side) * 0.10;
    return spot;
  }

  /// The foot rolls over its heel, stands, rolls over its ball, and swings on to the next print.
  FootPose foot_pose(Side side) const {
    const double cycles = cycle_of(side, period_), stride = std::floor(cycles), c = cycles - stride;
    const double swing = std::clamp((c - kToeLeaves) / (1 - kToeLeaves), 0.0, 1.0);
    const Spot from = footprint(side, stride), to = footprint(side, stride + 1);
    const double moved = smooth_step(0, 1, swing);
    const double veer = std::remainder(to.heading_rad - from.heading_rad, kTurn);
    const Mat3 facing = rotation(kUp, from.heading_rad + veer * moved);
    Vec3d base = from.on_floor() * (1 - moved) + to.on_floor() * moved;
    const double arc = std::sin(std::numbers::pi * swing);
    base.z = (0.018 + 0.022 * liveliness_) * arc * arc * skeleton_.scale;

    const double pitch = foot_pitch(c) * liveliness_;
    const Vec3d ankle = joint(bone_of(side, foot)), ball = joint(bone_of(side, toes));
    const Vec3d pivot{pitch > 0 ? -0.064 * skeleton_.scale : ball.x - ankle.x + 0.012, 0, 0};
    const Mat3 pitched = rotation(kLeft, -pitch);
    const Vec3d ankle_up{0, 0, ankle.z};
    return {base + facing * (pivot + pitched * (ankle_up - pivot)), facing * pitched, pitch};
  }

  void set_feet() {
    for (const Side side : kSides) {
      feet_[side] = foot_pose(side);
      put(bone_of(side, foot), feet_[side].rotation, feet_[side].ankle);
      turn(bone_of(side, toes), posture_[bone_of(side, foot)],
           rotation(kLeft, std::min(feet_[side].pitch_rad, 0.0)));
    }
  }

  double leg_length(Side side) const {
    const Vec3d knee = joint(bone_of(side, shin));
    return length(knee - joint(bone_of(side, thigh))) + length(knee - joint(bone_of(side, foot)));
  }

  /// How high the pelvis may be for a leg to reach its foot with a slightly bent knee.
  double reachable_height(Side side, const Mat3& attitude, Vec3d pelvis_place) const {
    const Vec3d hip = pelvis_place + attitude * (joint(bone_of(side, thigh)) - joint(pelvis));
    const Vec3d way = feet_[side].ankle - hip;
    const double reach = 0.99 * leg_length(side), across2 = way.x * way.x + way.y * way.y;
    return feet_[side].ankle.z + std::sqrt(std::max(reach * reach - across2, 0.01)) +
           pelvis_place.z - hip.z;
  }

  void set_trunk() {
    // The body is over the left foot in the middle of the left foot's stance.
    const double c = cycle_of(left, period_) - kMiddle, lively = liveliness_;
    const Spot spot = way_.at(period_);
    const Mat3 facing = spot.facing();
    const Mat3 attitude = facing * rotation(kUp, 0.09 * lively * wave(c - 0.06)) *
                          rotation(kAhead, 0.045 * lively * wave(c + 0.22)) * rotation(kLeft, 0.03);
    const double sway = 0.022 * skeleton_.scale * wave(c + 0.25);
    Vec3d place = spot.on_floor() + facing * Vec3d{joint(pelvis).x, sway, 0};
    place.z = joint(pelvis).z;
    for (const Side side : kSides)
      place.z = smooth_min(place.z, reachable_height(side, attitude, place), 0.025);
    put(pelvis, attitude, place);

    const double look = 0.34 * wave(period_ * 2 + unit(mix(walk_.seed, 7))) +
                        0.24 * wave(period_ * 3 + unit(mix(walk_.seed, 8)));
    const double nod = 0.06 + 0.07 * wave(period_ * 3 + unit(mix(walk_.seed, 9)));
    turn(waist, posture_[pelvis],
         rotation(kUp, -0.07 * lively * wave(c - 0.06)) *
             rotation(kAhead, -0.03 * lively * wave(c + 0.22)) * rotation(kLeft, 0.02));
    turn(chest, posture_[waist],
         rotation(kUp, -0.09 * lively * wave(c - 0.06)) *
             rotation(kAhead, -0.02 * lively * wave(c + 0.22)));
    const Mat3 half_look = rotation(kUp, 0.4 * look + 0.035 * lively * wave(c - 0.06));
    turn(neck, posture_[chest], half_look * rotation(kLeft, 0.02 + 0.4 * nod));
    turn(head, posture_[neck], rotation(kUp, 0.6 * look) * rotation(kLeft, 0.6 * nod));
  }

  /// Bends the knee so that the foot is where it should be.
  void set_leg(Side side) {
    const std::size_t upper = bone_of(side, thigh), lower = bone_of(side, shin);
    const Vec3d hip = posture_[pelvis] * joint(upper), ankle = feet_[side].ankle;
    const Vec3d rest_upper = joint(lower) - joint(upper),
                rest_lower = joint(bone_of(side, foot)) - joint(lower);
    const double a = length(rest_upper), b = length(rest_lower), far = length(ankle - hip);
    const double reach = std::min(far, 0.9999 * (a + b));
    const double cosine = (a * a + reach * reach - b * b) / (2 * a * reach);
    const Vec3d down = normalized(ankle - hip);
    const Vec3d toes_ahead = feet_[side].rotation.column(0) + posture_[pelvis].rotation.column(0);
    const Vec3d ahead = normalized(toes_ahead - down * dot(toes_ahead, down));
    const double bend = std::acos(std::clamp(cosine, -1.0, 1.0));
    const Vec3d knee = hip + down * (a * std::cos(bend)) + ahead * (a * std::sin(bend));
    const auto attitude = [&](Vec3d rest, Vec3d now) {
      return frame_along(now, ahead) * transposed(frame_along(rest, kAhead));
    };
    put(upper, attitude(rest_upper, knee - hip), hip);
    put(lower, attitude(rest_lower, ankle - knee), knee);
  }

  void set_arms() {
    const double swing = 0.42 * liveliness_ * wave(cycle_of(right, period_) + 0.19);
    const auto arms = arm_poses(walk_.seed, walk_.period_s, part_of(period_), swing);
    for (const Side side : kSides) set_arm(side, arms[side]);
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
  const Walk& walk_;
  const Way way_;
  const int strides_;
  double liveliness_ = 1;  ///< less than 1 for short strides
  double period_ = 0;
  std::array<FootPose, 2> feet_;
  Posture posture_;
};

}  // namespace

Posture posture_at(const Skeleton& skeleton, const Walk& walk, double time_s) {
  return Walker(skeleton, walk).at(part_of(time_s / walk.period_s));
}

bool foot_is_flat(const Walk& walk, int side, double time_s) {
  const int strides = strides_of(walk, Way(walk).length_m());
  const double c = part_of(part_of(time_s / walk.period_s) * strides + 0.5 * side);
  return c > kRolledDown && c < kHeelRises;
}

}  // namespace mr::synth
