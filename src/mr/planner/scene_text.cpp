#include "mr/planner/scene_text.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cstddef>
#include <set>
#include <utility>

namespace mr::planner {
namespace {

/// As it stands in YAML; words that mean something else there are quoted.
std::string in_yaml(const std::string& id) {
  std::string word;
  for (const char c : id) word += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  const std::set<std::string> special{"null", "true", "false", "yes", "no", "on", "off", "y", "n"};
  const bool plain = !id.empty() && std::isalpha(static_cast<unsigned char>(id.front()));
  return plain && !special.contains(word) ? id : "\"" + id + "\"";
}

}  // namespace

std::string mergers_block(const Plan& plan) {
  constexpr std::size_t kWidth = 100;
  std::string out = "mergers:\n";
  for (const PlannedMerger& merger : plan.mergers) {
    std::string line = "  - {id: " + in_yaml(merger.config.id) + ", inputs: [";
    for (std::size_t i = 0; i < merger.config.inputs.size(); ++i) {
      const std::string input =
          in_yaml(merger.config.inputs[i]) + (i + 1 < merger.config.inputs.size() ? "," : "]");
      if (line.size() + input.size() > kWidth) out += line + "\n", line = "     ";
      line += (i > 0 ? " " : "") + input;
    }
    out += line + fmt::format(", deadline_ms: {:.9g}", merger.config.deadline_ms);
    if (merger.config.budget_ms > 0)
      out += fmt::format(", budget_ms: {:.9g}", merger.config.budget_ms);
    if (const auto& r = merger.config.region)
      out += fmt::format(",\n     region: [[{:.9g}, {:.9g}, {:.9g}], [{:.9g}, {:.9g}, {:.9g}]]",
                         r->low.x, r->low.y, r->low.z, r->high.x, r->high.y, r->high.z);
    out += "}\n";
  }
  return out;
}

std::string with_mergers(std::string_view scene_text, const std::string& block) {
  std::string before, after, held;  // held: comments and blank lines, of what comes next
  enum { before_it, in_it, behind_it } place = before_it;
  for (std::size_t begin = 0; begin < scene_text.size();) {
    const std::size_t end = std::min(scene_text.find('\n', begin), scene_text.size() - 1) + 1;
    std::string line(scene_text.substr(begin, end - begin));
    if (line.back() != '\n') line += '\n';
    begin = end;
    const bool starts = line.starts_with("mergers:");
    const bool continues = line[0] == ' ' || line[0] == '\t' || line[0] == '-' || line[0] == ']';
    const bool silent = line[0] == '#' || line.find_first_not_of(" \t\r\n") == std::string::npos;
    if (place == before_it && starts)
      place = in_it;
    else if (place == in_it && silent)
      held += line;
    else if (place == in_it && continues)
      held.clear();
    else if (place == before_it)
      before += line;
    else
      place = behind_it, after += std::exchange(held, "") + line;
  }
  return before + block + held + after;
}

}  // namespace mr::planner
