#pragma once

#include <filesystem>
#include <functional>
#include <string>

#include "mr/core/result.h"
#include "mr/core/sensor_config.h"
#include "mr/synth/rig_config.h"

namespace mr::synth {

struct RigExport {
  RigConfig rig;
  double fps = 30;
  std::filesystem::path folder;                    ///< made where it is missing
  std::function<void(int done, int of)> progress;  ///< frames; may be empty
};

/// Writes a rig's frames as a scene that `rgbd-images` reads back byte for byte:
///   scene.yaml
///   SENSOR/color/%06d.png, SENSOR/depth/%06d.png   8-bit RGB; 16-bit millimetres
///   truth/%06d.ply                                 the noiseless surface in world coordinates
/// The scene names the truth and the rig that made it.
Status export_rig(const RigExport& what);

/// The rig as the value of a scene file's key `rig`, on one line.
std::string rig_yaml(const RigConfig& rig);

}  // namespace mr::synth
