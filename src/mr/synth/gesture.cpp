#include "mr/synth/gesture.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "mr/synth/bones.h"
#include "mr/synth/hash.h"
#include "mr/synth/solid.h"

namespace mr::synth {
namespace {

enum class Gesture : std::uint8_t { wave, point, talk, scratch, grasp, none };
constexpr int kGestures = 5;
constexpr double kSlot_s = 3.4;  // about how long a gesture lasts

double wobble(double time_s, double hertz) {
  return std::sin(2 * std::numbers::pi * hertz * time_s);
}

/// What an arm does in a gesture, some seconds after its start.
ArmPose held(Gesture gesture, double time_s, double phase) {
  const double fast = wobble(time_s, 1.7), slow = wobble(time_s + phase, 0.8);
  const double grip = 0.5 - 0.5 * std::cos(2 * std::numbers::pi * 0.9 * time_s);
  switch (gesture) {
    case Gesture::wave:
      return {{0.36, 0.78, -0.16}, {0.25, 0.18 + 0.42 * fast, 1}, 0, {0.1, 0.04, 0.04, 0.06, 0.1}};
    case Gesture::point:
      return {{0.80, 0.22, -0.38}, {1, 0.02, 0.02 + 0.06 * slow}, 0, {0.7, 0.02, 0.9, 0.95, 0.95}};
    case Gesture::talk:
      return {{0.28, 0.32, -1},
              {0.95, -0.18 + 0.28 * slow, 0.22 + 0.30 * wobble(time_s + phase, 1.1)},
              0.5 + 0.35 * slow,
              {0.1, 0.15 + 0.1 * fast, 0.2, 0.28, 0.34}};
    case Gesture::scratch:
      return {
          {0.50, 0.72, 0.04}, {-0.26, -0.62, 0.78 + 0.05 * fast}, 0, {0.2, 0.4, 0.42, 0.42, 0.4}};
    case Gesture::grasp:
      return {{0.36, 0.30, -0.9},
              {0.95, 0.05, 0.42},
              0.3,
              {0.9 * grip, 0.95 * grip, 0.95 * grip, 0.95 * grip, 0.95 * grip}};
    case Gesture::none:
      break;
  }
  return hanging_arm(0);
}

}  // namespace

ArmPose hanging_arm(double swing) {
  const double bend = 0.24 + 0.25 * std::max(swing, 0.0) + 0.1 * swing;
  return {{std::sin(swing), 0.17, -std::cos(swing)},
          {std::sin(swing + bend), 0.10, -std::cos(swing + bend)},
          0,
          {0.2, 0.22, 0.28, 0.32, 0.36}};
}

ArmPose blended(const ArmPose& a, const ArmPose& b, double share) {
  ArmPose out;
  const double from = (1 - share) * (1 - share), to = share * share, over = 2 * share * (1 - share);
  out.upper = normalized(normalized(a.upper) * (1 - share) + normalized(b.upper) * share);
  out.fore = normalized(normalized(a.fore) * from + Vec3d{1.1, 0.25, 0.1} * over +
                        normalized(b.fore) * to);
  out.twist_rad = a.twist_rad * (1 - share) + b.twist_rad * share;
  for (int i = 0; i < 5; ++i) out.curl[i] = a.curl[i] * (1 - share) + b.curl[i] * share;
  return out;
}

std::array<ArmPose, 2> arm_poses(std::uint64_t seed, double period_s, double period,
                                 double swing_rad) {
  std::array<ArmPose, 2> arms{hanging_arm(swing_rad), hanging_arm(-swing_rad)};
  const int slots = std::max(1, static_cast<int>(std::lround(period_s / kSlot_s)));
  const double at = std::clamp(period, 0.0, 1.0) * slots;
  const int slot = std::min(static_cast<int>(at), slots - 1);
  const double within = at - slot, time_s = within * period_s / slots;
  // A person's first gesture follows from the seed, the others take turns.
  const auto gesture =
      static_cast<Gesture>((mix(seed, 1) + 2 * static_cast<unsigned>(slot)) % kGestures);
  const double share = smooth_step(0.02, 0.30, within) * smooth_step(0.98, 0.72, within);
  for (const Side side : kSides) {
    const bool joins = gesture == Gesture::talk || (mix(seed, 40 + slot) & 1) == side;
    if (joins)
      arms[side] = blended(arms[side], held(gesture, time_s, side == left ? 0 : 0.35), share);
  }
  return arms;
}

}  // namespace mr::synth
