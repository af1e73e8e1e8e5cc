#pragma once

#include <cstdint>
#include <cstring>
#include <type_traits>
#include <vector>

#include "child.h"

namespace mr::bench {

/// An array as a binary value of a message.
template <typename T, typename Allocator>
Message binary(const std::vector<T, Allocator>& values) {
  static_assert(std::is_trivially_copyable_v<T>);
  std::vector<std::uint8_t> bytes(values.size() * sizeof(T));
  if (!bytes.empty()) std::memcpy(bytes.data(), values.data(), bytes.size());
  return Message::binary(std::move(bytes));
}

template <typename T>
std::vector<T> array_from(const Message& message) {
  static_assert(std::is_trivially_copyable_v<T>);
  const std::vector<std::uint8_t>& bytes = message.get_binary();
  std::vector<T> values(bytes.size() / sizeof(T));
  if (!values.empty()) std::memcpy(values.data(), bytes.data(), values.size() * sizeof(T));
  return values;
}

}  // namespace mr::bench
