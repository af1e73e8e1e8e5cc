#pragma once

#include <chrono>
#include <functional>
#include <map>
#include <mutex>
#include <string>

#include "mr/net/drops.h"

namespace mr::net {

/// Tells that another program runs under a node's name: at once, and then once a minute while it
/// lasts. Thread-safe.
class Rivals {
 public:
  using TimePoint = std::chrono::steady_clock::time_point;

  Rivals(std::function<void(const std::string&)> log, Drops& drops)
      : log_(std::move(log)), drops_(drops) {}

  void heard(const std::string& node, TimePoint now) {
    drops_.count("node " + node, "another program of this name");
    {
      const std::lock_guard lock(mutex_);
      const auto [told, is_new] = told_.emplace(node, now);
      if (!is_new && now - told->second < kAgain) return;
      told->second = now;
    }
    if (log_)
      log_("node '" + node + "': another program runs under this name, too; stop one of them");
  }

 private:
  static constexpr std::chrono::minutes kAgain{1};
  const std::function<void(const std::string&)> log_;
  Drops& drops_;
  std::mutex mutex_;
  std::map<std::string, TimePoint> told_;  ///< by node, of which this program has few
};

}  // namespace mr::net
