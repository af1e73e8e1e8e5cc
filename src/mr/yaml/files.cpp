#include "mr/yaml/files.h"

#include <algorithm>

namespace mr::yaml {
namespace {

constexpr int kMaxItems = 100'000;

/// What keeps a path from being read as a file; empty when nothing does.
std::string file_problem(const std::filesystem::path& path) {
  std::error_code failed;
  const auto status = std::filesystem::status(path, failed);
  if (!std::filesystem::exists(status)) return "no such file: " + in_quotes(path.string());
  if (std::filesystem::is_directory(status))
    return in_quotes(path.string()) + " is a folder, not a file";
  if (!std::filesystem::is_regular_file(status))
    return in_quotes(path.string()) + " is not a regular file";
  return {};
}

/// " (its folder is empty)" and the like, for a pattern that names no file at all.
std::string folder_hint(const std::filesystem::path& path) {
  std::error_code failed;
  const std::filesystem::path folder = path.has_parent_path() ? path.parent_path() : ".";
  if (!std::filesystem::is_directory(folder, failed))
    return " (folder " + in_quotes(folder.string()) + " does not exist)";
  if (std::filesystem::is_empty(folder, failed) && !failed)
    return " (folder " + in_quotes(folder.string()) + " is empty)";
  return {};
}

/// Looks at a list's files. Where none can be used, that is a problem; else those that cannot are
/// noted in the list. `named`: by a pattern, as the scene file writes it.
void check_files(Report& report, FileList& list, const std::string& name,
                 const std::vector<const Node*>& named) {
  for (std::size_t i = 0; i < list.paths.size(); ++i)
    if (const std::string problem = file_problem(list.paths[i]); !problem.empty())
      list.unusable[i] = {
          problem.starts_with("no such") ? Error::Cause::not_found : Error::Cause::invalid,
          problem};
  if (list.unusable.size() < list.paths.size() || list.paths.empty()) return;
  if (list.is_pattern)
    return report.missing_files(
        list.lines.front(),
        name + ": none of the " + std::to_string(list.paths.size()) +
            " files of the pattern exists; first: " + list.unusable.begin()->second.message +
            folder_hint(list.paths.front()),
        list.paths.front(), list.paths.size(), named.front()->text);
  for (const auto& [i, error] : list.unusable)
    report.missing_files(list.lines[i], name + ": " + error.message, list.paths[i], 1,
                         named[i]->text);
}

/// One file or more, by name; nothing where a name is wrong.
std::optional<FileList> list_files(Report& report, const std::vector<const Node*>& items,
                                   const std::string& name) {
  FileList list;
  for (const Node* item : items) {
    const auto text = read_text(report, *item, name);
    if (text && text->empty()) report.problem(item->line, name + " must name a file, not ''");
    if (!text || text->empty()) continue;
    list.paths.push_back(report.resolve(*text));
    list.lines.push_back(item->line);
  }
  if (list.paths.size() < items.size()) return std::nullopt;
  check_files(report, list, name, items);
  return list;
}

}  // namespace

std::string NumberedPattern::name(int number) const {
  const std::string text = std::to_string(number);
  const std::size_t zeros = digits > text.size() ? digits - text.size() : 0;
  return before + std::string(zeros, '0') + text + after;
}

std::optional<NumberedPattern> parse_pattern(const std::string& text) {
  NumberedPattern pattern;
  const std::size_t percent = text.find('%');
  if (percent == std::string::npos || text.find('%', percent + 1) != std::string::npos)
    return std::nullopt;
  std::size_t at = percent + 1;
  if (at + 1 < text.size() && text[at] == '0' && text[at + 1] >= '1' && text[at + 1] <= '9')
    pattern.digits = static_cast<std::size_t>(text[at + 1] - '0'), at += 2;
  if (at >= text.size() || text[at] != 'd') return std::nullopt;
  pattern.before = text.substr(0, percent);
  pattern.after = text.substr(at + 1);
  return pattern;
}

std::optional<FileList> read_pattern(MapReader& map, const std::string& name) {
  std::string text;
  int first = 0, last = 0;
  const bool has_range = (map.need("first") != nullptr) & (map.need("last") != nullptr);
  const bool good =
      map.integer("first", first, {0, 999'999'999}) & map.integer("last", last, {0, 999'999'999});
  if (!map.need("pattern") || !map.text("pattern", text)) return std::nullopt;
  const int line = map.line("pattern");
  const auto pattern = parse_pattern(text);
  if (!pattern)
    map.report.problem(
        line, "pattern must hold " + std::string(kPatternRule) + ", not " + in_quotes(text));
  if (!pattern || !has_range || !good) return std::nullopt;
  if (last < first) {
    map.report.problem(map.line("last"), "last must not be less than first");
    return std::nullopt;
  }
  if (last - first >= kMaxItems ||
      !map.report.spend_files(static_cast<std::size_t>(last - first))) {
    map.report.problem(map.line("last"), "too many files: at most " + std::to_string(kMaxItems) +
                                             " a pattern and 1000000 a scene");
    return std::nullopt;
  }
  FileList list;
  list.is_pattern = true;
  for (int i = first; i <= last; ++i) list.paths.push_back(map.report.resolve(pattern->name(i)));
  list.lines.assign(list.paths.size(), line);
  check_files(map.report, list, name, {map.find("pattern")});
  return list;
}

std::optional<FileList> read_files(Report& report, const Node& node, const std::string& name) {
  if (node.kind == Node::Kind::map) {
    MapReader map(report, node, name);
    return read_pattern(map, name);
  }
  if (node.kind != Node::Kind::list) return list_files(report, {&node}, name);
  if (node.items.empty()) {
    report.problem(node.line, name + " must name at least one file");
    return std::nullopt;
  }
  std::vector<const Node*> items;
  for (const Node& item : node.items) items.push_back(&item);
  return list_files(report, items, name);
}

std::optional<FileList> read_one_file(Report& report, const Node& node, const std::string& name) {
  return list_files(report, {&node}, name);
}

void report_unusable(Report& report, const FileList& list, const std::string& key) {
  const std::size_t bad = list.unusable.size();
  if (bad == 0 || bad == list.paths.size()) return;
  const bool missing = std::ranges::all_of(
      list.unusable, [](const auto& one) { return one.second.cause == Error::Cause::not_found; });
  const auto& [first, error] = *list.unusable.begin();
  report.notice(list.lines[first],
                key + ": " + std::to_string(bad) + " of the " + std::to_string(list.paths.size()) +
                    " files of the " + (list.is_pattern ? "pattern" : "list") +
                    (!missing   ? " cannot be used"
                     : bad == 1 ? " is missing"
                                : " are missing") +
                    (bad == 1 ? ", its frame is lost: " : ", their frames are lost; first: ") +
                    error.message);
}

bool read_secret_source(MapReader& map, const std::string& key, SecretSource& out) {
  const Node* node = map.find(key);
  if (!node) return false;
  const auto refuse = [&](int line, const std::string& why) {
    map.report.problem(line, key + why);
    return false;
  };
  constexpr const char* kWrite = "write {env: NAME} or {file: PATH}, which says where it stands";
  if (node->kind == Node::Kind::scalar)
    return refuse(node->line, std::string(" must not stand in the scene file; ") + kWrite);
  MapReader source(map.report, *node, key);
  const bool env = source.has("env"), file = source.has("file");
  if (node->kind != Node::Kind::map) return false;  // already reported
  if (env == file)
    return refuse(map.line(key), std::string(" needs either env or file; ") + kWrite);
  std::string text;
  if (!source.text(env ? "env" : "file", text)) return false;
  if (env && !is_variable_name(text))
    return refuse(source.line("env"), ".env is not the name of an environment variable");
  if (file && text.empty()) return refuse(source.line("file"), ".file must name a file, not ''");
  out = env ? SecretSource{text, {}} : SecretSource{{}, map.report.resolve(text)};
  return true;
}

}  // namespace mr::yaml
