#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "mr/core/result.h"

namespace mr::codec {

/// What every message between nodes and to viewers ends with: the CRC-32 (IEEE 802.3) of all bytes
/// before, little-endian. It tells bytes that were damaged on the way, not forged ones.
inline constexpr std::size_t kSealBytes = 4;

/// Appends the checksum.
void seal(std::vector<std::byte>& bytes);

/// The bytes before the checksum. corrupt: it does not fit them.
Result<std::span<const std::byte>> unseal(std::span<const std::byte> sealed);

}  // namespace mr::codec
