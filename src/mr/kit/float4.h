#pragma once

#include <cstdint>
#include <cstring>
#ifdef __SSE2__
#include <emmintrin.h>
#endif

/// SIMD vectors of four (GCC and Clang vector extension), available on every target. Each lane is
/// bit-identical to the scalar operation.
namespace mr::kit {

using Float4 = float __attribute__((vector_size(16)));
using Int4 = std::int32_t __attribute__((vector_size(16)));  ///< as a mask: lanes of 0 or all bits
using UInt4 = std::uint32_t __attribute__((vector_size(16)));

/// The same number in all lanes.
inline Float4 splat4(float x) { return Float4{x, x, x, x}; }
inline Int4 splat4(std::int32_t x) { return Int4{x, x, x, x}; }

/// Unaligned load of four numbers.
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

/// Reinterprets the bits.
inline Int4 as_ints(Float4 lanes) { return reinterpret_cast<Int4>(lanes); }
inline Float4 as_floats(Int4 lanes) { return reinterpret_cast<Float4>(lanes); }

/// Bit i is the sign of lane i (movemask): of a mask, whether the lane is set.
inline std::uint32_t sign_bits(Int4 lanes) {
#ifdef __SSE2__
  return static_cast<std::uint32_t>(_mm_movemask_ps(reinterpret_cast<__m128>(lanes)));
#else
  lanes = (lanes < 0) & Int4{1, 2, 4, 8};
  lanes |= __builtin_shufflevector(lanes, lanes, 2, 3, 0, 1);
  lanes |= __builtin_shufflevector(lanes, lanes, 1, 0, 3, 2);
  return static_cast<std::uint32_t>(lanes[0]);
#endif
}
inline bool any(Int4 mask) { return sign_bits(mask) != 0; }

inline Float4 min4(Float4 a, Float4 b) { return a < b ? a : b; }
inline Float4 max4(Float4 a, Float4 b) { return a > b ? a : b; }

/// The smallest of the four lanes.
inline float min_lane(Float4 a) {
  a = min4(a, __builtin_shufflevector(a, a, 2, 3, 0, 1));
  a = min4(a, __builtin_shufflevector(a, a, 1, 0, 3, 2));
  return a[0];
}
inline std::uint32_t sum_lanes(UInt4 a) {
  a += __builtin_shufflevector(a, a, 2, 3, 0, 1);
  a += __builtin_shufflevector(a, a, 1, 0, 3, 2);
  return a[0];
}

/// Lane `kLane` in all lanes.
template <int kLane>
Int4 broadcast(Int4 lanes) {
  return __builtin_shufflevector(lanes, lanes, kLane, kLane, kLane, kLane);
}

/// Transposes a matrix of four rows: rows become columns.
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

/// Four points or directions, one per lane.
struct Vec3x4 {
  Float4 x, y, z;
};
inline Vec3x4 operator-(const Vec3x4& a, const Vec3x4& b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
inline Float4 dot(const Vec3x4& a, const Vec3x4& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline Vec3x4 cross(const Vec3x4& a, const Vec3x4& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

}  // namespace mr::kit
