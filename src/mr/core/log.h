#pragma once

#include <functional>
#include <string>

namespace mr {

enum class LogLevel { info, warning, error };

/// One line for people.
struct LogLine {
  LogLevel level = LogLevel::info;
  std::string node;  ///< who says it: a sensor, a merger, "gateway"; empty: the program
  std::string text;
};

/// Takes lines from any thread; must not wait for long.
using Log = std::function<void(const LogLine&)>;

}  // namespace mr
