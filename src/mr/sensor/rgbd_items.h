#pragma once

#include <cstddef>
#include <filesystem>
#include <vector>

#include "mr/core/frame.h"
#include "mr/core/sensor_config.h"
#include "mr/sensor/rgbd_images.h"

namespace mr::sensor {

/// Metres for each of the 65,536 counts of a depth picture; 0 where the count is one of `invalid`
/// or out of the sensor's range.
std::vector<float> depth_table(const SensorConfig& sensor, double depth_unit_m,
                               const std::vector<std::uint16_t>& invalid);

/// Reads the picture files of one sensor, item by item.
class RgbdItems {
 public:
  RgbdItems(const SensorConfig& sensor, RgbdImagesSource files);

  std::size_t size() const { return files_.depth.size(); }
  /// The pictures of an item, as taken, without time and pose. Errors name the file: it is missing,
  /// corrupt, or has not the size of its camera.
  Result<Frame> read(std::size_t item) const;
  /// Adds to an error that it cost a frame.
  Error lost(std::size_t item, Error error) const;

 private:
  Result<ImageDepth> read_depth(const std::filesystem::path& file) const;
  Result<ImageRgb> read_color(const std::filesystem::path& file) const;

  Camera depth_camera_;
  std::optional<Camera> color_camera_;
  std::string sensor_;
  RgbdImagesSource files_;
  std::vector<float> metres_;  ///< by count
};

/// An Error if a picture has not the size of its camera; `name`: of the picture's file.
Status check_size(int width, int height, const Camera& camera, const char* which,
                  const std::string& name);

}  // namespace mr::sensor
