#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <compare>
#include <cstdint>
#include <initializer_list>
#include <limits>

namespace mr {

/// A 2-vector: pixel coordinates (x right, y down) or any planar quantity.
template <typename T>
struct Vec2 {
  T x{}, y{};

  friend constexpr Vec2 operator+(Vec2 a, Vec2 b) { return {a.x + b.x, a.y + b.y}; }
  friend constexpr Vec2 operator-(Vec2 a, Vec2 b) { return {a.x - b.x, a.y - b.y}; }
  friend constexpr Vec2 operator*(Vec2 a, T s) { return {a.x * s, a.y * s}; }
  friend constexpr auto operator<=>(const Vec2&, const Vec2&) = default;
};

/// A 3-vector: a point or direction. Positions are in metres.
template <typename T>
struct Vec3 {
  T x{}, y{}, z{};

  constexpr T operator[](int axis) const { return axis == 0 ? x : axis == 1 ? y : z; }
  constexpr T& operator[](int axis) { return axis == 0 ? x : axis == 1 ? y : z; }

  friend constexpr Vec3 operator+(Vec3 a, Vec3 b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
  friend constexpr Vec3 operator-(Vec3 a, Vec3 b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
  friend constexpr Vec3 operator-(Vec3 a) { return {-a.x, -a.y, -a.z}; }
  friend constexpr Vec3 operator*(Vec3 a, T s) { return {a.x * s, a.y * s, a.z * s}; }
  friend constexpr Vec3 operator*(T s, Vec3 a) { return a * s; }
  friend constexpr Vec3 operator/(Vec3 a, T s) { return {a.x / s, a.y / s, a.z / s}; }
  constexpr Vec3& operator+=(Vec3 b) { return *this = *this + b; }
  friend constexpr auto operator<=>(const Vec3&, const Vec3&) = default;
};

using Vec2d = Vec2<double>;
using Vec2f = Vec2<float>;
using Vec2i = Vec2<int>;
using Vec3d = Vec3<double>;
using Vec3f = Vec3<float>;
using Vec3i = Vec3<std::int32_t>;

template <typename To, typename From>
constexpr Vec3<To> vec_cast(Vec3<From> v) {
  return {static_cast<To>(v.x), static_cast<To>(v.y), static_cast<To>(v.z)};
}

template <typename T>
constexpr T dot(Vec3<T> a, Vec3<T> b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}

template <typename T>
constexpr Vec3<T> cross(Vec3<T> a, Vec3<T> b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

template <typename T>
T length(Vec3<T> a) {
  return std::sqrt(dot(a, a));
}

/// The unit vector along `a`; zero stays zero.
template <typename T>
Vec3<T> normalized(Vec3<T> a) {
  const T len = length(a);
  return len > T(0) ? a / len : a;
}

template <typename T>
bool is_finite(Vec3<T> a) {
  return std::isfinite(a.x) && std::isfinite(a.y) && std::isfinite(a.z);
}

template <typename T>
constexpr Vec3<T> min(Vec3<T> a, Vec3<T> b) {
  return {std::min(a.x, b.x), std::min(a.y, b.y), std::min(a.z, b.z)};
}

template <typename T>
constexpr Vec3<T> max(Vec3<T> a, Vec3<T> b) {
  return {std::max(a.x, b.x), std::max(a.y, b.y), std::max(a.z, b.z)};
}

/// An axis-aligned box, both ends included. Default: empty.
template <typename T>
struct Box3 {
  Vec3<T> low{std::numeric_limits<T>::max(), std::numeric_limits<T>::max(),
              std::numeric_limits<T>::max()};
  Vec3<T> high{std::numeric_limits<T>::lowest(), std::numeric_limits<T>::lowest(),
               std::numeric_limits<T>::lowest()};

  constexpr bool empty() const { return low.x > high.x || low.y > high.y || low.z > high.z; }
  friend constexpr bool operator==(const Box3&, const Box3&) = default;
  constexpr void add(Vec3<T> p) { low = min(low, p), high = max(high, p); }
  constexpr bool contains(Vec3<T> p) const {
    return p.x >= low.x && p.y >= low.y && p.z >= low.z && p.x <= high.x && p.y <= high.y &&
           p.z <= high.z;
  }
};
using Box3d = Box3<double>;
using Box3f = Box3<float>;

/// Mixes an integer triple into 64 well-spread bits, for hash tables.
inline std::uint64_t hash_cell(Vec3i c) {
  std::uint64_t h = 0x9E3779B97F4A7C15ull;
  for (const std::int32_t v : {c.x, c.y, c.z}) {
    h ^= static_cast<std::uint32_t>(v);
    h *= 0xBF58476D1CE4E5B9ull;
    h ^= h >> 29;
  }
  return h;
}

struct CellHash {
  std::size_t operator()(Vec3i c) const { return hash_cell(c); }
};

}  // namespace mr
