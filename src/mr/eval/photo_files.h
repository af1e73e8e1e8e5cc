#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "mr/core/pose.h"
#include "mr/core/result.h"
#include "mr/scene/scene.h"

/// Photographs that a stream is compared with: which, and that no sensor delivered them.
namespace mr::eval {

/// A photograph in a file.
struct PhotoFile {
  std::filesystem::path file;
  int number = 0;                 ///< in the pattern
  Pose T_world_depth;             ///< of the depth camera of the sensor that took it
  std::uint64_t pixels_hash = 0;  ///< of size and pixels
};

/// Which photographs.
struct PhotoSelection {
  std::string color, pose;  ///< patterns with one number (yaml::kPatternRule)
  std::vector<int> frames;  ///< these numbers; empty: all up to 99,999 whose picture exists
};

/// The selected photographs in the order of their numbers, as given or ascending. Pictures must
/// have the size of `camera`; poses are read by read_pose_file(). Errors are one line that names
/// the file or the pattern: invalid, not_found, corrupt, io, too_large.
Result<std::vector<PhotoFile>> find_photographs(const PhotoSelection& selection,
                                                const Camera& camera);

/// Refuses photographs that a sensor of the scene delivers: files that a sensor's source names, and
/// pictures with equal pixels in the first `captures` captures. The scene must be prepared.
/// invalid: the error names the picture and the sensor.
Status check_not_delivered(const std::vector<PhotoFile>& photographs, const Scene& scene,
                           int captures, const std::filesystem::path& rig_cache);

}  // namespace mr::eval
