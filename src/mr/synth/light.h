#pragma once

#include <span>
#include <vector>

#include "mr/synth/furniture.h"

namespace mr::synth {

/// Fills room.light with the diffuse irradiance at every vertex, sampled at `places` with `normals`
/// ([V], world frame): daylight, lamps and ambient light, with soft shadows. Needs room.rays.
void bake_light(Room& room, std::span<const Vec3f> places, std::span<const Vec3f> normals,
                std::span<const Light> lights);

/// Fills room.probes: a grid of light probes (ambient cubes) in free space. Needs room.rays.
void bake_probes(Room& room, Vec3d room_m, std::span<const Light> lights);

/// The irradiance of a surface somewhere in the room, interpolated from the probes.
Vec3f probed_light(const Room& room, Vec3f p_world, Vec3f normal_world);

}  // namespace mr::synth
