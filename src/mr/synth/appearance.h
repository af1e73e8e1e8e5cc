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

/// What somebody looks like: everything that follows from a seed.
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

/// How a part's vertices get their place on a sheet: around an elliptic tube and along it.
struct CylinderMapping {
  Pose T_cylinder_person;   ///< z up along the tube, x to the front; the seam is at the back
  double depth_m, width_m;  ///< half axes along x and y
  double height_m;          ///< of the sheet, from z = 0
  Material material;

  /// Its circumference, by which places beyond the seam differ.
  double around_m() const;
  /// x from the seam to the right, seen from outside; y up.
  Vec2f place(Vec3d p_person) const;
};

/// One closed piece of a person: skin, hair or a garment, standing at rest 1.75 m tall.
struct BodyPart {
  DistanceFunction distance;
  Grid grid;
  std::vector<CylinderMapping> mappings;
  std::function<int(Vec3d)> mapping_of;           ///< which of them paints a place
  std::vector<const BodyPrimitives*> carried_by;  ///< whose bones move it
  double softness = 1;                            ///< of the change from bone to bone
};

/// All that one sees of somebody. The parts refer to `figure` and `appearance`.
std::vector<BodyPart> body_parts(const Figure& figure, const Appearance& appearance);

}  // namespace mr::synth
