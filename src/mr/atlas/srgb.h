#pragma once

#include <cmath>

namespace mr::atlas {

/// The transfer function of sRGB (IEC 61966-2-1) and its inverse, 0..1.
inline double to_linear(double srgb) {
  return srgb <= 0.04045 ? srgb / 12.92 : std::pow((srgb + 0.055) / 1.055, 2.4);
}
inline double to_srgb(double linear) {
  return linear <= 0.0031308 ? linear * 12.92 : 1.055 * std::pow(linear, 1 / 2.4) - 0.055;
}

}  // namespace mr::atlas
