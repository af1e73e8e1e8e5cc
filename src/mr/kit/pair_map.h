#pragma once

#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

namespace mr::kit {

/// A hash map from 64-bit keys to numbers, without removal. Open addressing: one array, no
/// allocation per entry.
class PairMap {
 public:
  explicit PairMap(std::size_t expected) { resize(2 * expected); }

  /// The value of a key, or null.
  const std::uint32_t* find(std::uint64_t key) const {
    const Slot& slot = slots_[place(key)];
    return slot.used ? &slot.value : nullptr;
  }

  /// The value of a key, which is inserted with `fresh` if it is missing.
  std::uint32_t& get_or_add(std::uint64_t key, std::uint32_t fresh) {
    if (2 * (count_ + 1) > slots_.size()) resize(2 * slots_.size());
    Slot& slot = slots_[place(key)];
    if (!slot.used) slot = {key, fresh, true}, ++count_;
    return slot.value;
  }

 private:
  struct Slot {
    std::uint64_t key = 0;
    std::uint32_t value = 0;
    bool used = false;
  };

  /// The slot of a key, or the free slot for it.
  std::size_t place(std::uint64_t key) const {
    std::size_t at = key * 0x9E3779B97F4A7C15ull >> shift_;
    while (slots_[at].used && slots_[at].key != key) at = (at + 1) & (slots_.size() - 1);
    return at;
  }

  /// Makes room for at least `slots`.
  void resize(std::size_t slots) {
    std::vector<Slot> old = std::move(slots_);
    std::size_t size = 16;
    for (shift_ = 60; size < slots; size *= 2) --shift_;
    slots_.assign(size, {});
    for (const Slot& slot : old)
      if (slot.used) slots_[place(slot.key)] = slot;
  }

  std::vector<Slot> slots_;  // a power of two
  std::size_t count_ = 0;
  int shift_ = 60;
};

}  // namespace mr::kit
