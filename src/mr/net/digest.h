#pragma once

#include <array>
#include <string>

namespace mr::net {

using Sha256 = std::array<unsigned char, 32>;

Sha256 sha256(const std::string& text);

/// Whether two digests are the same, in a time that tells nothing about where they differ.
bool is_equal_in_constant_time(const Sha256& a, const Sha256& b);

}  // namespace mr::net
