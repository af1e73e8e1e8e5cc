#pragma once

#include "mr/core/vec.h"

namespace mr::simplify {

/// A sum of weighted squared distances to planes (Garland & Heckbert 1997) as a function of the way
/// d from a vertex: d' A d + 2 b' d + c. It stays with its vertex, so fp32 is enough. c, the error
/// at the vertex itself, is kept beside the vertex's position. Weights are in m², errors in m⁴.
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
  /// The vertex's own place, as if three planes at right angles met there.
  void add_point(float w) { xx += w, yy += w, zz += w; }

  /// How much larger the error is at d than at the vertex; d: Vec3f, or several at once.
  template <typename Vec>
  auto growth(const Vec& d) const {
    return d.x * (xx * d.x + 2 * xy * d.y + 2 * xz * d.z + 2 * x) +
           d.y * (yy * d.y + 2 * yz * d.z + 2 * y) + d.z * (zz * d.z + 2 * z);
  }

  /// The same function for a vertex that lies `d` further on.
  Quadric moved(Vec3f d) const {
    Quadric q = *this;
    q.x += xx * d.x + xy * d.y + xz * d.z;
    q.y += xy * d.x + yy * d.y + yz * d.z;
    q.z += xz * d.x + yz * d.y + zz * d.z;
    return q;
  }
  /// Both must belong to one vertex.
  Quadric& operator+=(const Quadric& q) {
    xx += q.xx, xy += q.xy, xz += q.xz, yy += q.yy, yz += q.yz, zz += q.zz;
    x += q.x, y += q.y, z += q.z, weight += q.weight, area += q.area;
    return *this;
  }

  /// Counts `by` times; area stays.
  Quadric scaled(float by) const {
    Quadric q = *this;
    q.xx *= by, q.xy *= by, q.xz *= by, q.yy *= by, q.yz *= by, q.zz *= by;
    q.x *= by, q.y *= by, q.z *= by, q.weight *= by;
    return q;
  }

  /// The way to the least error; `regularization` (of the weight) pulls back to the vertex, so that
  /// flat directions do not run away. Zero where there is none.
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
