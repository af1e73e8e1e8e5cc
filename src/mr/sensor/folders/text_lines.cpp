#include "mr/sensor/folders/text_lines.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdint>

#include "mr/core/file.h"

namespace mr::sensor {
namespace {

constexpr const char* kBetweenWords = " \t\r,";

/// A decimal number as its digits: 0.d1d2d3… times ten to the power `point`.
struct Decimal {
  std::string digits;
  int point = 0;
};

/// Nothing for what is no decimal number, or one of over 60 digits or a power beyond ± 99.
std::optional<Decimal> decimal_of(std::string_view word) {
  constexpr std::size_t kMostDigits = 60;
  Decimal out;
  bool has_point = false;
  std::size_t at = 0;
  for (; at < word.size() && (word[at] == '.' || (word[at] >= '0' && word[at] <= '9')); ++at) {
    if (word[at] == '.' && has_point) return std::nullopt;
    if (word[at] == '.')
      has_point = true;
    else
      out.digits += word[at], out.point += has_point ? 0 : 1;
  }
  if (out.digits.empty() || out.digits.size() > kMostDigits) return std::nullopt;
  if (at == word.size()) return out;
  if (word[at] != 'e' && word[at] != 'E') return std::nullopt;
  word.remove_prefix(at + 1);
  if (word.starts_with('+')) word.remove_prefix(1);
  int power = 0;
  const auto [stop, error] = std::from_chars(word.data(), word.data() + word.size(), power);
  if (error != std::errc() || stop != word.data() + word.size() || power < -99 || power > 99)
    return std::nullopt;
  out.point += power;
  return out;
}

}  // namespace

bool TextLines::next() {
  while (!rest_.empty()) {
    const std::size_t end = std::min(rest_.find('\n'), rest_.size());
    const std::string_view line = rest_.substr(0, end);
    rest_.remove_prefix(std::min(end + 1, rest_.size()));
    ++number_;
    words_.clear();
    std::size_t at = line.find_first_not_of(kBetweenWords);
    if (at == std::string_view::npos || line[at] == '#') continue;
    while (at != std::string_view::npos) {
      const std::size_t stop = std::min(line.find_first_of(kBetweenWords, at), line.size());
      words_.push_back(line.substr(at, stop - at));
      at = line.find_first_not_of(kBetweenWords, stop);
    }
    return true;
  }
  return false;
}

std::optional<double> number_of(std::string_view word) {
  if (word.starts_with('+')) word.remove_prefix(1);
  if (word.find(".#") < 3) return std::nan("");  // as Windows writes it: -1.#IND
  double value = 0;
  const auto [stop, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (error != std::errc() || stop != word.data() + word.size()) return std::nullopt;
  return value;
}

std::optional<TimePoint> time_of_seconds(std::string_view word) {
  constexpr std::int64_t kMost_ns = std::int64_t{1} << 61;
  constexpr int kNanosecondDigits = 9;
  const bool is_negative = word.starts_with('-');
  if (is_negative || word.starts_with('+')) word.remove_prefix(1);
  const auto decimal = decimal_of(word);
  if (!decimal) return std::nullopt;
  const auto digit = [&](int at) {
    const bool is_there = at >= 0 && at < static_cast<int>(decimal->digits.size());
    return is_there ? decimal->digits[static_cast<std::size_t>(at)] - '0' : 0;
  };
  const int wanted = decimal->point + kNanosecondDigits;  // digits before the nanosecond's end
  std::int64_t ns = 0;
  for (int at = 0; at < wanted; ++at) {
    if (ns > (kMost_ns - digit(at)) / 10) return std::nullopt;
    ns = ns * 10 + digit(at);
  }
  if (digit(wanted) >= 5) ++ns;
  return TimePoint(Duration(is_negative ? -ns : ns));
}

Result<std::string> read_text_file(const std::filesystem::path& file, std::size_t max_bytes) {
  const auto bytes = read_file(file, max_bytes);
  if (!bytes) return bytes.error();
  return std::string(reinterpret_cast<const char*>(bytes->data()), bytes->size());
}

bool is_json_with_key(const std::filesystem::path& file, std::string_view key) {
  std::error_code failed;
  if (file.extension() != ".json" || !std::filesystem::is_regular_file(file, failed)) return false;
  const auto text = read_text_file(file, std::size_t{1} << 20);
  return text && text->find('"' + std::string(key) + '"') != std::string::npos;
}

}  // namespace mr::sensor
