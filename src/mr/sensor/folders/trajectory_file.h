#pragma once

#include <cstddef>
#include <filesystem>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "mr/core/pose.h"
#include "mr/core/result.h"
#include "mr/core/trajectory.h"

/// Files that hold the poses of a whole recording.
namespace mr::sensor {

/// What a file of poses says: T_world_sensor, sensor to world, metres.
struct TrajectoryFile {
  enum class Layout {
    tum,      ///< t tx ty tz qx qy qz qw
    log,      ///< Redwood: three integers, then four lines of four; LiveScan3D: 16 on one line
    matrix,   ///< 16 numbers, on a line or on four (Replica traj.txt)
    matrix34  ///< 12 numbers on a line: three rows of four (KITTI)
  };
  Layout layout = Layout::matrix;
  Trajectory timed;           ///< of the layout tum; else empty
  std::vector<Pose> by_item;  ///< of the others: pose i is of item i
  /// Entries without a usable pose, by their number, with the reason: numbers that are not finite
  /// (ScanNet writes -inf where tracking was lost) or a matrix that is not rigid. `by_item` has a
  /// neighbour's pose in their place, `timed` has none.
  std::map<std::size_t, Error> lost;
};

/// Reads a file of poses in the layout that its first lines have. A quaternion that is off by up to
/// 1 % is normalized, and so is a rotation matrix (pose_from_matrix). Errors name file and line: a
/// line of another layout, what is no number, a quaternion whose length is not near 1; no entry
/// that can be used; over a million entries or 256 MiB. Sources: FORMATS, section 8; Open3D
/// cpp/open3d/io/file_format/File{TUM,LOG}.cpp.
Result<TrajectoryFile> read_trajectory_file(const std::filesystem::path& file);

/// The same from the text of a file; `name`: as errors name it.
Result<TrajectoryFile> parse_trajectory(std::string_view text, const std::string& name);

}  // namespace mr::sensor
