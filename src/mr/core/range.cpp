#include "mr/core/range.h"

#include <cstdio>
#include <iterator>
#include <utility>

namespace mr {

std::string number_text(double v) {
  char text[32];
  std::snprintf(text, sizeof text, "%.9g", v);
  return text;
}

std::string to_string(const Range& range) {
  if (range.low_open)
    return "must be greater than " + number_text(range.low) + " and at most " +
           number_text(range.high);
  return "must be between " + number_text(range.low) + " and " + number_text(range.high);
}

std::vector<std::string> out_of_range(std::initializer_list<LimitedValue> values) {
  std::vector<std::string> out;
  for (const LimitedValue& of : values)
    if (!of.range.contains(of.value))
      out.push_back(std::string(of.name) + " " + to_string(of.range) + ", not " +
                    number_text(of.value));
  return out;
}

std::vector<std::string> prefixed(std::string_view prefix, std::vector<std::string> lines) {
  for (std::string& line : lines) line.insert(0, prefix);
  return lines;
}

void append(std::vector<std::string>& lines, std::vector<std::string> more) {
  lines.insert(lines.end(), std::make_move_iterator(more.begin()),
               std::make_move_iterator(more.end()));
}

}  // namespace mr
