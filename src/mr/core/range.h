#pragma once

#include <initializer_list>
#include <string>
#include <string_view>
#include <vector>

/// The limits of configs: stated once, beside the field, for scene files and for scenes made in
/// C++.
namespace mr {

/// The numbers that are allowed: [low, high], or (low, high] when `low_open`.
struct Range {
  double low, high;
  bool low_open = false;

  /// False for NaN.
  bool contains(double value) const {
    return (low_open ? value > low : value >= low) && value <= high;
  }
};

/// As short as it can be written: "0.5", "30".
std::string number_text(double value);
/// "must be between 0 and 1", "must be greater than 0 and at most 1".
std::string to_string(const Range& range);

/// A number of a config beside its limits.
struct LimitedValue {
  template <typename Number>
  LimitedValue(std::string_view key, Number number, const Range& limits)
      : name(key), value(static_cast<double>(number)), range(limits) {}

  std::string_view name;
  double value;
  Range range;
};

/// A line for each value that its range does not contain: "ratio must be between …, not 2".
std::vector<std::string> out_of_range(std::initializer_list<LimitedValue> values);

/// Puts `prefix` before each line.
std::vector<std::string> prefixed(std::string_view prefix, std::vector<std::string> lines);

/// Moves lines to the end of others.
void append(std::vector<std::string>& lines, std::vector<std::string> more);

}  // namespace mr
