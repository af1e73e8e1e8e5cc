#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "mr/codec/seal.h"

namespace mr::test {

/// Bytes with the checksum that fits them.
inline std::vector<std::byte> sealed(const std::uint8_t* data, std::size_t size) {
  const auto bytes = std::as_bytes(std::span(data, size));
  std::vector<std::byte> out(bytes.begin(), bytes.end());
  codec::seal(out);
  return out;
}

/// A sealed message that was changed since, as a forger would send it.
inline std::vector<std::byte> resealed(std::vector<std::byte> message) {
  message.resize(message.size() < codec::kSealBytes ? 0 : message.size() - codec::kSealBytes);
  codec::seal(message);
  return message;
}

}  // namespace mr::test
