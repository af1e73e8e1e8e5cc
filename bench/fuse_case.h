#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "mr/core/camera.h"
#include "mr/core/image.h"
#include "mr/core/mesh.h"
#include "mr/core/pose.h"
#include "stage.h"

namespace mr::bench {

/// One depth frame to fuse.
struct FuseCase {
  std::string name;
  ImageDepth depth;  ///< metres; depth beyond the limit is 0
  Camera camera;     ///< undistorted pinhole, or LiDAR
  Pose T_world_camera;
  double voxel_m = 0.01, truncation_m = 0.04, limit_m = 5;
  Mesh truth;  ///< the noiseless surface; empty: not known
};

/// The stage's own cases: recorded frames (found in $MR_DATA, or ../shared/data from here or from
/// the sources) and one synthetic sensor.
std::vector<CaseInfo> fuse_cases();

Result<FuseCase> load_fuse_case(const std::string& name);

/// A scan, with noise, of a dome LiDAR with 128 beams below the ceiling of an 8x5x3 m room, with
/// the usual band for the voxel and the truth.
Result<FuseCase> load_scan_case(const std::string& name, double voxel_m);

/// The first frame of every sensor of a scene, named by the sensor. A scene's problems are
/// printed on standard error, one line each. unsupported: a sensor is no pinhole camera.
Result<std::vector<FuseCase>> load_fuse_scene(const std::filesystem::path& scene_file);

}  // namespace mr::bench
