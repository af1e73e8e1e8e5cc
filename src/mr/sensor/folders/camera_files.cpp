#include "mr/sensor/folders/camera_files.h"

#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "mr/core/user_text.h"
#include "mr/sensor/folders/text_lines.h"

namespace mr::sensor {
namespace {

using Json = nlohmann::json;

constexpr double kMostPixels = 16384;

Error wrong(const std::string& name, const std::string& why) {
  return {Error::Cause::invalid, name + ": " + why};
}

constexpr int kDeepest = 32;

/// Adds the numbers of a list and of the lists in it; false where something else is in it.
bool flatten(const Json& list, std::size_t most, std::vector<double>& out) {
  for (const auto& item : list) {
    if (item.is_array() && !list[0].is_number()) {
      if (!flatten(item, most, out)) return false;
      continue;
    }
    if (!item.is_number() || out.size() == most) return false;
    out.push_back(item.get<double>());
    if (!std::isfinite(out.back())) return false;
  }
  return true;
}

/// Comments and unknown keys are accepted.
Result<Json> parse_json_object(std::string_view text, const std::string& name) {
  bool is_too_deep = false;
  const auto watch_depth = [&](int depth, Json::parse_event_t, Json&) {
    is_too_deep |= depth > kDeepest;
    return depth <= kDeepest;
  };
  auto root = Json::parse(text, watch_depth, false, true);
  if (is_too_deep || root.is_discarded() || !root.is_object())
    return Error{Error::Cause::corrupt,
                 name + (is_too_deep ? ": is nested too deep" : ": is not a JSON object")};
  return root;
}

/// A number within limits; nothing where there is none.
std::optional<double> number_in(const Json& object, const char* key, double least, double most) {
  const auto found = object.find(key);
  if (found == object.end() || !found->is_number()) return std::nullopt;
  const auto value = found->get<double>();
  if (!(value >= least && value <= most)) return std::nullopt;
  return value;
}

/// A text; empty where there is none.
std::string text_in(const Json& object, const char* key) {
  const auto found = object.find(key);
  return found != object.end() && found->is_string() ? found->get<std::string>() : "";
}

/// `count` finite numbers, in one list or in lists of rows; nothing where they are not.
std::optional<std::vector<double>> numbers_in(const Json& object, const char* key,
                                              std::size_t count) {
  const auto found = object.find(key);
  std::vector<double> out;
  if (found == object.end() || !found->is_array() || !flatten(*found, count, out) ||
      out.size() != count)
    return std::nullopt;
  return out;
}

Result<CwipcConfig::Camera> cwipc_camera(const Json& object, const std::string& name) {
  CwipcConfig::Camera out;
  out.serial = text_in(object, "serial");
  out.type = text_in(object, "type");
  out.file = text_in(object, "filename");
  const auto disabled = object.find("disabled");
  out.is_disabled = disabled != object.end() && disabled->is_boolean() && disabled->get<bool>();
  out.starts_at_us = number_in(object, "playback_inpoint_micros", 0, 1e15).value_or(0);
  if (!object.contains("trafo")) return out;
  const auto matrix = numbers_in(object, "trafo", 16);
  if (!matrix) return wrong(name, "trafo of camera " + in_quotes(out.serial) + " is no 4x4 matrix");
  const auto pose = pose_from_matrix(std::span<const double, 16>(matrix->data(), 16));
  if (!pose)
    return wrong(name, "trafo of camera " + in_quotes(out.serial) + ": " + pose.error().message);
  out.T_world_camera = *pose;
  return out;
}

}  // namespace

Result<Camera> usable_pinhole(int width, int height, double fx, double fy, double cx, double cy,
                              const std::string& name) {
  Camera camera;
  camera.width = width, camera.height = height;
  camera.fx = fx, camera.fy = fy, camera.cx = cx, camera.cy = cy;
  const auto problems = camera.problems();
  if (problems.empty()) return camera;
  return wrong(name, problems.front() + " (" + std::to_string(width) + "x" +
                         std::to_string(height) + " pixels)");
}

Result<Camera> parse_camera_matrix(std::string_view text, int width, int height,
                                   const std::string& name) {
  std::vector<double> values;
  TextLines lines(text);
  while (lines.next())
    for (const std::string_view word : lines.words()) {
      const auto value = number_of(word);
      if (!value || !std::isfinite(*value))
        return wrong(name, "line " + std::to_string(lines.number()) + " holds " + in_quotes(word) +
                               " where a number is wanted");
      if (values.size() == 16) return wrong(name, "holds more than 16 numbers");
      values.push_back(*value);
    }
  const std::size_t columns = values.size() == 9 ? 3 : 4;
  if (values.size() != 9 && values.size() != 16)
    return wrong(
        name, "holds " + std::to_string(values.size()) + " numbers; a camera matrix has 9 or 16");
  return usable_pinhole(width, height, values[0], values[columns + 1], values[2],
                        values[columns + 2], name);
}

Result<Camera> parse_open3d_camera(std::string_view text, const std::string& name) {
  const auto root = parse_json_object(text, name);
  if (!root) return root.error();
  const auto width = number_in(*root, "width", 1, kMostPixels);
  const auto height = number_in(*root, "height", 1, kMostPixels);
  if (!width || !height) return wrong(name, "lacks width and height of the pictures");
  const auto matrix = numbers_in(*root, "intrinsic_matrix", 9);
  if (!matrix) return wrong(name, "lacks intrinsic_matrix, nine numbers");
  const auto& m = *matrix;
  if (m[2] != 0 || m[5] != 0 || m[8] != 1)
    return wrong(name, "intrinsic_matrix is not column by column: fx 0 0 0 fy 0 cx cy 1");
  return usable_pinhole(static_cast<int>(*width), static_cast<int>(*height), m[0], m[4], m[6], m[7],
                        name);
}

Result<ReplicaCamera> parse_replica_camera(std::string_view text, const std::string& name) {
  const auto root = parse_json_object(text, name);
  if (!root) return root.error();
  const auto found = root->find("camera");
  if (found == root->end() || !found->is_object()) return wrong(name, "lacks the object camera");
  double v[7];
  constexpr const char* kKeys[] = {"w", "h", "fx", "fy", "cx", "cy", "scale"};
  for (int i = 0; i < 7; ++i) {
    const auto value = number_in(*found, kKeys[i], -1e6, 1e6);
    if (!value) return wrong(name, std::string("lacks the number camera.") + kKeys[i]);
    v[i] = *value;
  }
  if (!(v[6] > 1)) return wrong(name, "camera.scale must be the counts a metre, over 1");
  if (!(v[0] >= 1 && v[0] <= kMostPixels && v[1] >= 1 && v[1] <= kMostPixels))
    return wrong(name, "camera.w and camera.h must be 1 to 16384 pixels");
  const auto camera =
      usable_pinhole(static_cast<int>(v[0]), static_cast<int>(v[1]), v[2], v[3], v[4], v[5], name);
  if (!camera) return camera.error();
  return ReplicaCamera{*camera, 1 / v[6]};
}

Result<CwipcConfig> parse_cwipc_config(std::string_view text, const std::string& name) {
  constexpr std::size_t kMostCameras = 64;
  const auto root = parse_json_object(text, name);
  if (!root) return root.error();
  CwipcConfig out;
  out.type = text_in(*root, "type");
  const auto cameras = root->find("camera");
  if (cameras == root->end() || !cameras->is_array() || cameras->empty() ||
      cameras->size() > kMostCameras)
    return wrong(name, "lacks camera, a list of 1 to 64 cameras");
  for (const Json& object : *cameras) {
    if (!object.is_object()) return wrong(name, "camera holds what is no object");
    auto camera = cwipc_camera(object, name);
    if (!camera) return camera.error();
    out.cameras.push_back(*std::move(camera));
  }
  for (const char* key : {"sync", "system"}) {
    const auto part = root->find(key);
    if (part == root->end() || !part->is_object()) continue;
    if (const std::string serial = text_in(*part, "sync_master_serial"); !serial.empty())
      out.sync_master = serial;
    if (const auto fps = number_in(*part, "fps", 1, 240)) out.fps = *fps;
  }
  return out;
}

}  // namespace mr::sensor
