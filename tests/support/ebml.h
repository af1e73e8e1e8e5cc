#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

/// A reader of EBML (Matroska) for tests, which trusts its input.
namespace mr::test {

struct Ebml {
  std::uint32_t id = 0;
  std::size_t at = 0;  ///< of its first byte in the bytes that were read
  bool known_size = true;
  std::span<const std::byte> content;

  /// Its elements; `content` must be some.
  std::vector<Ebml> children() const;
  /// Those of one id.
  std::vector<Ebml> all(std::uint32_t wanted) const {
    std::vector<Ebml> out;
    for (const Ebml& child : children())
      if (child.id == wanted) out.push_back(child);
    return out;
  }
  /// The only one of its id; else one with id 0 and no content.
  Ebml one(std::uint32_t wanted) const {
    const std::vector<Ebml> found = all(wanted);
    return found.size() == 1 ? found[0] : Ebml{};
  }
  std::uint64_t number() const {
    std::uint64_t out = 0;
    for (const std::byte b : content) out = out << 8 | std::to_integer<std::uint64_t>(b);
    return out;
  }
  double real() const { return std::bit_cast<double>(number()); }  ///< of eight bytes
  std::string text() const {
    return {reinterpret_cast<const char*>(content.data()), content.size()};
  }
};

/// The elements of `bytes`; one of unknown size goes on to the end.
inline std::vector<Ebml> parse_ebml(std::span<const std::byte> bytes) {
  std::vector<Ebml> out;
  for (std::size_t at = 0; at < bytes.size();) {
    Ebml element;
    element.at = at;
    const auto byte = [&](std::size_t i) {
      return i < bytes.size() ? std::to_integer<std::uint64_t>(bytes[i]) : 0;
    };
    const auto number = [&](bool keep_marker) {
      const int length = std::countl_zero(static_cast<std::uint8_t>(byte(at) | 1)) + 1;
      std::uint64_t value = keep_marker ? byte(at) : byte(at) & (0xFFu >> length);
      for (int i = 1; i < length; ++i) value = value << 8 | byte(at + i);
      at += length;
      element.known_size = value != (std::uint64_t{1} << 7 * length) - 1;
      return value;
    };
    element.id = static_cast<std::uint32_t>(number(true));
    const std::uint64_t size = number(false);
    if (at > bytes.size()) break;
    const std::size_t rest = bytes.size() - at;
    element.content = bytes.subspan(at, element.known_size && size < rest ? size : rest);
    at += element.content.size();
    out.push_back(element);
  }
  return out;
}

inline std::vector<Ebml> Ebml::children() const { return parse_ebml(content); }

}  // namespace mr::test
