#include <algorithm>
#include <charconv>

#include "mr/core/file.h"
#include "mr/scene/parts.h"
#include "mr/scene/pose_file.h"
#include "mr/sensor/folders/trajectory_file.h"

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

constexpr std::size_t kMostPlaces = 256;  // of a long way, for those who ask where it leads

/// The poses of a trajectory, evenly thinned out; with the first and the last. One where the sensor
/// stands still.
std::vector<Pose> places_of(const Trajectory& trajectory) {
  const std::vector<TimedPose>& all = trajectory.poses();
  const Pose& first = all.front().T_world_sensor;
  if (std::ranges::all_of(all, [&](const TimedPose& pose) { return pose.T_world_sensor == first; }))
    return {first};
  const std::size_t count = std::min(all.size(), kMostPlaces);
  std::vector<Pose> out;
  for (std::size_t i = 0; i < count; ++i)
    out.push_back(all[i * (all.size() - 1) / (count - 1)].T_world_sensor);
  return out;
}

/// Where a trajectory has a pose for none of a source's frames: what is wrong; else empty.
/// A source without a clock of its own begins at 0.
std::string apart(const Trajectory& trajectory, const SourceConfig& source) {
  constexpr Duration kMostOffset = std::chrono::hours(24);
  const auto seconds = [](TimePoint time) {
    return std::to_string(std::chrono::duration<double>(time.time_since_epoch()).count());
  };
  const TimePoint begin = trajectory.poses().front().at, end = trajectory.poses().back().at;
  const std::string span = "holds poses from " + seconds(begin) + " to " + seconds(end) + " s";
  const auto clock = source.clock();
  if (!clock && source.content().items == 0) return {};  // its problem is told
  if (!clock)
    return begin - TimePoint() > kMostOffset
               ? span + ", but the source has no times of its own: its frames begin at 0"
               : "";
  const bool is_later = clock->last && begin > *clock->last + Trajectory::kReach;
  if (!is_later && end >= clock->first - Trajectory::kReach) return {};
  return span + ", but the recording begins at " + seconds(clock->first) +
         (clock->last ? " and ends at " + seconds(*clock->last) : "") + " s";
}

void tell_lost(Report& report, int line, const std::string& key,
               const sensor::TrajectoryFile& file) {
  if (file.lost.empty()) return;
  const std::size_t all =
      file.lost.size() +
      (file.by_item.empty() ? file.timed.poses().size() : file.by_item.size() - file.lost.size());
  report.notice(line, key + ": " + std::to_string(file.lost.size()) + " of the " +
                          std::to_string(all) +
                          " poses cannot be used, their frames are lost; first: " +
                          file.lost.begin()->second.message);
}

/// {trajectory: FILE, T_trajectory_depth: 16 numbers}: a file of many poses. Those with times of
/// their own are of the source's clock, the others of its items.
void read_trajectory(MapReader& map, const yaml::Node& node, const std::string& name,
                     SensorConfig& sensor) {
  Pose T_trajectory_depth;
  if (const yaml::Node* offset = map.find("T_trajectory_depth"))
    if (const auto pose = read_pose(map.report, *offset, name + ".T_trajectory_depth"))
      T_trajectory_depth = *pose;
  const auto list = yaml::read_one_file(map.report, node, name);
  if (!list || !list->unusable.empty()) return;
  auto file = sensor::read_trajectory_file(list->paths.front());
  if (!file) return map.report.problem(node.line, name + ": " + file.error().message);
  std::vector<TimedPose> timed = file->timed.poses();
  for (TimedPose& pose : timed) pose.T_world_sensor = pose.T_world_sensor * T_trajectory_depth;
  for (Pose& pose : file->by_item) pose = pose * T_trajectory_depth;
  tell_lost(map.report, node.line, "sensors." + sensor.id + "." + name, *file);
  if (timed.empty()) {
    sensor.T_world_depth = std::move(file->by_item);
    sensor.lost_poses = std::move(file->lost);
    return;
  }
  sensor.trajectory = Trajectory(std::move(timed));
  sensor.T_world_depth = places_of(sensor.trajectory);
  if (const std::string why = apart(sensor.trajectory, sensor.source); !why.empty())
    map.report.problem(node.line, name + ": " + list->paths.front().string() + " " + why);
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
        name +
            " must be 16 numbers, {file: ...}, {files: [...]}, {pattern, first, last} or "
            "{trajectory: ...}");
  MapReader map(report, node, name);
  const yaml::Node* file = map.find("file");
  const yaml::Node* files = map.find("files");
  const bool has_pattern = map.has("pattern");
  if (has_pattern) map.find("first"), map.find("last");
  const yaml::Node* trajectory = map.find("trajectory");
  if ((file != nullptr) + (files != nullptr) + has_pattern + (trajectory != nullptr) != 1)
    return report.problem(node.line, name + " must hold one of file, files, pattern, trajectory");
  if (trajectory) return read_trajectory(map, *trajectory, name, sensor);
  std::optional<FileList> list = file    ? yaml::read_one_file(report, *file, name)
                                 : files ? yaml::read_files(report, *files, name)
                                         : yaml::read_pattern(map, name);
  if (!list) return;
  sensor.T_world_depth = load_poses(report, *list, name);
  yaml::report_unusable(report, *list, "sensors." + sensor.id + "." + name);
  sensor.lost_poses = std::move(list->unusable);
}

}  // namespace mr::scene_file
