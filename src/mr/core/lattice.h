#pragma once

#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "mr/core/range.h"
#include "mr/core/vec.h"

namespace mr {

/// The scene's grid of representable vertex positions (docs/conventions.md, The lattice): a cube of
/// 2^20 steps of 2^step_exp metres along each axis, centred on `origin`: 1,024 m at 2^-10. A
/// position is exact in float up to 2^24 steps from the world's origin (16 km at 2^-10); coding it
/// again then changes nothing. Farther away positions are rounded to float.
struct Lattice {
  static constexpr int kBits = 20;                    ///< of a coordinate, unsigned
  static constexpr std::int32_t kCells = 1 << kBits;  ///< lattice points along an axis

  Vec3d origin;        ///< metres, a multiple of the step; the middle of the covered cube
  int step_exp = -10;  ///< -9, -10 or -11; for point clouds also -7 and -8

  static constexpr Range kStepExp{-11, -7}, kMeshStepExp{-11, -9}, kOrigin_m{-1e5, 1e5};
  /// The invalid fields, one line each; empty: the lattice is valid.
  std::vector<std::string> problems() const;

  friend bool operator==(const Lattice&, const Lattice&) = default;

  double step_m() const { return std::ldexp(1.0, step_exp); }
  /// The corner with the smallest coordinates, where integer 0 lies.
  Vec3d low_corner() const {
    const double half = step_m() * (kCells / 2);
    return origin - Vec3d{half, half, half};
  }

  /// Nearest lattice point as integers; may lie outside [0, kCells) for points outside the cube.
  Vec3i quantize(Vec3f p) const {
    const Vec3d q = (vec_cast<double>(p) - low_corner()) / step_m();
    const auto round = [](double v) {
      return static_cast<std::int32_t>(std::floor(std::clamp(v, -1e9, 1e9) + 0.5));
    };
    return {round(q.x), round(q.y), round(q.z)};
  }
  /// Position of a lattice point, world frame, metres.
  Vec3f position(Vec3i q) const {
    return vec_cast<float>(low_corner() + vec_cast<double>(q) * step_m());
  }
  static bool contains(Vec3i q) {
    return q.x >= 0 && q.y >= 0 && q.z >= 0 && q.x < kCells && q.y < kCells && q.z < kCells;
  }
  /// The position of the lattice point nearest to `p`.
  Vec3f snap(Vec3f p) const { return position(quantize(p)); }
};

}  // namespace mr
