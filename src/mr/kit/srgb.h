#pragma once

#include <array>
#include <cstdint>

#include "mr/core/vec.h"

namespace mr::kit {

/// sRGB's curve: linear 0..1 of each byte, and back to the nearest one.
float to_linear(std::uint8_t srgb);
std::uint8_t to_srgb(double linear);
std::array<std::uint8_t, 3> to_srgb(Vec3f linear);

}  // namespace mr::kit
