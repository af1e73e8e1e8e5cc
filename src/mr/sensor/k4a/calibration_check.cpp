#include "mr/sensor/k4a/calibration_check.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <span>

#include "mr/yaml/flow_text.h"

namespace mr::sensor {
namespace {

constexpr double kMostLens_px = 1, kMostShift_m = 0.03, kMostTurn_deg = 3;

void compare_lens(const char* which, const Camera& scene, const Result<Camera>& device,
                  std::vector<std::string>& out) {
  if (!device) {
    out.push_back(device.error().message);
    return;
  }
  const auto px = lens_difference_px(scene, *device);
  if (!px)
    out.push_back(fmt::format("{} is of another kind than the device's", which));
  else if (*px > kMostLens_px)
    out.push_back(fmt::format("{} differs from the device's by up to {:.1f} px", which, *px));
}

/// Of a rotation.
double turn_deg(const Mat3& r) {
  const double cosine = (r(0, 0) + r(1, 1) + r(2, 2) - 1) / 2;
  return std::acos(std::clamp(cosine, -1.0, 1.0)) * 180 / std::numbers::pi;
}

}  // namespace

std::optional<double> lens_difference_px(const Camera& a, const Camera& b) {
  if (a.model != b.model || a.width != b.width || a.height != b.height) return std::nullopt;
  constexpr int kSteps = 8;
  double most = 0;
  Camera unlimited = b;  // the radius tells where a lens model holds, not what the lens is like
  unlimited.most_radius = 0;
  for (int y = 1; y < kSteps; ++y)
    for (int x = 1; x < kSteps; ++x) {
      const Vec2d pixel{a.width * static_cast<double>(x) / kSteps,
                        a.height * static_cast<double>(y) / kSteps};
      if (!project(b, unproject(b, pixel))) continue;  // the device does not see there
      const auto other = project(unlimited, unproject(a, pixel));
      if (!other) return std::nullopt;
      most = std::max(most, std::hypot(other->x - pixel.x, other->y - pixel.y));
    }
  return most;
}

std::vector<std::string> calibration_differences(const SensorConfig& sensor,
                                                 const K4aSource& source,
                                                 const KinectCalibration& device) {
  std::vector<std::string> out;
  compare_lens("depth_camera", sensor.depth_camera, depth_camera(device, source.depth()), out);
  const KinectMode* mode = source.color_mode();
  if (!mode || !sensor.color_camera) return out;
  compare_lens("color_camera", *sensor.color_camera, color_camera(device, *mode), out);
  const Pose apart = sensor.T_color_depth * T_color_depth(device).inverse();
  const double shift_m = length(apart.translation), turn = turn_deg(apart.rotation);
  if (shift_m > kMostShift_m || turn > kMostTurn_deg)
    out.push_back(fmt::format("T_color_depth differs from the device's by {:.0f} mm and {:.1f}°",
                              1000 * shift_m, turn));
  return out;
}

Result<std::string> k4a_sensor_yaml(const std::string& id, const K4aSource& source,
                                    const KinectCalibration& device) {
  const KinectMode& mode = source.depth();
  const auto depth = depth_camera(device, mode);
  if (!depth) return depth.error();
  std::string out = fmt::format(
      "- id: {}\n"
      "  source: {{type: k4a, serial: \"{}\", depth_mode: {}, color: {}, fps: {}}}\n"
      "  depth_camera: {}\n",
      id, source.serial, word_of(source.depth_mode), word_of(source.color), source.fps,
      yaml::camera_text(*depth));
  if (const KinectMode* color = source.color_mode()) {
    const auto camera = color_camera(device, *color);
    if (!camera) return camera.error();
    out += fmt::format("  color_camera: {}\n  T_color_depth: {}\n", yaml::camera_text(*camera),
                       yaml::list_text(T_color_depth(device).matrix()));
  }
  return out + fmt::format("  depth_range_m: [{}, {}]\n", mode.near_m, mode.far_m);
}

}  // namespace mr::sensor
