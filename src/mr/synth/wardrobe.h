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
struct Look {
  Physique physique;
  double stature_m = 1.75;
  Hair hair = Hair::shorn;
  Top top = Top::tee;
  Bottom bottom = Bottom::jeans;
  bool beard = false, long_sleeves = false;
  Material skin, face, hairs, cloth, print, legwear, shoe, sole, coat;
};

Look look_of(std::uint64_t seed);

/// How a part's vertices get their place on a sheet: around an elliptic tube and along it.
struct Wrap {
  Pose T_wrap_person;       ///< z up along the tube, x to the front; the seam is at the back
  double depth_m, width_m;  ///< half axes along x and y
  double height_m;          ///< of the sheet, from z = 0
  Material material;

  /// Its circumference, by which places beyond the seam differ.
  double around_m() const;
  /// x from the seam to the right, seen from outside; y up.
  Vec2f place(Vec3d p_person) const;
};

/// One closed piece of a person: skin, hair or a garment, standing at rest 1.75 m tall.
struct Part {
  DistanceFunction distance;
  Grid grid;
  std::vector<Wrap> wraps;
  std::function<int(Vec3d)> wrap_of;       ///< which of them paints a place
  std::vector<const Fleshes*> carried_by;  ///< whose bones move it
  double softness = 1;                     ///< of the change from bone to bone
};

/// All that one sees of somebody. The parts refer to `figure` and `look`.
std::vector<Part> parts_of(const Figure& figure, const Look& look);

}  // namespace mr::synth
