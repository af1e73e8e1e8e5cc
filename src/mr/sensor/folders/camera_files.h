#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "mr/core/camera.h"
#include "mr/core/pose.h"
#include "mr/core/result.h"

/// Camera files of data sets (FORMATS, sections 8 and 10). `name`: of the file, as errors name it;
/// they name the field, too.
namespace mr::sensor {

/// A 3x3 or 4x4 camera matrix as text (3DMatch, ScanNet), for pictures of a size that it does not
/// tell. Only its first three rows and columns count.
Result<Camera> parse_camera_matrix(std::string_view text, int width, int height,
                                   const std::string& name);

/// Open3D's JSON: width, height and intrinsic_matrix, nine numbers column by column.
Result<Camera> parse_open3d_camera(std::string_view text, const std::string& name);

/// Replica's cam_params.json: camera.{w,h,fx,fy,cx,cy,scale}.
struct ReplicaCamera {
  Camera camera;
  double depth_unit_m = 0;  ///< 1 / scale
};
Result<ReplicaCamera> parse_replica_camera(std::string_view text, const std::string& name);

/// A recording of cwipc: cameraconfig.json.
struct CwipcConfig {
  struct Camera {
    std::string serial, type, file;  ///< the file is relative to the folder; empty: not told
    std::optional<Pose> T_world_camera;
    bool is_disabled = false;
    double starts_at_us = 0;  ///< playback_inpoint_micros
  };
  std::string type;
  std::vector<Camera> cameras;
  std::optional<double> fps;
  std::string sync_master;  ///< serial; under "system" or "sync"; empty: none
};
/// At most 64 cameras.
Result<CwipcConfig> parse_cwipc_config(std::string_view text, const std::string& name);

/// A pinhole; Error where Camera::problems() has any.
Result<Camera> usable_pinhole(int width, int height, double fx, double fy, double cx, double cy,
                              const std::string& name);

}  // namespace mr::sensor
