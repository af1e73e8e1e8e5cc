#pragma once

#include <chrono>
#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <utility>

namespace mr::net {

/// A log that writes each distinct line at most once a minute, so that peers cannot fill it (at
/// most 100 distinct lines a minute). Thread-safe.
class RateLimitedLog {
 public:
  using TimePoint = std::chrono::steady_clock::time_point;

  explicit RateLimitedLog(std::function<void(const std::string&)> log) : write_(std::move(log)) {}

  void log(const std::string& line, TimePoint now) {
    {
      const std::lock_guard lock(mutex_);
      if (logged_.size() >= kLines)
        std::erase_if(logged_, [&](const auto& entry) { return now - entry.second >= kAgain; });
      if (logged_.size() >= kLines && !logged_.contains(line)) return;
      const auto [entry, is_new] = logged_.emplace(line, now);
      if (!is_new && now - entry->second < kAgain) return;
      entry->second = now;
    }
    if (write_) write_(line);
  }

 private:
  static constexpr std::chrono::minutes kAgain{1};
  static constexpr std::size_t kLines = 100;
  const std::function<void(const std::string&)> write_;
  std::mutex mutex_;
  std::map<std::string, TimePoint> logged_;
};

/// The log line for a node name that another program uses, too.
inline std::string duplicate_node_line(const std::string& node) {
  return "node '" + node + "': another program runs under this name, too; stop one of them";
}
inline constexpr const char* kDuplicateNodeCause = "another program of this name";

}  // namespace mr::net
