#pragma once

#include <array>
#include <utility>

/// Vectors and matrices of the six degrees of freedom of a rigid motion: rotation, then
/// translation.
namespace mr::calib {

using Vec6 = std::array<double, 6>;
using Mat6 = std::array<Vec6, 6>;

inline Vec6 operator*(const Mat6& a, const Vec6& v) {
  Vec6 out{};
  for (int i = 0; i < 6; ++i)
    for (int j = 0; j < 6; ++j) out[i] += a[i][j] * v[j];
  return out;
}

inline Mat6 operator*(const Mat6& a, const Mat6& b) {
  Mat6 out{};
  for (int i = 0; i < 6; ++i)
    for (int k = 0; k < 6; ++k)
      for (int j = 0; j < 6; ++j) out[i][j] += a[i][k] * b[k][j];
  return out;
}

/// The inverse of a positive definite matrix (Gauss-Jordan elimination).
inline Mat6 inverse(Mat6 a) {
  for (int k = 0; k < 6; ++k) {
    const double pivot = 1 / a[k][k];
    a[k][k] = 1;
    for (double& x : a[k]) x *= pivot;
    for (int i = 0; i < 6; ++i) {
      if (i == k) continue;
      const double factor = std::exchange(a[i][k], 0);
      for (int j = 0; j < 6; ++j) a[i][j] -= factor * a[k][j];
    }
  }
  return a;
}

/// Projection onto the directions that a matrix of normal equations observes: each of its
/// eigenvalues x is weighed with x⁴ / (x⁴ + least⁴), so those far below `least` are taken out.
inline Mat6 observable_directions(const Mat6& JtJ, double least) {
  const Mat6 square = JtJ * JtJ, fourth = square * square;
  Mat6 sum = fourth;
  for (int i = 0; i < 6; ++i) sum[i][i] += least * least * least * least;
  return fourth * inverse(sum);
}

}  // namespace mr::calib
