#include "mr/yaml/map_reader.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <map>

namespace mr::yaml {
namespace {

constexpr std::size_t kMaxProblems = 1000;
constexpr std::size_t kMaxFiles = 1'000'000;

const char* kind_name(Node::Kind kind) {
  constexpr const char* kNames[] = {"empty", "a single value", "a list", "a mapping"};
  return kNames[static_cast<int>(kind)];
}

/// Replaces ${NAME} and ${NAME:-default} once; what they bring in is not expanded again.
std::optional<std::string> expand(Report& report, int line, const std::string& text) {
  std::string out;
  std::size_t at = 0;
  for (;;) {
    const std::size_t open = text.find("${", at);
    out.append(text, at, open == std::string::npos ? open : open - at);
    if (open == std::string::npos) return out;
    const std::size_t close = text.find('}', open);
    if (close == std::string::npos) {
      report.problem(line, "${ without } in " + in_quotes(text));
      return std::nullopt;
    }
    const std::string inside = text.substr(open + 2, close - open - 2);
    const std::size_t dash = inside.find(":-");
    const std::string name = inside.substr(0, dash);
    if (!is_variable_name(name)) {
      report.problem(line, in_quotes(name) + " is not the name of an environment variable, in " +
                               in_quotes(text));
      return std::nullopt;
    }
    const char* value = std::getenv(name.c_str());
    if (dash != std::string::npos && (!value || !*value))
      out += inside.substr(dash + 2);
    else if (value)
      out += value;
    else {
      report.unset_variable(line, name);
      return std::nullopt;
    }
    at = close + 1;
  }
}

/// The highest folder on the way to a file that does not exist; empty where its own folder does.
std::filesystem::path missing_folder(const std::filesystem::path& file) {
  std::filesystem::path missing;
  std::error_code failed;
  for (auto at = file.parent_path(); !at.empty() && !std::filesystem::exists(at, failed);
       at = at.parent_path())
    missing = at;
  return missing;
}

/// What may help where a path with a variable, such as "${DATA}/room/0.png", leads nowhere.
std::string remedy(const std::string& written) {
  const std::size_t open = written.find("${"), close = written.find('}', open);
  if (open == std::string::npos || close == std::string::npos) return {};
  const std::string inside = written.substr(open + 2, close - open - 2);
  const std::string name = inside.substr(0, inside.find(":-"));
  const std::string rest = written.substr(close + 1);
  const std::size_t end = rest.find('/', 1);
  if (!rest.starts_with('/') || end == std::string::npos) return "; set " + name;
  return "; set " + name + " to the folder that holds " + in_quotes(rest.substr(1, end - 1));
}

/// Reads a decimal number; says what is wrong with it otherwise.
struct Number {
  double value = 0;
  const char* problem = nullptr;
};

Number parse_number(std::string_view text) {
  if (!text.empty() && (text[0] == '+' || text[0] == '-')) {
    const bool minus = text[0] == '-';
    if (text.size() > 1 && (text[1] == '+' || text[1] == '-')) return {0, "must be a number"};
    Number n = parse_number(text.substr(1));
    if (minus) n.value = -n.value;
    return n;
  }
  std::string lower(text.substr(0, 8));
  for (char& c : lower) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c + ('a' - 'A')) : c;
  if (lower == ".inf" || lower == ".nan" || lower == "inf" || lower == "nan" || lower == "infinity")
    return {0, "must be a finite number"};
  const auto digit = [&](std::size_t i) {
    return i < text.size() && text[i] >= '0' && text[i] <= '9';
  };
  if (!digit(0) && !(text.starts_with('.') && digit(1))) return {0, "must be a number"};
  if (text[0] == '0' && digit(1)) return {0, "must be a number without leading zeros"};
  Number n;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), n.value);
  if (end != text.data() + text.size()) return {0, "must be a number"};
  if (error != std::errc() || !std::isfinite(n.value)) return {0, "must be a finite number"};
  return n;
}

}  // namespace

void Report::problem(int line, std::string message) {
  if (full()) return;
  if (problems_.size() + 1 == kMaxProblems)
    message = "more problems follow; the first " + std::to_string(kMaxProblems - 1) + " are listed";
  problems_.push_back({file_, line, std::move(message)});
}

void Report::unset_variable(int line, const std::string& name) {
  if (unset_.insert(name).second)
    problem(line, "environment variable " + name + " is not set; set it or write ${" + name +
                      ":-default}");
}

void Report::missing_files(int line, std::string message, const std::filesystem::path& first,
                           std::size_t count, const std::string& written) {
  const std::filesystem::path folder = missing_folder(first);
  if (folder.empty()) return problem(line, std::move(message));
  MissingFolder& missing = missing_[folder];
  if (missing.reported++ == 0)
    missing.line = line, missing.message = std::move(message), missing.remedy = remedy(written);
  missing.files += count;
}

