#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "mr/core/frame_source.h"
#include "mr/core/sensor_config.h"
#include "mr/core/timeline.h"
#include "mr/sensor/azure_kinect/calibration.h"
#include "mr/sensor/k4a/k4a_config.h"

/// Live Azure Kinects and Orbbec Femtos, by the functions of the Azure Kinect Sensor SDK. Where
/// CMake does not find the SDK, nor Orbbec's wrapper of the same name, every call says so.
namespace mr::sensor {

/// Opens the device of a sensor, whose source must be a K4aSource, at the first call of next(). A
/// live source (FrameSource::is_live). It opens the device again when it was unplugged. Before a
/// master starts, it starts the subordinates of this process: they wait for its pulse.
/// Errors: what the scene says does not fit the device (once; frames go on where they can), no
/// frame for a second, a frame without depth or with a picture that cannot be decoded, and what the
/// SDK says. One end of the source: its cameras do not have the sizes of their modes.
std::unique_ptr<FrameSource> open_k4a(const SensorConfig& sensor, SensorId id,
                                      const Timeline& timeline);

/// A device that is plugged in.
struct K4aDeviceInfo {
  std::string problem;  ///< it cannot be opened, such as one in use; empty: none
  std::string serial, color_firmware, depth_firmware;
  bool sync_in = false, sync_out = false;  ///< whether a cable is plugged in
  std::optional<KinectCalibration> calibration;
};

/// All devices, in the order of their numbers; opens each for a moment. Error unsupported: not
/// built.
Result<std::vector<K4aDeviceInfo>> find_k4a_devices();

}  // namespace mr::sensor
