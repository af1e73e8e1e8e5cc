#pragma once

#include <memory>

#include "mr/core/frame_source.h"
#include "mr/core/sensor_config.h"

namespace mr::sensor {

/// Reads a sensor's frames from image files (source type `rgbd-images`). Frame i is exposed at
/// i / fps after the epoch plus the sensor's clock offset; a looping source goes on counting.
/// Depth outside [depth_near_m, depth_far_m] and the invalid counts become 0. A picture that is
/// corrupt, truncated or of another size than its camera is an error that names the file; the
/// frame is lost, the next call goes on.
std::unique_ptr<FrameSource> open_rgbd_images(const SensorConfig& sensor, SensorId id, double fps);

}  // namespace mr::sensor
