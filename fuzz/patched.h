#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <vector>

namespace mr::fuzz {

inline std::span<const std::byte> as_bytes(const std::uint8_t* data, std::size_t size) {
  return std::as_bytes(std::span(data, size));
}

/// Bytes to decode. An input that starts with 0 is taken as it is; any other is a list of changes
/// to `valid`, four bytes each (where, 24 bits; what), so that the fuzzer gets past the entropy
/// coding without a corpus. A change with the highest bit set cuts the rest off.
inline std::vector<std::byte> patched(std::span<const std::byte> valid,
                                      std::span<const std::byte> input) {
  if (input.empty() || input[0] == std::byte{0})
    return {input.begin() + (input.empty() ? 0 : 1), input.end()};
  std::vector<std::byte> out(valid.begin(), valid.end());
  for (input = input.subspan(1); input.size() >= 4 && !out.empty(); input = input.subspan(4)) {
    std::uint32_t where = 0;
    std::memcpy(&where, input.data(), 3);
    const std::size_t at = (where & 0x7FFFFF) % out.size();
    if ((where & 0x800000) != 0)
      out.resize(at);
    else
      out[at] = input[3];
  }
  return out;
}

}  // namespace mr::fuzz
