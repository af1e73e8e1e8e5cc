#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "mr/codec/seal.h"
#include "mr/core/shared_bytes.h"

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

/// Changes a payload: `change` gets a copy of its bytes, for others may hold the payload, too.
template <typename Change>
void edit(SharedBytes& payload, const Change& change) {
  std::vector<std::byte> bytes = payload.copy();
  change(bytes);
  payload = std::move(bytes);
}

}  // namespace mr::test
