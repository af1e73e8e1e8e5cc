#pragma once

#include <filesystem>
#include <functional>
#include <string>

#include "mr/core/result.h"
#include "mr/core/sensor_config.h"
#include "mr/synth/mkv_pictures.h"
#include "mr/synth/rig_config.h"

namespace mr::synth {

struct RigExport {
  /// How the frames of Kinects are written; those of LiDARs are always pictures.
  enum class Format {
    images,  ///< SENSOR/color/%06d.png, SENSOR/depth/%06d.png: 8-bit RGB; 16-bit millimetres
    mkv,     ///< SENSOR.mkv: recordings of Azure Kinects on one sync cable, each begun at another
             ///< time (MkvRecording)
    tum,     ///< SENSOR/rgb, SENSOR/depth and their lists (open_tum_folder)
  };

  RigConfig rig;
  double fps = 30;
  std::filesystem::path folder;                         ///< made where it is missing
  std::function<void(int done, int of)> progress = {};  ///< frames; may be empty
  Format format = Format::images;
  MkvColor mkv_color = MkvColor::mjpg;
};

/// Writes a rig's frames as a scene: scene.yaml, the frames, and truth/%06d.ply, the noiseless
/// surface in world coordinates. Pictures and depth are read back byte for byte, colour of MKV
/// after JPEG. The scene names the truth and the rig that made it. An Error where a Kinect has no
/// mode of the rig's pictures or frame rate (mkv).
Status export_rig(const RigExport& what);

/// The rig as the value of a scene file's key `rig`, on one line.
std::string rig_yaml(const RigConfig& rig);

}  // namespace mr::synth
