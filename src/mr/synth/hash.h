#pragma once

#include <cstdint>

namespace mr::synth {

/// Mixes 64 bits (splitmix64's finaliser): the same on every platform and library.
constexpr std::uint64_t mix(std::uint64_t v) {
  v += 0x9E3779B97F4A7C15ull;
  v = (v ^ (v >> 30)) * 0xBF58476D1CE4E5B9ull;
  v = (v ^ (v >> 27)) * 0x94D049BB133111EBull;
  return v ^ (v >> 31);
}

constexpr std::uint64_t mix(std::uint64_t a, std::uint64_t b) { return mix(mix(a) ^ b); }

/// [0, 1) from the upper bits of a hash.
constexpr float unit(std::uint64_t hash) {
  return static_cast<float>(hash >> 40) * (1.0f / 16777216.0f);
}

/// A sequence of numbers from a seed.
class Random {
 public:
  explicit Random(std::uint64_t seed) : state_(mix(seed)) {}

  double uniform(double low, double high) { return low + (high - low) * unit(next()); }
  int index(int count) { return static_cast<int>(next() % static_cast<std::uint64_t>(count)); }

 private:
  std::uint64_t next() { return state_ = mix(state_); }

  std::uint64_t state_;
};

}  // namespace mr::synth
