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

// Parts of a foot's cycle, which starts as the heel comes down.
constexpr double kRolledDown = 0.10, kMiddle = 0.27, kHeelRises = 0.38, kToeLeaves = 0.62,
                 kMostPitched = 0.68;

double part_of(double v) { return v - std::floor(v); }

// --- the way

/// The ellipse, walked at an even speed.
class Ellipse final : public WalkPath {
 public:
  explicit Ellipse(const Walk& walk) : walk_(walk) {
    double sum = 0;
    for (int i = 0; i < kPieces; ++i) {
      length_[i] = sum;
      const Vec2d step = point((i + 1.0) / kPieces) - point(1.0 * i / kPieces);
      sum += std::hypot(step.x, step.y) + 1e-6;
    }
    length_[kPieces] = sum;
  }

  double length_m() const override { return length_[kPieces]; }

  FloorPose at(double period) const override {
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

/// Pitch of a foot during its cycle for a stride of usual length.
double foot_pitch(double cycle) {
  constexpr double kStrike = 0.28, kPush = -0.62;
  if (cycle < kRolledDown) return kStrike * (1 - smooth_step(0, kRolledDown, cycle));
  if (cycle < kHeelRises) return 0;
  if (cycle < kMostPitched) return kPush * smooth_step(kHeelRises, kMostPitched, cycle);
  return kPush + (kStrike - kPush) * smooth_step(kMostPitched, 0.97, cycle);
}

/// The stance of someone who walks along a way.
class GaitGenerator {
 public:
  GaitGenerator(const Skeleton& skeleton, const WalkPath& way, int strides, std::uint64_t seed)
      : skeleton_(skeleton), path_(way), strides_(strides), seed_(seed) {
    liveliness_ = std::min(1.0, path_.length_m() / strides_ / 1.0);
  }

  /// `period`: part of the way. All but the arms.
  Stance at(double period) {
    period_ = period;
    for (const Side side : kSides) stance_.feet[side] = foot_pose(side);
    set_trunk();
    return stance_;
  }

  /// How far the left arm swings ahead.
  double arm_swing() const { return 0.42 * liveliness_ * wave(cycle_of(right, period_) + 0.19); }

 private:
  double cycle_of(Side side, double period) const {
    return period * strides_ + (side == left ? 0.0 : 0.5);
  }

  const Vec3d& joint(std::size_t bone) const { return skeleton_.joint[bone]; }
  double wave(double cycles) const { return std::sin(kTurn * cycles); }

  /// Where a foot stands in its stride number `stride`: the point under its ankle, while the body
  /// passes over it.
  FloorPose footprint(Side side, double stride) const {
    const double middle = (stride + kMiddle - (side == left ? 0.0 : 0.5)) / strides_;
    FloorPose spot = path_.at(middle);
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
    const FloorPose from = footprint(side, stride), to = footprint(side, stride + 1);
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

  void set_trunk() {
    // The body is over the left foot in the middle of the left foot's stance.
    const double c = cycle_of(left, period_) - kMiddle, lively = liveliness_;
    const FloorPose spot = path_.at(period_);
    const Mat3 facing = spot.facing();
    const Mat3 attitude = facing * rotation(kUp, 0.09 * lively * wave(c - 0.06)) *
                          rotation(kAhead, 0.045 * lively * wave(c + 0.22)) * rotation(kLeft, 0.03);
    const double sway = 0.022 * skeleton_.scale * wave(c + 0.25);
    Vec3d place = spot.on_floor() + facing * Vec3d{joint(pelvis).x, sway, 0};
    place.z = joint(pelvis).z;
    stance_.pelvis_attitude = attitude, stance_.pelvis_place = place;
    stance_.pelvis_place.z = reachable_height(skeleton_, stance_);

    const double look = 0.34 * wave(period_ * 2 + unit(mix(seed_, 7))) +
                        0.24 * wave(period_ * 3 + unit(mix(seed_, 8)));
    const double nod = 0.06 + 0.07 * wave(period_ * 3 + unit(mix(seed_, 9)));
    stance_.waist = rotation(kUp, -0.07 * lively * wave(c - 0.06)) *
                    rotation(kAhead, -0.03 * lively * wave(c + 0.22)) * rotation(kLeft, 0.02);
    stance_.chest = rotation(kUp, -0.09 * lively * wave(c - 0.06)) *
                    rotation(kAhead, -0.02 * lively * wave(c + 0.22));
    const Mat3 half_look = rotation(kUp, 0.4 * look + 0.035 * lively * wave(c - 0.06));
    stance_.neck = half_look * rotation(kLeft, 0.02 + 0.4 * nod);
    stance_.head = rotation(kUp, 0.6 * look) * rotation(kLeft, 0.6 * nod);
  }

  const Skeleton& skeleton_;
  const WalkPath& path_;
  const int strides_;
  const std::uint64_t seed_;
  double liveliness_ = 1;  ///< less than 1 for short strides
  double period_ = 0;
  Stance stance_;
};

}  // namespace

Posture posture_at(const Skeleton& skeleton, const Walk& walk, double time_s) {
  const Ellipse way(walk);
  const double period = part_of(time_s / walk.period_s);
  GaitGenerator walker(skeleton, way, strides_of(walk, way.length_m()), walk.seed);
  Stance stance = walker.at(period);
  stance.arms = arm_poses(walk.seed, walk.period_s, part_of(period), walker.arm_swing());
  return posture_of(skeleton, stance, walk.T_world_room);
}

Stance walking_stance(const Skeleton& skeleton, const WalkPath& way, double part,
                      std::uint64_t seed) {
  constexpr double kStride_m = 1.2;  // two steps
  const int strides = std::max(1, static_cast<int>(std::lround(way.length_m() / kStride_m)));
  GaitGenerator walker(skeleton, way, strides, seed);
  Stance stance = walker.at(part);
  stance.arms = {hanging_arm(walker.arm_swing()), hanging_arm(-walker.arm_swing())};
  return stance;
}

bool foot_is_flat(const Walk& walk, int side, double time_s) {
  const int strides = strides_of(walk, Ellipse(walk).length_m());
  const double c = part_of(part_of(time_s / walk.period_s) * strides + 0.5 * side);
  return c > kRolledDown && c < kHeelRises;
}

}  // namespace mr::synth
