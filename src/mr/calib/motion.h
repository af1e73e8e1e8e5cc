#pragma once

#include <cstddef>
#include <vector>

#include "mr/core/vec.h"

namespace mr::calib {

/// Lever arm by which a rotation (rad) is compared with a translation.
inline constexpr double kArm_m = 2;

/// A small rigid motion (twist) of a part about the centre of its sensors.
struct Motion {
  Vec3d turn, shift;  ///< both in metres: turn · kArm_m

  friend Motion operator+(const Motion& a, const Motion& b) {
    return {a.turn + b.turn, a.shift + b.shift};
  }
  friend Motion operator*(const Motion& a, double s) { return {a.turn * s, a.shift * s}; }
};
using Motions = std::vector<Motion>;

inline double dot(const Motions& a, const Motions& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i)
    sum += mr::dot(a[i].turn, b[i].turn) + mr::dot(a[i].shift, b[i].shift);
  return sum;
}

}  // namespace mr::calib
