#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "mr/synth/figure.h"
#include "mr/synth/polygonize.h"
#include "mr/synth/texture.h"

namespace mr::synth {

enum class Hair : std::uint8_t { shorn, parted, bob, bun, tail, long_hair, kinds };
enum class Top : std::uint8_t { tee, sweater, shirt, hoodie, coat, kinds };
enum class Bottom : std::uint8_t { jeans, slacks, skirt, kinds };

/// A person's body shape, hair and clothes, all drawn from a seed.
struct Appearance {
  Physique physique;
  double stature_m = 1.75;
  Hair hair = Hair::shorn;
  Top top = Top::tee;
  Bottom bottom = Bottom::jeans;
  bool beard = false, long_sleeves = false;
  Material skin, face, hairs, cloth, print, legwear, shoe, sole, coat;
};

Appearance make_appearance(std::uint64_t seed);

/// Texture coordinates by cylindrical mapping: around an elliptic cylinder and along it.
struct CylinderMapping {
  Pose T_cylinder_person;   ///< z up along the tube, x to the front; the seam is at the back
  double depth_m, width_m;  ///< half axes along x and y
  double height_m;          ///< of the sheet, from z = 0
  Material material;

  /// Circumference: the period of the coordinate around the cylinder.
  double around_m() const;
  /// The texture coordinate of a point: x from the seam to the right, seen from outside; y up.
  Vec2f place(Vec3d p_person) const;
};

/// One closed surface of a person (skin, hair or a garment), in rest pose and 1.75 m tall.
struct BodyPart {
  DistanceFunction distance;
  Grid grid;
  std::vector<CylinderMapping> mappings;
  std::function<int(Vec3d)> mapping_of;           ///< index of the mapping that textures a point
  std::vector<const BodyPrimitives*> carried_by;  ///< whose bones move it
  double softness = 1;                            ///< width of the transition from bone to bone
};

/// All visible surfaces of a person. The parts refer to `figure` and `appearance`.
std::vector<BodyPart> body_parts(const Figure& figure, const Appearance& appearance);

}  // namespace mr::synth
