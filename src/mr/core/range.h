#pragma once

#include <initializer_list>
#include <string>
#include <string_view>
#include <vector>

/// Limits of configuration values: each is declared once, beside its field, and checked for scene
/// files and for scenes built in C++.
namespace mr {

/// An interval of allowed numbers: [low, high], or (low, high] when `low_open`.
struct Range {
  double low, high;
  bool low_open = false;

  /// False for NaN.
  bool contains(double value) const {
    return (low_open ? value > low : value >= low) && value <= high;
  }
};

/// The shortest decimal form: "0.5", "30".
std::string number_text(double value);
/// "must be between 0 and 1", "must be greater than 0 and at most 1".
std::string to_string(const Range& range);

/// A named configuration value with its limits.
struct LimitedValue {
  template <typename Number>
  LimitedValue(std::string_view key, Number number, const Range& limits)
      : name(key), value(static_cast<double>(number)), range(limits) {}

  std::string_view name;
  double value;
  Range range;
};

/// One line for each value outside its range: "ratio must be between …, not 2".
std::vector<std::string> out_of_range(std::initializer_list<LimitedValue> values);

/// Puts `prefix` before each line.
std::vector<std::string> prefixed(std::string_view prefix, std::vector<std::string> lines);

/// Moves lines to the end of others.
void append(std::vector<std::string>& lines, std::vector<std::string> more);

}  // namespace mr
