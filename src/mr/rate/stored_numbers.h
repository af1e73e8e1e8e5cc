#pragma once

#include <cmath>
#include <stdexcept>

/// Numbers of the files of sweeps and models.
namespace mr::rate {

/// So many significant digits.
inline double rounded_to(double v, int digits) {
  if (v == 0 || !std::isfinite(v)) return 0;
  const double unit = std::pow(10.0, std::floor(std::log10(std::abs(v))) - (digits - 1));
  return std::round(v / unit) * unit;
}

/// A whole number that was read as a number of any kind. Throws std::runtime_error where it is
/// none, or not within the limits.
inline int whole_number(double v, int least, int most) {
  if (!(v >= least && v <= most && v == std::floor(v)))
    throw std::runtime_error("an impossible number");
  return static_cast<int>(v);
}

}  // namespace mr::rate
