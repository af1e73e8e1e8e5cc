#include "mr/kit/srgb.h"

#include <algorithm>
#include <cmath>

namespace mr::kit {
namespace {

double curve(double srgb) {
  return srgb <= 0.04045 ? srgb / 12.92 : std::pow((srgb + 0.055) / 1.055, 2.4);
}

double inverse_curve(double linear) {
  return linear <= 0.0031308 ? linear * 12.92 : 1.055 * std::pow(linear, 1 / 2.4) - 0.055;
}

}  // namespace

float to_linear(std::uint8_t srgb) {
  static const std::array<float, 256> table = [] {
    std::array<float, 256> out{};
    for (int i = 0; i < 256; ++i) out[i] = static_cast<float>(curve(i / 255.0));
    return out;
  }();
  return table[srgb];
}

std::uint8_t to_srgb(double linear) {
  return static_cast<std::uint8_t>(std::lround(255 * inverse_curve(std::clamp(linear, 0.0, 1.0))));
}

std::array<std::uint8_t, 3> to_srgb(Vec3f linear) {
  return {to_srgb(linear.x), to_srgb(linear.y), to_srgb(linear.z)};
}

}  // namespace mr::kit
