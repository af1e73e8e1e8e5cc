#pragma once

#include <array>
#include <cstdint>

#include "mr/synth/skeleton.h"

/// Names of a skeleton's bones.
namespace mr::synth {

enum Side : std::uint8_t { left, right };

/// Of the coordinate that points left.
constexpr double sign_of(Side side) { return side == left ? 1 : -1; }
inline constexpr std::array<Side, 2> kSides{left, right};

/// Bones on the middle line; each side's bones follow.
enum Bone : std::uint8_t { pelvis, waist, chest, neck, head, middle_bones };

/// Bones that come in pairs. An upper arm and a forearm are two bones each, so that a twist
/// spreads along them.
enum SideBone : std::uint8_t {
  clavicle,
  shoulder,   ///< upper half of the upper arm: follows its direction, not its twist
  upper_arm,  ///< lower half
  forearm,    ///< upper half
  wrist,      ///< lower half: half of the hand's twist
  hand,
  fingers,  ///< thumb to little finger, two bones each: 2 * finger + joint
  thigh = fingers + 10,
  shin,
  foot,
  toes,
  side_bones
};

inline constexpr int kFingers = 5;
static_assert(kBones == middle_bones + 2 * side_bones);

constexpr std::size_t bone_of(Side side, int bone) {
  return static_cast<std::size_t>(middle_bones +
                                  static_cast<int>(side) * static_cast<int>(side_bones) + bone);
}
constexpr std::size_t finger_bone(Side side, int finger, int joint) {
  return bone_of(side, fingers + 2 * finger + joint);
}

}  // namespace mr::synth
