#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "mr/core/mesh.h"
#include "mr/core/pose.h"
#include "mr/synth/skeleton.h"
#include "mr/synth/texture.h"

namespace mr::synth {

/// A clothed person as a skinned mesh over a skeleton. Person frame: metres, x ahead,
/// y left, z up, feet on z = 0.
struct Body {
  Mesh rest;                            ///< arms a little away from the sides
  std::vector<std::uint16_t> material;  ///< [T] index into materials
  std::vector<std::uint32_t> surface;   ///< [T] triangles of one number make one smooth sheet
  std::vector<Vec2f> surface_m;         ///< [V] place on that sheet, as in Room
  std::vector<std::uint32_t> place;  ///< [V] the lowest vertex at the same place: sheets meet there
  std::vector<Material> materials;   ///< skin, hair, shirt, trousers, shoes, ...
  std::vector<std::array<std::uint8_t, 4>> bones;  ///< [V] which bones move a vertex
  std::vector<std::array<float, 4>> weights;       ///< [V] by how much; they sum to 1
  std::vector<std::uint32_t> parts;  ///< first triangles of the closed pieces, and their end
  Skeleton skeleton;
};

/// Creates a person; sex, build, hair, clothes and patterns are drawn from the seed. Takes about a
/// second of one core. Runs in the caller's arena; the same on any number of threads.
Body make_body(std::uint64_t seed);

/// A person's walk: around an ellipse on the floor, gesturing, with period `period_s`.
struct Walk {
  Pose T_world_room;       ///< floor frame → world, z up, floor at z = 0
  Vec2d center, radius;    ///< metres, floor frame
  double start_turns = 0;  ///< where on the ellipse at time 0, 0..1
  bool clockwise = false;
  double period_s = 10;
  std::uint64_t seed = 0;  ///< gestures and gait
};

/// World positions [V] of the body's vertices at a time, by dual quaternion skinning. Periodic and
/// continuous; feet do not slide visibly; the same on every machine.
std::vector<Vec3f> pose_body(const Body& body, const Walk& walk, double time_s);

/// The same in any posture.
std::vector<Vec3f> pose_body(const Body& body, const Posture& posture);

/// Unit normals [V] of a posed body; smooth across the borders of sheets.
std::vector<Vec3f> body_normals(const Body& body, const std::vector<Vec3f>& positions);

}  // namespace mr::synth
