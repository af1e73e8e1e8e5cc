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

/// A primitive of the body's implicit surface, attached to a bone.
struct BodyPrimitive {
  Solid solid;
  std::uint8_t bone;
  double blend_m;  ///< blend radius (smooth minimum) with the primitives before it
};
using BodyPrimitives = std::vector<BodyPrimitive>;

/// A body 1.75 m tall in the skeleton's rest pose, as implicit surfaces from which skin and clothes
/// are made.
struct Figure {
  Physique physique;
  Skeleton skeleton;
  BodyPrimitives trunk, neck, skull;  ///< the skull without eye sockets
  std::array<BodyPrimitives, 2> arms, hands, legs, feet;
  std::array<BodyPrimitives, 2> thighs;  ///< the legs' upper parts only, for skirts
};

Figure make_figure(const Physique& physique);

/// Signed distance to the skin of a group of primitives.
double distance(std::span<const BodyPrimitive> primitives, Vec3d p);

/// Signed distance to the skin of head and neck, with eyes, ears, nose and mouth.
double head_distance(const Figure& figure, Vec3d p);

/// Signed distance to the skin of a hand, whose fingers are not blended with each other.
double hand_distance(const Figure& figure, int side, Vec3d p);

/// Skinning weights of a vertex: the bones that move it and by how much.
struct SkinWeights {
  std::array<std::uint8_t, 4> bones{};
  std::array<float, 4> weights{};  ///< sum to 1
};

/// Skinning weights of a point by its distances to the bones' primitives in the given groups. A
/// larger `softness` widens the transition from bone to bone.
SkinWeights skin_weights(std::span<const BodyPrimitives* const> groups, Vec3d p, double softness);

}  // namespace mr::synth