void Report::notice(int line, std::string message) {
  if (notices_.size() < kMaxProblems) notices_.push_back({file_, line, std::move(message)});
}

bool Report::full() const { return problems_.size() >= kMaxProblems; }

std::filesystem::path Report::resolve(const std::string& path) const {
  return (file_.parent_path() / path).lexically_normal();
}

bool Report::spend_files(std::size_t count) {
  files_ += count;
  return files_ <= kMaxFiles;
}

/// What was set comes first, in its order.
std::vector<Problem> Report::by_line(std::vector<Problem> list) const {
  std::stable_sort(list.begin(), list.end(),
                   [](const Problem& a, const Problem& b) { return a.line < b.line; });
  for (Problem& entry : list)
    if (entry.line < 0) entry.option = options_[entry.line + options_.size()], entry.line = 0;
  return list;
}

std::vector<Problem> Report::take_problems() {
  for (const auto& [folder, missing] : std::exchange(missing_, {}))
    problem(missing.line, (missing.reported == 1 ? missing.message
                                                 : "no folder " + in_quotes(folder.string()) +
                                                       ", where " + std::to_string(missing.files) +
                                                       " files of this scene should be") +
                              missing.remedy);
  return by_line(std::move(problems_));
}
std::vector<Problem> Report::take_notices() { return by_line(std::move(notices_)); }

std::string first_in(int line) {
  return line > 0 ? " (first in line " + std::to_string(line) + ")" : "";
}

std::optional<std::string> read_text(Report& report, const Node& node, const std::string& name) {
  if (node.kind != Node::Kind::scalar) {
    report.problem(node.line, name + (node.kind == Node::Kind::null
                                          ? " is empty"
                                          : std::string(" must be a single value, not ") +
                                                kind_name(node.kind)));
    return std::nullopt;
  }
  const std::optional<std::string> text = expand(report, node.line, node.text);
  if (!text) return std::nullopt;
  if (std::any_of(text->begin(), text->end(),
                  [](char c) { return static_cast<unsigned char>(c) < 0x20 || c == 0x7f; })) {
    report.problem(node.line, name + " holds a control character: " + in_quotes(*text));
    return std::nullopt;
  }
  return text;
}

std::optional<double> read_number(Report& report, const Node& node, const std::string& name,
                                  Range range) {
  const auto refuse = [&](const std::string& why) {
    report.problem(node.line, name + " " + why);
    return std::nullopt;
  };
  if (node.kind == Node::Kind::list || node.kind == Node::Kind::map)
    return refuse(std::string("must be a number, not ") + kind_name(node.kind));
  const std::optional<std::string> text = read_text(report, node, name);
  if (!text) return std::nullopt;
  if (node.quoted && *text == node.text)
    return refuse("must be a number, not the string " + in_quotes(*text));
  const Number number = parse_number(*text);
  if (number.problem) return refuse(number.problem + (", not " + in_quotes(*text)));
  if (!range.contains(number.value))
    return refuse(to_string(range) + ", not " + number_text(number.value));
  return number.value;
}

bool read_numbers(Report& report, const Node& node, const std::string& name, Range range,
                  std::span<double> out) {
  if (node.kind != Node::Kind::list || node.items.size() != out.size()) {
    const std::string is = node.kind == Node::Kind::list
                               ? std::to_string(node.items.size()) + " of them"
                               : kind_name(node.kind);
    report.problem(node.line, name + " must be a list of " + std::to_string(out.size()) +
                                  " numbers, not " + is);
    return false;
  }
  std::vector<double> values;
  for (const Node& item : node.items)
    if (const auto value = read_number(report, item, name, range)) values.push_back(*value);
  if (values.size() != out.size()) return false;
  std::copy(values.begin(), values.end(), out.begin());
  return true;
}

bool is_variable_name(std::string_view name) {
  const auto letter = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_';
  };
  if (name.empty() || !letter(name[0])) return false;
  return std::all_of(name.begin(), name.end(),
                     [&](char c) { return letter(c) || (c >= '0' && c <= '9'); });
}

std::optional<std::string> read_id(Report& report, const Node& node, const std::string& name) {
  const std::optional<std::string> id = read_text(report, node, name);
  if (!id) return std::nullopt;
  const bool good =
      !id->empty() && id->size() <= 64 && std::all_of(id->begin(), id->end(), [](char c) {
        return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
               c == '_' || c == '-';
      });
  if (!good)
    report.problem(node.line,
                   name + " must be 1 to 64 letters, digits, '_' or '-', not " + in_quotes(*id));
  return id;
}

