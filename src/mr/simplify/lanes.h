#pragma once

#include <cstdint>
#include <cstring>
#ifdef __SSE2__
#include <emmintrin.h>
#endif

/// Vectors of four that every target has, by GCC's and Clang's extension: what a lane computes is
/// what a number alone would give.
namespace mr::simplify {

using Float4 = float __attribute__((vector_size(16)));
using Mask4 = std::int32_t __attribute__((vector_size(16)));  ///< lanes of 0 or all bits
using Word4 = std::uint32_t __attribute__((vector_size(16)));

template <typename Lanes, typename T>
Lanes load4(const T* from) {
  static_assert(sizeof(Lanes) == 4 * sizeof(T));
  Lanes out;
  std::memcpy(&out, from, sizeof(out));
  return out;
}
template <typename Lanes, typename T>
void store4(Lanes lanes, T* to) {
  static_assert(sizeof(Lanes) == 4 * sizeof(T));
  std::memcpy(to, &lanes, sizeof(lanes));
}

/// Bit i: lane i is set.
inline std::uint32_t bits_of(Mask4 mask) {
#ifdef __SSE2__
  return static_cast<std::uint32_t>(_mm_movemask_ps(reinterpret_cast<__m128>(mask)));
#else
  mask &= Mask4{1, 2, 4, 8};
  mask |= __builtin_shufflevector(mask, mask, 2, 3, 0, 1);
  mask |= __builtin_shufflevector(mask, mask, 1, 0, 3, 2);
  return static_cast<std::uint32_t>(mask[0]);
#endif
}
inline std::uint32_t sum_of(Word4 a) {
  a += __builtin_shufflevector(a, a, 2, 3, 0, 1);
  a += __builtin_shufflevector(a, a, 1, 0, 3, 2);
  return a[0];
}

inline float least_of(Float4 a) {
  const Float4 b = __builtin_shufflevector(a, a, 2, 3, 0, 1);
  a = a < b ? a : b;
  const Float4 c = __builtin_shufflevector(a, a, 1, 0, 3, 2);
  a = a < c ? a : c;
  return a[0];
}
inline bool any(Mask4 mask) { return bits_of(mask) != 0; }

/// Four points or directions.
struct Vec4 {
  Float4 x, y, z;
};
inline Vec4 operator-(const Vec4& a, const Vec4& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
inline Float4 dot(const Vec4& a, const Vec4& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline Vec4 cross(const Vec4& a, const Vec4& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

/// Rows become columns.
inline void transpose(Float4& a, Float4& b, Float4& c, Float4& d) {
  const Float4 ab_low = __builtin_shufflevector(a, b, 0, 4, 1, 5);
  const Float4 ab_high = __builtin_shufflevector(a, b, 2, 6, 3, 7);
  const Float4 cd_low = __builtin_shufflevector(c, d, 0, 4, 1, 5);
  const Float4 cd_high = __builtin_shufflevector(c, d, 2, 6, 3, 7);
  a = __builtin_shufflevector(ab_low, cd_low, 0, 1, 4, 5);
  b = __builtin_shufflevector(ab_low, cd_low, 2, 3, 6, 7);
  c = __builtin_shufflevector(ab_high, cd_high, 0, 1, 4, 5);
  d = __builtin_shufflevector(ab_high, cd_high, 2, 3, 6, 7);
}

}  // namespace mr::simplify
