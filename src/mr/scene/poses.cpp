#include <algorithm>
#include <charconv>

#include "mr/core/file.h"
#include "mr/scene/parts.h"
#include "mr/scene/pose_file.h"

namespace mr {

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

}  // namespace mr

namespace mr::scene_file {
namespace {

/// The poses of the files that can be used; the others get a neighbour's. Where none can, and where
/// there is only one, that is a problem.
std::vector<Pose> load_poses(Report& report, FileList& list, const std::string& name) {
  std::vector<Pose> poses(list.paths.size());
  if (list.unusable.size() == poses.size()) return poses;  // already reported
  std::optional<std::size_t> usable;                       // the newest
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const auto pose = list.unusable.contains(i) ? list.unusable[i] : read_pose_file(list.paths[i]);
    if (!pose) {
      list.unusable[i] = pose.error();
      if (usable) poses[i] = poses[*usable];
      continue;
    }
    poses[i] = *pose;
    if (!usable) std::fill_n(poses.begin(), i, *pose);
    usable = i;
  }
  if (usable) return poses;
  const auto& [first, error] = *list.unusable.begin();
  report.problem(list.lines[first], poses.size() == 1
                                        ? name + ": " + error.message
                                        : name + ": none of the " + std::to_string(poses.size()) +
                                              " pose files can be used; first: " + error.message);
  return poses;
}

}  // namespace

std::optional<Pose> read_pose(Report& report, const yaml::Node& node, const std::string& name) {
  std::array<double, 16> matrix{};
  if (!yaml::read_numbers(report, node, name, {-1e6, 1e6}, matrix)) return std::nullopt;
  auto pose = pose_from_matrix(matrix);
  if (!pose) {
    report.problem(node.line, name + ": " + pose.error().message);
    return std::nullopt;
  }
  return *pose;
}

void read_poses(Report& report, const yaml::Node& node, const std::string& name,
                SensorConfig& sensor) {
  if (node.kind == yaml::Node::Kind::list) {
    if (const auto pose = read_pose(report, node, name)) sensor.T_world_depth = {*pose};
    return;
  }
  if (node.kind != yaml::Node::Kind::map)
    return report.problem(
        node.line,
        name + " must be 16 numbers, {file: ...}, {files: [...]} or {pattern, first, last}");
  MapReader map(report, node, name);
  const yaml::Node* file = map.find("file");
  const yaml::Node* files = map.find("files");
  const bool has_pattern = map.has("pattern");
  if (has_pattern) map.find("first"), map.find("last");
  if ((file != nullptr) + (files != nullptr) + has_pattern != 1)
    return report.problem(node.line, name + " must hold one of file, files, pattern");
  std::optional<FileList> list = file    ? yaml::read_one_file(report, *file, name)
                                 : files ? yaml::read_files(report, *files, name)
                                         : yaml::read_pattern(map, name);
  if (!list) return;
  sensor.T_world_depth = load_poses(report, *list, name);
  yaml::report_unusable(report, *list, "sensors." + sensor.id + "." + name);
  sensor.lost_poses = std::move(list->unusable);
}

}  // namespace mr::scene_file
