#include "mr/sensor/folders/numbered_files.h"

#include <algorithm>
#include <charconv>
#include <optional>
#include <utility>

#include "mr/core/assert.h"
#include "mr/yaml/files.h"
#include "mr/yaml/flow_text.h"

namespace mr::sensor {
namespace {

constexpr std::size_t kMostFiles = 100'000, kMostDigits = 9;

bool is_digit(char c) { return c >= '0' && c <= '9'; }

std::optional<int> whole_number(std::string_view digits) {
  if (digits.empty() || digits.size() > kMostDigits ||
      !std::all_of(digits.begin(), digits.end(), is_digit))
    return std::nullopt;
  int value = 0;
  std::from_chars(digits.data(), digits.data() + digits.size(), value);
  return value;
}

/// A path as what stands before and after the last number of the file's name.
struct SplitPath {
  std::string before, digits, after;
};

std::optional<SplitPath> split(const std::filesystem::path& path) {
  const std::string name = path.filename().string();
  std::size_t end = std::min(name.rfind('.'), name.size());
  while (end > 0 && !is_digit(name[end - 1])) --end;
  std::size_t begin = end;
  while (begin > 0 && is_digit(name[begin - 1])) --begin;
  if (begin == end || end - begin > kMostDigits) return std::nullopt;
  const std::string whole = path.string();
  const std::size_t folder = whole.size() - name.size();
  return SplitPath{whole.substr(0, folder + begin), name.substr(begin, end - begin),
                   name.substr(end)};
}

/// The pattern that names exactly these files, with the first number.
std::optional<std::pair<yaml::NumberedPattern, int>> pattern_of(
    const std::vector<std::filesystem::path>& files) {
  const auto first = split(files.front());
  if (!first || first->before.find('%') != std::string::npos ||
      first->after.find('%') != std::string::npos)
    return std::nullopt;
  const int number = *whole_number(first->digits);
  const bool has_zeros = std::to_string(number).size() < first->digits.size() || files.size() == 1;
  for (const std::size_t digits : {has_zeros ? first->digits.size() : 0, first->digits.size()}) {
    const yaml::NumberedPattern pattern{first->before, first->after, digits};
    bool fits = true;
    for (std::size_t i = 0; i < files.size() && fits; ++i)
      fits = pattern.name(number + static_cast<int>(i)) == files[i].string();
    if (fits) return std::pair(pattern, number);
  }
  return std::nullopt;
}

}  // namespace

NumberedFiles numbered_files(const std::filesystem::path& folder, std::string_view before,
                             std::initializer_list<std::string_view> after) {
  NumberedFiles out;
  std::error_code failed;
  for (std::filesystem::directory_iterator at(folder, failed), end; !failed && at != end;
       at.increment(failed)) {
    const std::string name = at->path().filename().string();
    if (!name.starts_with(before)) continue;
    for (const std::string_view ending : after) {
      if (!name.ends_with(ending) || name.size() <= before.size() + ending.size()) continue;
      const auto number = whole_number(std::string_view(name).substr(
          before.size(), name.size() - before.size() - ending.size()));
      if (number && out.size() < kMostFiles) out.emplace(*number, at->path());
    }
  }
  return out;
}

std::vector<std::filesystem::path> files_of_items(const NumberedFiles& items,
                                                  const NumberedFiles& files,
                                                  std::size_t& missing) {
  std::vector<std::filesystem::path> out;
  if (files.empty()) return out;
  const auto like = split(files.begin()->second);
  MR_ASSERT(like.has_value());
  const std::size_t digits = like->digits.size();
  const bool has_zeros = std::to_string(files.begin()->first).size() < digits;
  const yaml::NumberedPattern pattern{like->before, like->after, has_zeros ? digits : 0};
  for (const auto& [number, item] : items) {
    const auto found = files.find(number);
    if (found == files.end()) ++missing;
    out.push_back(found == files.end() ? std::filesystem::path(pattern.name(number))
                                       : found->second);
  }
  return out;
}

std::string files_text(const std::vector<std::filesystem::path>& files) {
  MR_ASSERT(!files.empty());
  const auto pattern = files.size() > 1 ? pattern_of(files) : std::nullopt;
  if (pattern) {
    const auto& [names, first] = *pattern;
    const std::string number = names.digits > 0 ? "%0" + std::to_string(names.digits) + "d" : "%d";
    return "{pattern: " + yaml::quoted_text(names.before + number + names.after) +
           ", first: " + std::to_string(first) +
           ", last: " + std::to_string(first + static_cast<int>(files.size()) - 1) + "}";
  }
  std::string out = "[";
  for (const auto& file : files)
    out += (out.size() == 1 ? "" : ", ") + yaml::quoted_text(file.string());
  return out + "]";
}

}  // namespace mr::sensor
