#include "mr/core/pose.h"

#include <cmath>

namespace mr {

Mat3 operator*(const Mat3& a, const Mat3& b) {
  Mat3 c;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) c(i, j) = dot(a.row(i), b.column(j));
  return c;
}

Mat3 transposed(const Mat3& a) {
  Mat3 t;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) t(i, j) = a(j, i);
  return t;
}

double determinant(const Mat3& a) { return dot(a.row(0), cross(a.row(1), a.row(2))); }

Pose Pose::inverse() const {
  const Mat3 back = transposed(rotation);
  return {back, -(back * translation)};
}

Pose operator*(const Pose& a, const Pose& b) {
  return {a.rotation * b.rotation, a * b.translation};
}

std::array<double, 16> Pose::matrix() const {
  const auto& r = rotation.m;
  return {r[0], r[1], r[2], translation.x, r[3], r[4], r[5], translation.y,
          r[6], r[7], r[8], translation.z, 0,    0,    0,    1};
}

namespace {

/// Inverse transpose of a well-conditioned matrix: its rows are cross products over the
/// determinant.
Mat3 inverse_transposed(const Mat3& a) {
  const Vec3d r0 = cross(a.row(1), a.row(2)), r1 = cross(a.row(2), a.row(0)),
              r2 = cross(a.row(0), a.row(1));
  const double d = dot(a.row(0), r0);
  return {
      {r0.x / d, r0.y / d, r0.z / d, r1.x / d, r1.y / d, r1.z / d, r2.x / d, r2.y / d, r2.z / d}};
}

/// Largest entry of RᵀR - I.
double deviation_from_rotation(const Mat3& r) {
  const Mat3 gram = transposed(r) * r;
  double worst = 0;
  for (int i = 0; i < 9; ++i) worst = std::max(worst, std::abs(gram.m[i] - (i % 4 == 0 ? 1 : 0)));
  return worst;
}

}  // namespace

bool is_rigid(const Pose& T) {
  constexpr double kTolerance = 1e-3, kFarthest_m = 1e8;
  for (int i = 0; i < 3; ++i) {
    if (!(std::abs(T.translation[i]) <= kFarthest_m)) return false;
    for (int j = 0; j <= i; ++j)
      if (!(std::abs(dot(T.rotation.column(i), T.rotation.column(j)) - (i == j)) <= kTolerance))
        return false;
  }
  return determinant(T.rotation) > 0;
}

Result<Pose> pose_from_matrix(std::span<const double, 16> matrix, double tolerance) {
  const auto refuse = [](const char* why) { return Error{Error::Cause::invalid, why}; };
  for (const double v : matrix)
    if (!std::isfinite(v)) return refuse("pose holds a number that is not finite");
  constexpr double kLastRow[] = {0, 0, 0, 1};
  for (int c = 0; c < 4; ++c)
    if (std::abs(matrix[12 + c] - kLastRow[c]) > 1e-6)
      return refuse("pose is not rigid: its last row is not 0 0 0 1");

  Pose pose;
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c) pose.rotation(r, c) = matrix[r * 4 + c];
  pose.translation = {matrix[3], matrix[7], matrix[11]};

  if (determinant(pose.rotation) <= 0)
    return refuse("pose is not rigid: its rotation is mirrored or singular");
  if (deviation_from_rotation(pose.rotation) > tolerance)
    return refuse("pose is not rigid: its rotation is not orthonormal");
  for (int i = 0; i < 8 && deviation_from_rotation(pose.rotation) > 1e-15; ++i) {
    const Mat3 other = inverse_transposed(pose.rotation);
    for (int k = 0; k < 9; ++k) pose.rotation.m[k] = 0.5 * (pose.rotation.m[k] + other.m[k]);
  }
  return pose;
}

Pose look_at(Vec3d eye, Vec3d target, Vec3d up) {
  const Vec3d z = normalized(target - eye);
  const Vec3d x = normalized(cross(z, up));
  const Vec3d y = cross(z, x);
  return {{{x.x, y.x, z.x, x.y, y.y, z.y, x.z, y.z, z.z}}, eye};
}

}  // namespace mr
