#pragma once

#include <span>
#include <vector>

#include "mr/synth/furniture.h"

namespace mr::synth {

/// Fills room.light: daylight, lamps and light from all around, with soft shadows, for vertices
/// that gather it at `places` along `normals` ([V], world frame). Needs room.rays.
void bake_light(Room& room, std::span<const Vec3f> places, std::span<const Vec3f> normals,
                std::span<const Light> lights);

}  // namespace mr::synth
