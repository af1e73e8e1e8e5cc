#pragma once

#include <array>
#include <string>

namespace mr::net {

using Sha256 = std::array<unsigned char, 32>;

Sha256 sha256(const std::string& text);

/// Compares two digests in constant time, so that the duration does not tell where they differ
/// (timing attack).
bool is_equal_in_constant_time(const Sha256& a, const Sha256& b);

}  // namespace mr::net