namespace {

/// The key that was meant, else all that there are.
std::string known_keys(std::string_view word, const std::vector<std::string>& known) {
  const std::string guess = did_you_mean(word, known);
  constexpr std::size_t kMost = 40;
  if (!guess.empty() || known.empty() || known.size() > kMost) return guess;
  std::string list;
  for (const std::string& key : known) list += (list.empty() ? "" : ", ") + key;
  return "; known here: " + list;
}

}  // namespace

MapReader::MapReader(Report& r, const Node& node, std::string name)
    : report(r), node_(node), name_(std::move(name)) {
  if (node.kind != Node::Kind::map) {
    report.problem(node.line, name_ + (node.kind == Node::Kind::null
                                           ? " is empty"
                                           : std::string(" must be a mapping of keys, not ") +
                                                 kind_name(node.kind)));
    return;
  }
  std::map<std::string_view, int> first;
  for (const Key& key : node.keys) {
    const auto [known, is_new] = first.emplace(key.name, key.line);
    if (!is_new)
      report.problem(key.line,
                     "key " + in_quotes(key.name) + " is given twice" + first_in(known->second));
  }
}

void MapReader::not_acted_on(const std::string& key, const std::string& what) {
  report.notice(line(key), what + ": accepted, but not acted on by this version");
}

MapReader::~MapReader() {
  if (accept_all_) return;
  for (const Key& key : node_.keys) {
    if (report.full()) return;
    if (std::find(asked_.begin(), asked_.end(), key.name) != asked_.end()) continue;
    if (key.name == "<<")
      report.problem(key.line, "merge keys (<<) are not supported; write the keys out");
    else
      report.problem(key.line, "unknown key " + in_quotes(key.name) + known_keys(key.name, asked_));
  }
}

std::optional<std::size_t> MapReader::index(const std::string& key) const {
  for (std::size_t i = 0; i < node_.keys.size(); ++i)
    if (node_.keys[i].name == key) return i;
  return std::nullopt;
}

const Node* MapReader::find(const std::string& key) {
  if (std::find(asked_.begin(), asked_.end(), key) == asked_.end()) asked_.push_back(key);
  const auto i = index(key);
  return i ? &node_.items[*i] : nullptr;
}

const Node* MapReader::need(const std::string& key) {
  const Node* node = find(key);
  if (!node && node_.kind == Node::Kind::map)
    report.problem(node_.line, name_ + " lacks the key " + in_quotes(key));
  return node;
}

int MapReader::line(const std::string& key) const {
  const auto i = index(key);
  return i ? node_.keys[*i].line : node_.line;
}

bool MapReader::number(const std::string& key, double& out, Range range) {
  const Node* node = find(key);
  if (!node) return false;
  const auto value = read_number(report, *node, key, range);
  if (value) out = *value;
  return value.has_value();
}

bool MapReader::integer(const std::string& key, int& out, Range range) {
  double value = 0;
  if (!number(key, value, range)) return false;
  if (value != std::floor(value)) {
    report.problem(line(key), key + " must be a whole number, not " + number_text(value));
    return false;
  }
  out = static_cast<int>(value);
  return true;
}

bool MapReader::flag(const std::string& key, bool& out) {
  const Node* node = find(key);
  if (!node) return false;
  const auto value = read_text(report, *node, key);
  if (!value) return false;
  const bool is_word = *value == "true" || *value == "false";
  if (!is_word || (node->quoted && *value == node->text)) {
    report.problem(node->line, key + " must be true or false, not " + in_quotes(*value));
    return false;
  }
  out = *value == "true";
  return true;
}

bool MapReader::text(const std::string& key, std::string& out) {
  const Node* node = find(key);
  if (!node) return false;
  auto value = read_text(report, *node, key);
  if (value) out = std::move(*value);
  return value.has_value();
}

bool MapReader::numbers(const std::string& key, Range range, std::span<double> out) {
  const Node* node = find(key);
  return node && read_numbers(report, *node, key, range, out);
}

bool MapReader::size(const std::string& key, Range range, int& first, int& second) {
  double pair[2];
  if (!numbers(key, range, pair)) return false;
  if (pair[0] != std::floor(pair[0]) || pair[1] != std::floor(pair[1])) {
    report.problem(line(key), key + " must be whole numbers");
    return false;
  }
  first = static_cast<int>(pair[0]), second = static_cast<int>(pair[1]);
  return true;
}

void MapReader::refuse_choice(const std::string& key, const std::string& value,
                              const std::vector<std::string>& words) {
  std::string list;
  for (const std::string& word : words) list += (list.empty() ? "" : ", ") + word;
  report.problem(line(key), key + " must be one of " + list + "; not " + in_quotes(value));
}

}  // namespace mr::yaml
