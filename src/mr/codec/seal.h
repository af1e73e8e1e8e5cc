#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "mr/core/result.h"

namespace mr::codec {

/// The trailer of every message between nodes and to viewers: the CRC-32 (IEEE 802.3) of all bytes
/// before it, little-endian. It detects damaged bytes, not forged ones.
inline constexpr std::size_t kSealBytes = 4;

/// Appends the checksum.
void seal(std::vector<std::byte>& bytes);

/// The bytes before the checksum. Error corrupt: the checksum is wrong.
Result<std::span<const std::byte>> unseal(std::span<const std::byte> sealed);

}  // namespace mr::codec
