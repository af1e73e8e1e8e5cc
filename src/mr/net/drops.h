#pragma once

#include <cstdint>
#include <map>
#include <mutex>
#include <string>

namespace mr::net {

/// Counters of what was lost, refused or cut off, one per name "<slow or broken side>: <cause>".
/// Thread-safe and bounded: beyond a thousand names everything new is counted as "others".
class Drops {
 public:
  void count(const std::string& side, const std::string& cause, std::uint64_t times = 1) {
    if (times == 0) return;
    const std::lock_guard lock(mutex_);
    const std::string name = side + ": " + cause;
    const bool known = counts_.contains(name) || counts_.size() < kNames;
    counts_[known ? name : "others"] += times;
  }

  std::map<std::string, std::uint64_t> all() const {
    const std::lock_guard lock(mutex_);
    return counts_;
  }

 private:
  static constexpr std::size_t kNames = 1000;
  mutable std::mutex mutex_;
  std::map<std::string, std::uint64_t> counts_;
};

}  // namespace mr::net
