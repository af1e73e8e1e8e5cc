#include "mr/codec/seal.h"

#include <zlib.h>

#include <cstdint>

namespace mr::codec {
namespace {

std::uint32_t checksum(std::span<const std::byte> bytes) {
  const auto* data = reinterpret_cast<const Bytef*>(bytes.data());
  return static_cast<std::uint32_t>(::crc32_z(0, data, bytes.size()));
}

}  // namespace

void seal(std::vector<std::byte>& bytes) {
  const std::uint32_t sum = checksum(bytes);
  for (std::size_t i = 0; i < kSealBytes; ++i)
    bytes.push_back(static_cast<std::byte>(sum >> (8 * i) & 0xFF));
}

Result<std::span<const std::byte>> unseal(std::span<const std::byte> sealed) {
  const Error damaged{Error::Cause::corrupt, "cut off or damaged: its checksum does not fit"};
  if (sealed.size() < kSealBytes) return damaged;
  const auto bytes = sealed.first(sealed.size() - kSealBytes);
  std::uint32_t stored = 0;
  for (std::size_t i = 0; i < kSealBytes; ++i)
    stored |= std::to_integer<std::uint32_t>(sealed[bytes.size() + i]) << (8 * i);
  if (stored != checksum(bytes)) return damaged;
  return bytes;
}

}  // namespace mr::codec
