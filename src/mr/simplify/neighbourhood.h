#pragma once

#include <array>
#include <cstdint>

#include "mr/core/vec.h"
#include "mr/kit/float4.h"
#include "mr/simplify/vertex_rings.h"

namespace mr::simplify {

/// A vertex's position and error, as one SIMD vector of four.
struct alignas(16) VertexPosition {
  Vec3f at;
  float error = 0;  ///< of the vertex's quadric, here
};

/// The one-ring of a vertex as structure of arrays, for SIMD arithmetic on four neighbours or
/// triangles at once. Positions are relative to the vertex. Lanes beyond the last hold copies of
/// others.
class Neighbourhood {
 public:
  /// `v` must be alive and not complex.
  void load(const VertexRings& rings, const VertexPosition* places, std::uint32_t v);

  std::uint32_t vertex() const { return v_; }
  std::uint32_t size() const { return size_; }
  std::uint32_t triangles() const { return triangles_; }
  /// Number of lanes to process: the same for most vertices, so that branches are well predicted.
  std::uint32_t lanes() const { return size_ <= 8 ? 8 : VertexRings::kMost; }
  std::uint32_t id(std::uint32_t i) const { return (*ring_)[i]; }
  Vec3f arm(std::uint32_t i) const { return {x_[i], y_[i], z_[i]}; }
  float error(std::uint32_t i) const { return error_[i]; }

  /// Of neighbours i to i + 3; i may be one past a multiple of four: the first follows the last.
  kit::Vec3x4 arms(std::uint32_t i) const {
    return {kit::load4<kit::Float4>(&x_[i]), kit::load4<kit::Float4>(&y_[i]),
            kit::load4<kit::Float4>(&z_[i])};
  }
  static kit::UInt4 places(std::uint32_t i) { return kit::UInt4{0, 1, 2, 3} + i; }
  kit::Float4 errors(std::uint32_t i) const { return kit::load4<kit::Float4>(&error_[i]); }

 private:
  using Floats = std::array<float, VertexRings::kMost + 8>;

  std::uint32_t v_ = 0, size_ = 0, triangles_ = 0;
  const VertexRings::Line* ring_ = nullptr;
  alignas(16) Floats x_{}, y_{}, z_{}, error_{};
};

inline void Neighbourhood::load(const VertexRings& rings, const VertexPosition* places,
                                std::uint32_t v) {
  const VertexRings::Line& ring = rings.ring(v);
  const Vec3f here = places[v].at;
  v_ = v, ring_ = &ring, size_ = rings.size(v), triangles_ = rings.triangles(v);
  const auto place = [&](std::uint32_t i) {
    return kit::load4<kit::Float4>(&places[ring[i] == kNoVertex ? ring[0] : ring[i]].at.x);
  };
  for (std::uint32_t i = 0; i < lanes(); i += 4) {
    kit::Float4 x = place(i), y = place(i + 1), z = place(i + 2), error = place(i + 3);
    kit::transpose(x, y, z, error);
    kit::store4(x - here.x, &x_[i]), kit::store4(y - here.y, &y_[i]),
        kit::store4(z - here.z, &z_[i]);
    kit::store4(error, &error_[i]);
  }
  x_[size_] = x_[0], y_[size_] = y_[0], z_[size_] = z_[0];
}

}  // namespace mr::simplify
