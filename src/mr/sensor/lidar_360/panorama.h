#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <vector>

#include "mr/core/camera.h"
#include "mr/core/frame.h"
#include "mr/core/pose.h"
#include "mr/core/range.h"
#include "mr/core/result.h"
#include "mr/kit/v4l2_camera.h"
#include "mr/yaml/map_reader.h"

namespace mr::sensor {

/// The pictures of a 360-degree camera: equirectangular, as a video, as picture files, or live. It
/// has no common clock with the LiDAR beside it.
struct PanoramaConfig {
  std::filesystem::path video;                  ///< MP4, MOV or MKV; empty: one of the others
  std::vector<std::filesystem::path> pictures;  ///< JPEG or PNG; one alone holds at all times
  std::optional<kit::V4l2Config> device;        ///< a live camera
  double fps = 30;                              ///< of `pictures`
  double offset_ms = 0;                         ///< scene time of the first picture
  double yaw_deg = 0;       ///< the camera is turned to the right by this, seen from above
  bool stated_pose = true;  ///< take out the pose that the file states (GPano, Spherical Video)
  bool loop = false;        ///< start again after the last picture

  static constexpr Range kFps{0, 240, true}, kOffset_ms{-1e7, 1e7}, kYaw_deg{-360, 360};
  std::vector<std::string> problems() const;
  friend bool operator==(const PanoramaConfig&, const PanoramaConfig&) = default;
};

/// What the first picture tells.
struct PanoramaStart {
  Camera camera;          ///< equirectangular, of the whole sphere
  Pose T_picture_camera;  ///< from the camera as it stands (upright, yaw 0) to its pictures
};
/// Errors name the file: it is no video or picture, not 2:1, or of another projection.
Result<PanoramaStart> panorama_start(const PanoramaConfig& config);

/// Delivers the picture of a time. Not thread-safe.
class Panorama {
 public:
  explicit Panorama(PanoramaConfig config);
  ~Panorama();

  /// The picture nearest to a scene time, of the whole sphere; where the camera does not loop, the
  /// first before its beginning and the last after its end. Of a live camera the newest. Times
  /// should rise: going back costs a seek. Errors name the file or the device; the next call may
  /// succeed.
  Result<ImageRgb> at(Duration scene_time);

 private:
  struct Video;
  Result<ImageRgb> file_at(Duration since_start);
  Result<ImageRgb> frame_at(Duration since_start);
  Result<ImageRgb> newest();

  const PanoramaConfig config_;
  std::unique_ptr<Video> video_;
  std::optional<kit::V4l2Camera> live_;
  std::optional<std::size_t> loaded_;  ///< item of `pictures` in image_
  ImageRgb image_;                     ///< the picture of `pictures`, or the newest live one
};

/// The keys of the mapping `color` of a source lidar-360: video, pictures or device, fps,
/// offset_ms, yaw_deg, stated_pose, loop. Nothing where a problem was reported.
std::optional<PanoramaConfig> read_panorama(yaml::Report& report, const yaml::Node& node,
                                            const std::string& key);

}  // namespace mr::sensor
