#pragma once

#include <span>
#include <vector>

#include "mr/synth/furniture.h"

namespace mr::synth {

/// Fills room.light: daylight, lamps and light from all around, with soft shadows, for vertices
/// that gather it at `places` along `normals` ([V], world frame). Needs room.rays.
void bake_light(Room& room, std::span<const Vec3f> places, std::span<const Vec3f> normals,
                std::span<const Light> lights);

/// Fills room.probes with the light in the free room. Needs room.rays.
void bake_probes(Room& room, Vec3d room_m, std::span<const Light> lights);

/// The light that falls on a surface somewhere in the room, from its probes.
Vec3f probed_light(const Room& room, Vec3f p_world, Vec3f normal_world);

}  // namespace mr::synth
