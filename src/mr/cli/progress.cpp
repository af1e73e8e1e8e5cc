#include "mr/cli/progress.h"

#include <fmt/format.h>
#include <unistd.h>

#include <cstdio>
#include <utility>

namespace mr::cli {
namespace {

using Seconds = std::chrono::duration<double>;

std::string for_people(double seconds) {
  const int s = static_cast<int>(seconds + 0.5);
  return s < 60 ? fmt::format("{} s", s) : fmt::format("{} min {} s", s / 60, s % 60);
}

}  // namespace

void ProgressBar::show(const std::string& step, std::size_t done, std::size_t of) {
  const auto now = Clock::now();
  if (std::exchange(step_, step) != step || done < step_first_)
    step_start_ = now, step_first_ = done;
  if (now - start_ < std::chrono::seconds(2)) return;
  const bool terminal = isatty(STDERR_FILENO);
  if (!terminal && now - shown_at_ < std::chrono::seconds(30)) return;
  shown_at_ = now;
  constexpr std::size_t kWidth = 30;
  const std::size_t filled = of > 0 ? kWidth * done / of : 0;
  std::string left;
  if (done > step_first_ && done < of)
    left = ", " +
           for_people(Seconds(now - step_start_).count() * static_cast<double>(of - done) /
                      static_cast<double>(done - step_first_)) +
           " left";
  fmt::print(stderr, "{}{} [{:=<{}}>{: <{}}] {}/{}{}{}", terminal ? "\r\x1b[K" : "", step, "",
             filled, "", kWidth - filled, done, of, left, terminal ? "" : "\n");
  std::fflush(stderr);
  shown_ = terminal;
}

void ProgressBar::say(const std::string& line) {
  hide();
  fmt::print(stderr, "{}\n", line);
}

void ProgressBar::hide() {
  if (std::exchange(shown_, false)) std::fputs("\r\x1b[K", stderr);
}

}  // namespace mr::cli
