#include "mr/sensor/rgbd_items.h"

#include <string>
#include <utility>

#include "mr/kit/image_io.h"

namespace mr::sensor {

std::vector<float> depth_table(const SensorConfig& sensor, double depth_unit_m,
                               const std::vector<std::uint16_t>& invalid) {
  std::vector<float> table(65536, 0.0f);
  for (std::size_t count = 1; count < table.size(); ++count) {
    const double metres = static_cast<double>(count) * depth_unit_m;
    if (metres >= sensor.depth_near_m && metres <= sensor.depth_far_m)
      table[count] = static_cast<float>(metres);
  }
  for (const std::uint16_t count : invalid) table[count] = 0;
  return table;
}

Status check_size(int width, int height, const Camera& camera, const char* which,
                  const std::string& name) {
  if (width == camera.width && height == camera.height) return {};
  const auto size = [](int w, int h) { return std::to_string(w) + "x" + std::to_string(h); };
  return Error{Error::Cause::invalid, name + ": expected " + size(camera.width, camera.height) +
                                          " pixels of the " + which + " camera, found " +
                                          size(width, height)};
}

RgbdItems::RgbdItems(const SensorConfig& sensor, RgbdImagesSource files)
    : depth_camera_(sensor.depth_camera),
      color_camera_(sensor.color_camera),
      sensor_(sensor.id),
      files_(std::move(files)),
      metres_(depth_table(sensor, files_.depth_unit_m, files_.invalid)) {}

Error RgbdItems::lost(std::size_t item, Error error) const {
  error.message += " (frame " + std::to_string(item) + " of sensor '" + sensor_ + "' is lost)";
  return error;
}

Result<Frame> RgbdItems::read(std::size_t item) const {
  auto depth = read_depth(files_.depth[item]);
  if (!depth) return depth.error();
  Frame frame;
  frame.depth = *std::move(depth);
  if (!color_camera_ || files_.color.empty()) return frame;
  if (item >= files_.color.size())
    return Error{Error::Cause::not_found,
                 files_.depth[item].string() + ": no colour picture belongs to it"};
  auto color = read_color(files_.color[item]);
  if (!color) return color.error();
  frame.color = *std::move(color);
  return frame;
}

Result<ImageDepth> RgbdItems::read_depth(const std::filesystem::path& file) const {
  const auto counts = kit::read_depth16(file);
  if (!counts) return counts.error();
  const Status fits =
      check_size(counts->width, counts->height, depth_camera_, "depth", file.string());
  if (!fits) return fits.error();
  ImageDepth depth(counts->width, counts->height);
  for (std::size_t i = 0; i < depth.data.size(); ++i) depth.data[i] = metres_[counts->data[i]];
  return depth;
}

Result<ImageRgb> RgbdItems::read_color(const std::filesystem::path& file) const {
  auto color = kit::read_color(file);
  if (!color) return color.error();
  const Status fits =
      check_size(color->width, color->height, *color_camera_, "colour", file.string());
  if (!fits) return fits.error();
  return color;
}

}  // namespace mr::sensor
