#pragma once

#include <cstddef>
#include <span>

namespace mr::net {

/// Writes an unsigned number, lowest byte first; returns the position after it.
template <typename T>
std::byte* put(std::byte* at, T value) {
  for (std::size_t i = 0; i < sizeof(T); ++i)
    *at++ = static_cast<std::byte>((value >> (8 * i)) & 0xFF);
  return at;
}

/// Reads an unsigned number from the front of `bytes`, which must be long enough, and removes it.
template <typename T>
T take(std::span<const std::byte>& bytes) {
  T value = 0;
  for (std::size_t i = 0; i < sizeof(T); ++i)
    value = static_cast<T>(value | (std::to_integer<T>(bytes[i]) << (8 * i)));
  bytes = bytes.subspan(sizeof(T));
  return value;
}

}  // namespace mr::net
