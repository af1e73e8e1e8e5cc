#pragma once

#include <algorithm>
#include <cstddef>
#include <initializer_list>
#include <memory>
#include <span>
#include <utility>
#include <vector>

namespace mr {

/// Immutable bytes with many holders: copies share the memory, and equal means equal bytes. A coded
/// payload is made once and passed on by pointer from the encoder to the last queue.
class SharedBytes {
 public:
  SharedBytes() = default;
  SharedBytes(std::vector<std::byte> bytes) {
    const auto owner = std::make_shared<const std::vector<std::byte>>(std::move(bytes));
    bytes_ = *owner;
    owner_ = owner;
  }
  SharedBytes(std::initializer_list<std::byte> bytes)
      : SharedBytes(std::vector<std::byte>(bytes)) {}
  /// Part of what `owner` keeps alive, all of it.
  SharedBytes(std::shared_ptr<const void> owner, std::span<const std::byte> part)
      : owner_(std::move(owner)), bytes_(part) {}

  const std::byte* data() const { return bytes_.data(); }
  std::size_t size() const { return bytes_.size(); }
  bool empty() const { return bytes_.empty(); }
  const std::byte* begin() const { return data(); }
  const std::byte* end() const { return data() + size(); }
  const std::byte& operator[](std::size_t i) const { return bytes_[i]; }
  std::vector<std::byte> copy() const { return {begin(), end()}; }

  friend bool operator==(const SharedBytes& a, const SharedBytes& b) {
    return std::equal(a.begin(), a.end(), b.begin(), b.end());
  }

 private:
  std::shared_ptr<const void> owner_;
  std::span<const std::byte> bytes_;
};

}  // namespace mr
