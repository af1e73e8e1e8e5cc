#pragma once

#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

namespace mr::kit {

/// Maps keys to numbers; nothing is ever taken out. Open addressing: one array, no allocation per
/// entry.
class PairMap {
 public:
  explicit PairMap(std::size_t expected) { resize(2 * expected); }

  /// The number behind a key, or null.
  const std::uint32_t* find(std::uint64_t key) const {
    const Slot& slot = slots_[place(key)];
    return slot.used ? &slot.value : nullptr;
  }

  /// The number behind a key; `fresh` where there was none.
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

  /// Where a key is, or the free slot where it would be put.
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
