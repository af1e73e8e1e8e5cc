#pragma once

#include <chrono>
#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <utility>

namespace mr::net {

/// Lines of which each is told at once, and then once a minute while there is reason to. So nobody
/// outside can fill a log. Thread-safe.
class RareLog {
 public:
  using TimePoint = std::chrono::steady_clock::time_point;

  explicit RareLog(std::function<void(const std::string&)> log) : log_(std::move(log)) {}

  void tell(const std::string& line, TimePoint now) {
    {
      const std::lock_guard lock(mutex_);
      if (told_.size() >= kLines)
        std::erase_if(told_, [&](const auto& entry) { return now - entry.second >= kAgain; });
      if (told_.size() >= kLines && !told_.contains(line)) return;
      const auto [told, is_new] = told_.emplace(line, now);
      if (!is_new && now - told->second < kAgain) return;
      told->second = now;
    }
    if (log_) log_(line);
  }

 private:
  static constexpr std::chrono::minutes kAgain{1};
  static constexpr std::size_t kLines = 100;
  const std::function<void(const std::string&)> log_;
  std::mutex mutex_;
  std::map<std::string, TimePoint> told_;
};

/// That another program runs under a node's name.
inline std::string rival_line(const std::string& node) {
  return "node '" + node + "': another program runs under this name, too; stop one of them";
}
inline constexpr const char* kRivalCause = "another program of this name";

}  // namespace mr::net
