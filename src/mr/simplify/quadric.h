#pragma once

#include "mr/core/vec.h"

namespace mr::simplify {

/// Quadric error metric (Garland and Heckbert 1997): the sum of weighted squared distances to
/// planes as a function of the offset d from a vertex, d' A d + 2 b' d + c. Being relative to its
/// vertex it needs only fp32. c, the error at the vertex itself, is stored with the vertex's
/// position (VertexPosition::error). Weights are in m², errors in m⁴.
struct alignas(16) Quadric {
  float xx = 0, xy = 0, xz = 0, yy = 0, yz = 0, zz = 0;  ///< A
  float weight = 0;                                      ///< of all planes together
  float area = 0;             ///< the same without the vertex's own weight
  float x = 0, y = 0, z = 0;  ///< b

  /// A plane with unit normal `n` through the vertex.
  void add_plane(Vec3f n, float w) {
    const Vec3f m = n * w;
    xx += n.x * m.x, xy += n.x * m.y, xz += n.x * m.z;
    yy += n.y * m.y, yz += n.y * m.z, zz += n.z * m.z;
    weight += w, area += w;
  }
  /// The vertex's own position, as three orthogonal planes through it.
  void add_point(float w) { xx += w, yy += w, zz += w; }

  /// The error at offset d minus that at the vertex. d: Vec3f, or several points at once (SIMD).
  template <typename Vec>
  auto growth(const Vec& d) const {
    return d.x * (xx * d.x + 2 * xy * d.y + 2 * xz * d.z + 2 * x) +
           d.y * (yy * d.y + 2 * yz * d.z + 2 * y) + d.z * (zz * d.z + 2 * z);
  }

  /// The same function relative to a vertex at offset d.
  Quadric moved(Vec3f d) const {
    Quadric q = *this;
    q.x += xx * d.x + xy * d.y + xz * d.z;
    q.y += xy * d.x + yy * d.y + yz * d.z;
    q.z += xz * d.x + yz * d.y + zz * d.z;
    return q;
  }
  /// Both must be relative to the same vertex.
  Quadric& operator+=(const Quadric& q) {
    xx += q.xx, xy += q.xy, xz += q.xz, yy += q.yy, yz += q.yz, zz += q.zz;
    x += q.x, y += q.y, z += q.z, weight += q.weight, area += q.area;
    return *this;
  }

  /// Multiplied by a weight; `area` is unchanged.
  Quadric scaled(float by) const {
    Quadric q = *this;
    q.xx *= by, q.xy *= by, q.xz *= by, q.yy *= by, q.yz *= by, q.zz *= by;
    q.x *= by, q.y *= by, q.z *= by, q.weight *= by;
    return q;
  }

  /// The offset with the least error (a 3x3 linear solve). `regularization`, as a fraction of the
  /// weight, penalizes the distance from the vertex, so that the minimum does not move far along
  /// flat directions. Zero if the matrix is singular.
  Vec3f minimizer(float regularization) const;
};

inline Vec3f Quadric::minimizer(float regularization) const {
  const double damping = regularization * weight;
  const double a = xx + damping, b = yy + damping, c = zz + damping, ab = xy, ac = xz, bc = yz;
  const double aa_minor = b * c - bc * bc, ab_minor = ac * bc - ab * c, ac_minor = ab * bc - ac * b;
  const double bb_minor = a * c - ac * ac, bc_minor = ab * ac - a * bc, cc_minor = a * b - ab * ab;
  const double determinant = a * aa_minor + ab * ab_minor + ac * ac_minor;
  if (!(determinant > 0)) return {};
  const double scale = -1 / determinant;
  return vec_cast<float>(Vec3d{aa_minor * x + ab_minor * y + ac_minor * z,
                               ab_minor * x + bb_minor * y + bc_minor * z,
                               ac_minor * x + bc_minor * y + cc_minor * z} *
                         scale);
}

}  // namespace mr::simplify
