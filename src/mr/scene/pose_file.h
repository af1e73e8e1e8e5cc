#pragma once

#include <filesystem>

#include "mr/core/pose.h"
#include "mr/core/result.h"

namespace mr {

/// Reads a pose from a text file: a 4x4 matrix, row-major, 16 numbers apart by white space or
/// commas. A rotation that is off by up to 2 % is replaced by the nearest one (pose_from_matrix).
/// Errors name the file: not_found, io, invalid; too_large beyond 64 KiB.
Result<Pose> read_pose_file(const std::filesystem::path& path);

}  // namespace mr
