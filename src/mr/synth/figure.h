#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "mr/synth/skeleton.h"
#include "mr/synth/solid.h"

namespace mr::synth {

/// What differs between naked bodies of one stature.
struct Physique {
  bool woman = false;
  double bulk = 1;    ///< thickness of trunk and limbs, as a factor
  double belly = 0;   ///< metres that the belly stands out
  double nose_m = 0;  ///< added to the nose's length
  double jaw = 1;     ///< width of the jaw, as a factor
};

/// A piece of the body that a bone carries.
struct BodyPrimitive {
  Solid solid;
  std::uint8_t bone;
  double blend_m;  ///< how roundly it joins the pieces before it
};
using BodyPrimitives = std::vector<BodyPrimitive>;

/// A body 1.75 m tall, standing at rest as its skeleton: what skin and clothes are shaped after.
struct Figure {
  Physique physique;
  Skeleton skeleton;
  BodyPrimitives trunk, neck, skull;  ///< the face's pits (eyes) are not in the skull
  std::array<BodyPrimitives, 2> arms, hands, legs, feet;
  std::array<BodyPrimitives, 2> thighs;  ///< the legs' upper parts only: what skirts follow
};

Figure make_figure(const Physique& physique);

/// Distance to the skin of a group of pieces.
double distance(std::span<const BodyPrimitive> primitives, Vec3d p);

/// Distance to the skin of head and neck: with eyes, ears, nose and mouth.
double head_distance(const Figure& figure, Vec3d p);

/// Distance to the skin of a hand: its fingers do not melt into each other.
double hand_distance(const Figure& figure, int side, Vec3d p);

/// Which bones carry a point, and how much each.
struct SkinWeights {
  std::array<std::uint8_t, 4> bones{};
  std::array<float, 4> weights{};  ///< sum to 1
};

/// Shares a point among the bones of the given groups by its distances to their primitives.
/// `softness` widens the change from bone to bone.
SkinWeights skin_weights(std::span<const BodyPrimitives* const> groups, Vec3d p, double softness);

}  // namespace mr::synth
