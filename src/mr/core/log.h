#pragma once

#include <functional>
#include <string>

namespace mr {

enum class LogLevel { info, warning, error };

/// One line of the log.
struct LogLine {
  LogLevel level = LogLevel::info;
  std::string node;  ///< origin: a sensor, a merger, "gateway"; empty: the program
  std::string text;
};

/// Sink of log lines. Called from any thread; must not block for long.
using Log = std::function<void(const LogLine&)>;

}  // namespace mr
