#pragma once

#include <algorithm>
#include <string>
#include <string_view>

namespace mr::net {

inline constexpr std::size_t kLongestPrintable = 200;

/// Somebody else's text as part of a line: what is not printable ASCII is '?', and it is not long.
inline std::string printable(std::string_view text) {
  std::string out(text.substr(0, kLongestPrintable));
  std::ranges::replace_if(
      out, [](char c) { return c < 0x20 || c >= 0x7f; }, '?');
  return out;
}

}  // namespace mr::net
