#pragma once

#include <algorithm>
#include <string>
#include <string_view>

namespace mr::net {

inline constexpr std::size_t kLongestPrintable = 200;

/// Text from a peer made safe for a log line: characters that are not printable ASCII become '?',
/// and it is cut after kLongestPrintable characters.
inline std::string printable(std::string_view text) {
  std::string out(text.substr(0, kLongestPrintable));
  std::ranges::replace_if(
      out, [](char c) { return c < 0x20 || c >= 0x7f; }, '?');
  return out;
}

}  // namespace mr::net
