#pragma once

#include <filesystem>

#include "mr/core/result.h"
#include "mr/sensor/folders/picture_folder.h"
#include "mr/sensor/recording_formats.h"

/// The layouts of data sets (FORMATS, sections 8 and 10), for recording_formats.cpp. is_…: by names
/// alone. open_…: reads what the folder tells; its pictures are not opened but for their size.
namespace mr::sensor {

/// TUM RGB-D: rgb.txt, depth.txt, groundtruth.txt.
bool is_tum(const std::filesystem::path& folder);
Result<PictureFolder> open_tum_recording(const std::filesystem::path& folder);

/// 7-Scenes and 3DMatch: frame-000000.{color,depth}.png, .pose.txt, camera-intrinsics.txt.
bool is_seven_scenes(const std::filesystem::path& folder);
Result<PictureFolder> open_seven_scenes(const std::filesystem::path& folder);

/// ScanNet's export: color/0.jpg, depth/0.png, pose/0.txt, intrinsic/.
bool is_scannet(const std::filesystem::path& folder);
Result<PictureFolder> open_scannet(const std::filesystem::path& folder);

/// Replica of NICE-SLAM: results/{frame,depth}000000.{jpg,png}, traj.txt, ../cam_params.json.
bool is_replica(const std::filesystem::path& folder);
Result<PictureFolder> open_replica(const std::filesystem::path& folder);

/// Redwood and Open3D: color/ or image/ and depth/, a camera's JSON, a trajectory .log.
bool is_redwood(const std::filesystem::path& folder);
Result<PictureFolder> open_redwood(const std::filesystem::path& folder);

/// depth_0.png with pose_0.txt, and color_0.png where there is colour: each a view that stands
/// still.
bool is_depth_views(const std::filesystem::path& folder);
Result<PictureFolder> open_depth_views(const std::filesystem::path& folder);

/// A recording of cwipc: cameraconfig.json beside one .mkv a camera.
bool is_cwipc(const std::filesystem::path& folder);
Result<RecordingInfo> describe_cwipc(const std::filesystem::path& folder);
Result<ImportedScene> import_cwipc(const std::filesystem::path& folder);

/// ScanNet's .sens file; only its header is read.
bool is_sens(const std::filesystem::path& file);
Result<RecordingInfo> describe_sens(const std::filesystem::path& file);

/// One picture all around: a JPEG twice as wide as high.
bool is_equirectangular(const std::filesystem::path& file);
Result<RecordingInfo> describe_equirectangular(const std::filesystem::path& file);

}  // namespace mr::sensor
