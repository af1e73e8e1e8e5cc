#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string_view>
#include <type_traits>

namespace mr::sensor {

/// Reads serialized ROS values one after the other: little-endian numbers, and texts and lists with
/// their length before them. Once its end is passed everything is 0 and good() is false.
class RosBytes {
 public:
  explicit RosBytes(std::span<const std::byte> bytes) : rest_(bytes) {}

  bool good() const { return good_; }
  std::span<const std::byte> rest() const { return rest_; }

  template <typename T>
  requires std::is_arithmetic_v<T> T get() {
    T out{};
    if (const auto from = bytes(sizeof out); good_) std::memcpy(&out, from.data(), sizeof out);
    return out;
  }
  std::span<const std::byte> bytes(std::size_t count) {
    good_ = good_ && count <= rest_.size();
    if (!good_) return {};
    const auto out = rest_.first(count);
    rest_ = rest_.subspan(count);
    return out;
  }
  /// As many bytes as the number before them says.
  std::span<const std::byte> counted() { return bytes(get<std::uint32_t>()); }
  std::string_view text() { return text_of(counted()); }

  static std::string_view text_of(std::span<const std::byte> bytes) {
    return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
  }

 private:
  std::span<const std::byte> rest_;
  bool good_ = true;
};

}  // namespace mr::sensor
