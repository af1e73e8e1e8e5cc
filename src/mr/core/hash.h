#pragma once

#include <bit>
#include <cstdint>

#include "mr/core/vec.h"

namespace mr {

/// An order-dependent hash of numbers; the same on every machine. Not cryptographic: collisions can
/// be constructed.
class Hash {
 public:
  void add(std::uint64_t v) {
    value_ = (value_ ^ v) * 0x9E3779B97F4A7C15u;
    value_ ^= value_ >> 29;
  }
  /// Equal vectors add the same: -0 is hashed as 0.
  void add(Vec3f p) {
    for (const float v : {p.x, p.y, p.z}) add(std::bit_cast<std::uint32_t>(v + 0.0f));
  }
  std::uint64_t value() const { return value_; }

 private:
  std::uint64_t value_ = 0xCBF29CE484222325u;
};

}  // namespace mr
