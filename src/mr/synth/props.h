#pragma once

#include "mr/synth/builder.h"

namespace mr::synth {

/// A thing that moves as a whole: its surfaces without light, in a frame of its own with z up.
struct Prop {
  Mesh rest;
  std::vector<Vec3f> normals;           ///< [V]
  std::vector<std::uint16_t> material;  ///< [T] index into materials
  std::vector<std::uint32_t> surface;   ///< [T] as in Room
  std::vector<Vec2f> surface_m;         ///< [V] likewise
  std::vector<Material> materials;
};

inline constexpr double kSeat_m = 0.475;       ///< height of a chair's seat
inline constexpr double kBoxHalf_m = 0.19;     ///< half the side of a box
inline constexpr double kDoorAngle_deg = 85;   ///< how far a door opens
inline constexpr Vec2d kDoorway_m{0.9, 2.02};  ///< its width and height

/// Faces -y.
Prop chair_prop(std::uint32_t seat_color);
/// A carton that two hands can carry.
Prop box_prop();
/// A large screen on a foot; faces -y. Its film plays with the material's phase.
Prop screen_prop();
/// A door's leaf: hinges at the origin, closed along x, its inner side towards -y.
Prop door_leaf_prop();

}  // namespace mr::synth
