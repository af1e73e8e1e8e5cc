#include <algorithm>
#include <charconv>

#include "mr/core/file.h"
#include "mr/core/scene_parts.h"

namespace mr::scene_file {
namespace {

constexpr int kMaxItems = 100'000;

/// A printf pattern with one %d or %0Nd, taken apart; the user's text never reaches printf.
struct Pattern {
  std::string before, after;
  std::size_t digits = 0;

  std::string name(int number) const {
    const std::string text = std::to_string(number);
    const std::size_t zeros = digits > text.size() ? digits - text.size() : 0;
    return before + std::string(zeros, '0') + text + after;
  }
};

std::optional<Pattern> parse_pattern(const std::string& text) {
  Pattern pattern;
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

void check_pattern_files(Report& report, const FileList& list, const std::string& name, int line,
                         const std::string& written) {
  std::string first;
  std::size_t bad = 0;
  for (const std::filesystem::path& path : list.paths) {
    const std::string problem = file_problem(path);
    if (!problem.empty() && bad++ == 0) first = problem;
  }
  if (bad == 0) return;
  const std::string total = std::to_string(list.paths.size());
  if (bad == list.paths.size())
    report.missing_files(line,
                         name + ": none of the " + total + " files of the pattern exists; first: " +
                             first + folder_hint(list.paths.front()),
                         list.paths.front(), bad, written);
  else
    report.problem(line, name + ": " + std::to_string(bad) + " of the " + total +
                             " files of the pattern cannot be used; first: " + first);
}

void add_file(Report& report, const YamlNode& node, const std::string& name, FileList& list) {
  const auto text = read_text(report, node, name);
  std::filesystem::path path;
  if (text && text->empty())
    report.problem(node.line, name + " must name a file, not ''");
  else if (text) {
    path = report.resolve(*text);
    const std::string problem = file_problem(path);
    if (!problem.empty())
      report.missing_files(node.line, name + ": " + problem, path, 1, node.text);
  }
  list.paths.push_back(std::move(path));
  list.lines.push_back(node.line);
}

/// A 4x4 matrix as text.
Result<Pose> read_pose_file(const std::filesystem::path& path) {
  constexpr std::uintmax_t kMaxBytes = 64 * 1024;
  const auto refuse = [&](const std::string& why) {
    return Error{Error::Cause::invalid, "pose file " + in_quotes(path.string()) + " " + why};
  };
  const auto bytes = read_file(path, kMaxBytes);
  if (!bytes) return bytes.error();
  const std::string_view text(reinterpret_cast<const char*>(bytes->data()), bytes->size());
  std::array<double, 16> matrix{};
  std::size_t count = 0, at = 0;
  constexpr const char* kSpace = " \t\r\n,";
  while ((at = text.find_first_not_of(kSpace, at)) != std::string_view::npos) {
    const std::size_t end = std::min(text.find_first_of(kSpace, at), text.size());
    double value = 0;
    const auto [stop, error] = std::from_chars(text.data() + at, text.data() + end, value);
    if (error != std::errc() || stop != text.data() + end)
      return refuse("holds " + in_quotes(text.substr(at, end - at)) + " where a number is wanted");
    if (count == matrix.size()) return refuse("holds more than 16 numbers");
    matrix[count++] = value;
    at = end;
  }
  if (count != matrix.size()) return refuse("holds " + std::to_string(count) + " numbers, not 16");
  auto pose = pose_from_matrix(matrix);
  if (!pose) return refuse("cannot be used: " + pose.error().message);
  return pose;
}

std::vector<Pose> load_poses(Report& report, const FileList& list, const std::string& name) {
  std::vector<Pose> poses;
  std::string first;
  std::size_t bad = 0;
  for (std::size_t i = 0; i < list.paths.size(); ++i) {
    poses.emplace_back();
    if (!file_problem(list.paths[i]).empty()) continue;  // listed already
    const auto pose = read_pose_file(list.paths[i]);
    if (pose) {
      poses.back() = *pose;
      continue;
    }
    if (!list.is_pattern)
      report.problem(list.lines[i], name + ": " + pose.error().message);
    else if (bad++ == 0)
      first = pose.error().message;
  }
  if (bad > 0)
    report.problem(list.lines.front(), name + ": " + std::to_string(bad) + " of the " +
                                           std::to_string(list.paths.size()) +
                                           " pose files cannot be used; first: " + first);
  return poses;
}

}  // namespace

std::optional<FileList> read_pattern(MapReader& map, const std::string& name) {
  std::string text;
  int first = 0, last = 0;
  const bool has_range = (map.need("first") != nullptr) & (map.need("last") != nullptr);
  const bool good =
      map.integer("first", first, 0, 999'999'999) & map.integer("last", last, 0, 999'999'999);
  if (!map.need("pattern") || !map.text("pattern", text)) return std::nullopt;
  const int line = map.line("pattern");
  const auto pattern = parse_pattern(text);
  if (!pattern)
    map.report.problem(
        line,
        "pattern must hold one %d or one of %01d to %09d and no other %, not " + in_quotes(text));
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
  check_pattern_files(map.report, list, name, line, map.find("pattern")->text);
  return list;
}

std::optional<FileList> read_files(Report& report, const YamlNode& node, const std::string& name) {
  if (node.kind == YamlNode::Kind::map) {
    MapReader map(report, node, name);
    return read_pattern(map, name);
  }
  FileList list;
  if (node.kind != YamlNode::Kind::list) {
    add_file(report, node, name, list);
    return list;
  }
  if (node.items.empty()) {
    report.problem(node.line, name + " must name at least one file");
    return std::nullopt;
  }
  for (const YamlNode& item : node.items) add_file(report, item, name, list);
  return list;
}

std::optional<Pose> read_pose(Report& report, const YamlNode& node, const std::string& name) {
  std::array<double, 16> matrix{};
  if (!read_numbers(report, node, name, {-1e6, 1e6}, matrix)) return std::nullopt;
  auto pose = pose_from_matrix(matrix);
  if (!pose) {
    report.problem(node.line, name + ": " + pose.error().message);
    return std::nullopt;
  }
  return *pose;
}

std::vector<Pose> read_poses(Report& report, const YamlNode& node, const std::string& name) {
  if (node.kind == YamlNode::Kind::list) {
    const auto pose = read_pose(report, node, name);
    return pose ? std::vector<Pose>{*pose} : std::vector<Pose>{};
  }
  if (node.kind != YamlNode::Kind::map) {
    report.problem(
        node.line,
        name + " must be 16 numbers, {file: ...}, {files: [...]} or {pattern, first, last}");
    return {};
  }
  MapReader map(report, node, name);
  const YamlNode* file = map.find("file");
  const YamlNode* files = map.find("files");
  const bool has_pattern = map.has("pattern");
  if (has_pattern) map.find("first"), map.find("last");
  if ((file != nullptr) + (files != nullptr) + has_pattern != 1) {
    report.problem(node.line, name + " must hold one of file, files, pattern");
    return {};
  }
  std::optional<FileList> list;
  if (file) {
    list.emplace();
    add_file(report, *file, name, *list);
  } else {
    list = files ? read_files(report, *files, name) : read_pattern(map, name);
  }
  return list ? load_poses(report, *list, name) : std::vector<Pose>{};
}

}  // namespace mr::scene_file
