#include "mr/core/user_text.h"

#include <algorithm>
#include <span>

namespace mr {
namespace {

constexpr std::size_t kMaxShown = 160;

/// Edits (insert, drop, replace a letter) between two short words.
std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  for (std::size_t j = 0; j < row.size(); ++j) row[j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t replace = diagonal + (a[i - 1] != b[j - 1]);
      diagonal = row[j];
      row[j] = std::min({replace, row[j] + 1, row[j - 1] + 1});
    }
  }
  return row.back();
}

}  // namespace

std::string in_quotes(std::string_view text) {
  std::string out(text.substr(0, kMaxShown));
  for (char& c : out)
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) c = '?';
  return "'" + out + (text.size() > kMaxShown ? "...'" : "'");
}

std::string one_line(std::string_view text) {
  std::string out(text);
  for (char& c : out)
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) c = ' ';
  return out;
}

std::string did_you_mean(std::string_view word, const std::vector<std::string>& known) {
  constexpr std::size_t kMaxWord = 32, kMaxKnown = 256;
  std::size_t best = std::clamp<std::size_t>(word.size() / 2, 1, 3) + 1;
  const std::string* nearest = nullptr;
  if (word.size() <= kMaxWord)
    for (const std::string& candidate : std::span(known).first(std::min(known.size(), kMaxKnown))) {
      if (candidate.size() > kMaxWord) continue;
      const std::size_t distance = edit_distance(word, candidate);
      if (distance < best) best = distance, nearest = &candidate;
    }
  return nearest ? " (did you mean " + in_quotes(*nearest) + "?)" : "";
}

}  // namespace mr
