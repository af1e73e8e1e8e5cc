#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "mr/core/frame.h"
#include "mr/core/result.h"
#include "mr/core/sensor_config.h"
#include "mr/synth/mkv_recording.h"

/// The forms in which a rig's frames are written, one sensor each.
namespace mr::synth {

class SensorFiles {
 public:
  virtual ~SensorFiles() = default;

  /// Frames come in order, from 0.
  virtual Status write(const Frame& frame) = 0;
  virtual Status close() { return {}; }
};

/// FOLDER/color/%06d.png and FOLDER/depth/%06d.png: 8-bit RGB; 16-bit millimetres.
Result<std::unique_ptr<SensorFiles>> open_picture_files(const std::filesystem::path& folder);

/// One recording.
Result<std::unique_ptr<SensorFiles>> open_mkv_file(const std::filesystem::path& file,
                                                   const MkvDevice& device);

/// A folder of the TUM RGB-D benchmark: rgb/ and depth/ with pictures named by seconds, depth in
/// fifths of a millimetre; rgb.txt, depth.txt and groundtruth.txt list them with their times and
/// the sensor's one pose. As there, colour is taken a little after depth, at uneven distances, and
/// has one picture more.
Result<std::unique_ptr<SensorFiles>> open_tum_folder(const std::filesystem::path& folder,
                                                     const Pose& T_world_depth, double fps);

/// Makes a folder and those above it.
Status make_folder(const std::filesystem::path& folder);

}  // namespace mr::synth
