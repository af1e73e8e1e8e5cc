#pragma once

#include <array>
#include <span>

#include "mr/core/result.h"
#include "mr/core/vec.h"

namespace mr {

/// 3x3 matrix, row-major.
struct Mat3 {
  std::array<double, 9> m{1, 0, 0, 0, 1, 0, 0, 0, 1};

  double operator()(int row, int column) const { return m[row * 3 + column]; }
  double& operator()(int row, int column) { return m[row * 3 + column]; }
  Vec3d row(int r) const { return {m[r * 3], m[r * 3 + 1], m[r * 3 + 2]}; }
  Vec3d column(int c) const { return {m[c], m[3 + c], m[6 + c]}; }

  friend Vec3d operator*(const Mat3& a, Vec3d v) {
    return {dot(a.row(0), v), dot(a.row(1), v), dot(a.row(2), v)};
  }
  friend Mat3 operator*(const Mat3& a, const Mat3& b);
  friend bool operator==(const Mat3&, const Mat3&) = default;
};

Mat3 transposed(const Mat3& a);
double determinant(const Mat3& a);

/// A rigid transform. `T_a_b` maps points from frame b to frame a: p_a = T_a_b * p_b.
struct Pose {
  Mat3 rotation;
  Vec3d translation;  ///< metres

  Pose inverse() const;
  friend Vec3d operator*(const Pose& T, Vec3d p) { return T.rotation * p + T.translation; }
  friend Pose operator*(const Pose& a, const Pose& b);
  friend bool operator==(const Pose&, const Pose&) = default;

  /// 4x4 row-major, last row 0 0 0 1.
  std::array<double, 16> matrix() const;
};

/// Whether a pose is rigid to 1e-3, not mirrored, and at most 1e8 m away.
bool is_rigid(const Pose& T);

/// Reads a 4x4 row-major matrix. A rotation that is off by at most `tolerance` (largest entry of
/// RᵀR - I, so 0.02 accepts a 1 % scale) is replaced by the nearest rotation (polar
/// decomposition, Higham 1986); others, mirrored ones and non-finite ones are refused.
Result<Pose> pose_from_matrix(std::span<const double, 16> matrix, double tolerance = 0.02);

/// A camera at `eye` looking at `target`: x right, y down, z forward. `up` must not be parallel to
/// the line of sight.
Pose look_at(Vec3d eye, Vec3d target, Vec3d up);

}  // namespace mr
