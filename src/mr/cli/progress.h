#pragma once

#include <chrono>
#include <cstddef>
#include <string>

namespace mr::cli {

/// "stream [=====>    ] 12/90, 1 min 20 s left" on stderr once two seconds have passed: one line
/// that changes on a terminal, else a new line every half minute. Gone when it goes out of scope.
class ProgressBar {
 public:
  ~ProgressBar() { hide(); }
  void show(const std::string& step, std::size_t done, std::size_t of);
  /// Prints a line above the bar.
  void say(const std::string& line);
  /// Removes the bar until it is shown again.
  void hide();

 private:
  using Clock = std::chrono::steady_clock;
  const Clock::time_point start_ = Clock::now();
  Clock::time_point step_start_ = start_, shown_at_ = start_;
  std::string step_;
  std::size_t step_first_ = 0;
  bool shown_ = false;
};

}  // namespace mr::cli
