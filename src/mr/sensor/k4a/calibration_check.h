#pragma once

#include <optional>
#include <string>
#include <vector>

#include "mr/core/camera.h"
#include "mr/core/sensor_config.h"
#include "mr/sensor/azure_kinect/calibration.h"
#include "mr/sensor/k4a/k4a_config.h"

namespace mr::sensor {

/// How far apart two cameras see the same direction: the largest distance over a grid of pixels,
/// without the picture's rim, as far out as `b` sees. Nothing where `a` is of another size or
/// model, or looks where `b` has no picture.
std::optional<double> lens_difference_px(const Camera& a, const Camera& b);

/// In what a sensor's cameras differ from what the device says of itself: lenses by more than a
/// pixel, the place of the colour camera by more than a correction (3 cm or 3 degrees). One line
/// each; empty: nothing.
std::vector<std::string> calibration_differences(const SensorConfig& sensor,
                                                 const K4aSource& source,
                                                 const KinectCalibration& device);

/// The sensor's lines of a scene file: source, cameras and the range of depth. `id`: of the sensor.
/// An Error if the calibration does not fit a mode.
Result<std::string> k4a_sensor_yaml(const std::string& id, const K4aSource& source,
                                    const KinectCalibration& device);

}  // namespace mr::sensor
