#include "mr/sensor/azure_kinect/calibration.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstddef>
#include <nlohmann/json.hpp>
#include <utility>
#include <vector>

#include "mr/core/range.h"
#include "mr/core/user_text.h"

namespace mr::sensor {
namespace {

constexpr std::size_t kMostCalibrationBytes = 1u << 20;  // real files have 4 kB
constexpr double kUnknownRadius = 1e-4, kUsualRadius = 1.7;
constexpr double kMostOffset_m = 1;  // between two cameras of one device

constexpr KinectMode kDepthModes[] = {
    {"NFOV_2X2BINNED", 320, 288, 512, 512, 96, 90, 0.5, 5.46},
    {"NFOV_UNBINNED", 640, 576, 1024, 1024, 192, 180, 0.5, 3.86},
    {"WFOV_2X2BINNED", 512, 512, 512, 512, 0, 0, 0.25, 2.88},
    {"WFOV_UNBINNED", 1024, 1024, 1024, 1024, 0, 0, 0.25, 2.21},
    {"PASSIVE_IR", 1024, 1024, 1024, 1024, 0, 0, 0, 0},
};
constexpr KinectMode kColorModes[] = {
    {"720P", 1280, 720, 1280, 960, 0, 120, 0, 0},
    {"1080P", 1920, 1080, 1920, 1440, 0, 180, 0, 0},
    {"1440P", 2560, 1440, 2560, 1920, 0, 240, 0, 0},
    {"1536P", 2048, 1536, 2048, 1536, 0, 0, 0, 0},
    {"2160P", 3840, 2160, 3840, 2880, 0, 360, 0, 0},
    {"3072P", 4096, 3072, 4096, 3072, 0, 0, 0, 0},
};

/// A value of the file with its name, such as Cameras[0].Intrinsics.
struct CalibrationField {
  const nlohmann::json& json;
  std::string name;

  /// A member; null where there is none.
  CalibrationField operator[](const char* key) const {
    static const nlohmann::json none;
    const auto found = json.is_object() ? json.find(key) : json.end();
    const bool has = json.is_object() && found != json.end();
    return {has ? *found : none, name.empty() ? key : name + "." + key};
  }
  CalibrationField operator[](std::size_t i) const {
    return {json[i], name + "[" + std::to_string(i) + "]"};
  }
};

Error bad_field(const CalibrationField& field, const std::string& why,
                Error::Cause cause = Error::Cause::corrupt) {
  return {cause, "calibration.json: " + field.name + " " + why};
}

Status calibration_number(const CalibrationField& field, const Range& range, double& out) {
  if (!field.json.is_number()) return bad_field(field, "must be a number");
  const auto value = field.json.get<double>();
  if (!range.contains(value))
    return bad_field(field, to_string(range) + ", not " + number_text(value));
  out = value;
  return {};
}

/// `count` numbers of a list that has at least as many.
Result<std::vector<double>> calibration_numbers(const CalibrationField& field, std::size_t count) {
  if (!field.json.is_array() || field.json.size() < count)
    return bad_field(field, "must be a list of " + std::to_string(count) + " numbers");
  std::vector<double> out(count);
  for (std::size_t i = 0; i < count; ++i)
    if (const Status ok = calibration_number(field[i], {-1e6, 1e6}, out[i]); !ok) return ok.error();
  return out;
}

Result<Pose> read_rt(const CalibrationField& field) {
  const auto r = calibration_numbers(field["Rotation"], 9);
  if (!r) return r.error();
  const auto t = calibration_numbers(field["Translation"], 3);
  if (!t) return t.error();
  const std::vector<double>&R = *r, &T = *t;
  if (std::hypot(T[0], T[1], T[2]) > kMostOffset_m)
    return bad_field(field["Translation"], "must be in metres and at most 1 m long");
  const std::array<double, 16> matrix{R[0], R[1], R[2], T[0], R[3], R[4], R[5], T[1],
                                      R[6], R[7], R[8], T[2], 0,    0,    0,    1};
  const auto pose = pose_from_matrix(matrix);
  if (!pose) return bad_field(field["Rotation"], "must be a rotation: " + pose.error().message);
  return *pose;
}

Status read_lens_model(const CalibrationField& field, KinectCamera::Model& model) {
  constexpr std::string_view kPrefix = "CALIBRATION_LensDistortionModel";
  if (!field.json.is_string()) return bad_field(field, "must be the name of a lens model");
  const auto& name = field.json.get_ref<const std::string&>();
  if (name == std::string(kPrefix) + "BrownConrady") {
    model = KinectCamera::Model::brown_conrady;
  } else if (name == std::string(kPrefix) + "Rational6KT") {
    model = KinectCamera::Model::rational_6kt;
  } else {
    return bad_field(field,
                     "is " + in_quotes(name) + "; only BrownConrady and Rational6KT can be read",
                     Error::Cause::unsupported);
  }
  return {};
}

/// The list of parameters: cx, cy, fx, fy, k1 to k6, codx, cody, p2, p1 and perhaps the radius.
Status read_kinect_intrinsics(const CalibrationField& field, KinectCamera& camera) {
  if (const Status ok = read_lens_model(field["ModelType"], camera.model); !ok) return ok;
  double count = 0;
  if (const Status ok = calibration_number(field["ModelParameterCount"], {14, 15}, count); !ok)
    return ok;
  const CalibrationField list = field["ModelParameters"];
  const auto read = calibration_numbers(list, count > 14 ? 15 : 14);
  if (!read) return read.error();
  const std::vector<double>& v = *read;
  camera.cx = v[0], camera.cy = v[1], camera.fx = v[2], camera.fy = v[3];
  for (std::size_t i = 0; i < 2; ++i)
    if (!(v[2 + i] > 0)) return bad_field(list[2 + i], "is a focal length and must be positive");
  std::copy_n(v.begin() + 4, 6, camera.k.begin());
  for (std::size_t i = 10; i < 12; ++i)
    if (v[i] != 0)
      return bad_field(list[i], "shifts the centre of distortion; only 0 can be read",
                       Error::Cause::unsupported);
  camera.p2 = v[12], camera.p1 = v[13];
  camera.metric_radius = v.size() > 14 && v[14] > kUnknownRadius ? v[14] : kUsualRadius;
  return {};
}

/// Sensors of 16:9 count shares of 4096x2304, which is the middle of 4096x3072.
void widen_to_4_3(KinectCamera& camera) {
  camera.cy = (camera.cy * 2304 + 384) / 3072;
  camera.fy = camera.fy * 2304 / 3072;
  camera.sensor_height = camera.sensor_width * 3 / 4;
}

Result<KinectCamera> read_kinect_camera(const CalibrationField& field, bool is_color) {
  KinectCamera camera;
  if (const Status ok = read_kinect_intrinsics(field["Intrinsics"], camera); !ok) return ok.error();
  double width = 0, height = 0, radius = 0;
  if (const Status ok = calibration_number(field["SensorWidth"], {1, 16384}, width); !ok)
    return ok.error();
  if (const Status ok = calibration_number(field["SensorHeight"], {1, 16384}, height); !ok)
    return ok.error();
  camera.sensor_width = static_cast<int>(width), camera.sensor_height = static_cast<int>(height);
  if (is_color && camera.sensor_width * 9 / 16 == camera.sensor_height) widen_to_4_3(camera);
  const CalibrationField radius_field = field["MetricRadius"];
  if (!radius_field.json.is_null())
    if (const Status ok = calibration_number(radius_field, {-1e6, 1e6}, radius); !ok)
      return ok.error();
  if (radius > kUnknownRadius) camera.metric_radius = radius;
  const auto pose = read_rt(field["Rt"]);
  if (!pose) return pose.error();
  camera.T_camera_reference = *pose;
  return camera;
}

/// A camera's place or purpose, without the prefix of its kind; empty where it is no text.
std::string_view kinect_word(const CalibrationField& field) {
  if (!field.json.is_string()) return {};
  std::string_view word = field.json.get_ref<const std::string&>();
  for (const std::string_view prefix : {"CALIBRATION_CameraLocation", "CALIBRATION_CameraPurpose",
                                        "CALIBRATION_InertialSensorType_"})
    if (word.starts_with(prefix)) word.remove_prefix(prefix.size());
  return word;
}

Result<KinectCalibration> read_kinect_cameras(const CalibrationField& list) {
  if (!list.json.is_array()) return bad_field(list, "must be a list");
  std::optional<KinectCamera> depth, color;
  for (std::size_t i = 0; i < list.json.size(); ++i) {
    const CalibrationField field = list[i];
    const std::string_view location = kinect_word(field["Location"]);
    const bool is_color = location == "PV0";
    if (!is_color && location != "D0") continue;
    const auto camera = read_kinect_camera(field, is_color);
    if (!camera) return camera.error();
    std::optional<KinectCamera>& place = is_color ? color : depth;
    if (place) return bad_field(field["Location"], "is that of an earlier camera");
    place = *camera;
  }
  if (!depth)
    return bad_field(list, "have no depth camera (Location CALIBRATION_CameraLocationD0)");
  KinectCalibration calibration;
  calibration.depth = *depth, calibration.color = color;
  return calibration;
}

Result<std::optional<Pose>> read_accelerometer(const CalibrationField& list) {
  if (list.json.is_null()) return std::optional<Pose>{};
  if (!list.json.is_array()) return bad_field(list, "must be a list");
  for (std::size_t i = 0; i < list.json.size(); ++i) {
    if (kinect_word(list[i]["SensorType"]) != "Accelerometer") continue;
    const auto pose = read_rt(list[i]["Rt"]);
    if (!pose) return pose.error();
    return std::optional<Pose>(*pose);
  }
  return std::optional<Pose>{};
}

bool is_kinect_serial(const nlohmann::json& json) {
  constexpr std::size_t kLongest = 64;
  if (!json.is_string()) return false;
  const auto& text = json.get_ref<const std::string&>();
  return text.size() <= kLongest &&
         std::ranges::all_of(text, [](char c) { return c > ' ' && c <= '~'; });
}

/// Without the byte-order mark and what follows the text: zeros.
std::string_view json_text(std::string_view json) {
  if (json.starts_with("\xEF\xBB\xBF")) json.remove_prefix(3);
  while (!json.empty() && json.back() == '\0') json.remove_suffix(1);
  return json;
}

bool same_letters(std::string_view a, std::string_view b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](char x, char y) {
    return std::toupper(static_cast<unsigned char>(x)) ==
           std::toupper(static_cast<unsigned char>(y));
  });
}

const KinectMode* find_mode(std::span<const KinectMode> modes, std::string_view name) {
  for (const KinectMode& mode : modes)
    if (same_letters(mode.name, name)) return &mode;
  return nullptr;
}

Result<Camera> kinect_camera_of(const KinectCamera& from, const KinectMode& mode) {
  Camera camera;
  camera.width = mode.width, camera.height = mode.height;
  camera.cx = from.cx * mode.binned_width - mode.left - 0.5;
  camera.cy = from.cy * mode.binned_height - mode.top - 0.5;
  camera.fx = from.fx * mode.binned_width, camera.fy = from.fy * mode.binned_height;
  const auto zero = [](double v) { return v == 0; };
  if (!std::ranges::all_of(from.k, zero) || from.p1 != 0 || from.p2 != 0)
    camera.distortion = from.model == KinectCamera::Model::rational_6kt
                            ? DistortionModel::rational_6kt
                            : DistortionModel::rational;
  if (camera.distortion != DistortionModel::none) camera.most_radius = from.metric_radius;
  camera.k = from.k;
  camera.p = {from.p1, from.p2};
  const std::vector<std::string> problems = camera.problems();
  if (!problems.empty())
    return Error{Error::Cause::invalid,
                 "calibration.json: in mode " + std::string(mode.name) + ": " + problems.front()};
  return camera;
}

}  // namespace

Result<KinectCalibration> parse_kinect_calibration(std::string_view json) {
  if (json.size() > kMostCalibrationBytes)
    return Error{Error::Cause::too_large, "calibration.json: over 1 MiB is no calibration"};
  const nlohmann::json parsed = nlohmann::json::parse(json_text(json), nullptr, false);
  if (parsed.is_discarded())
    return Error{Error::Cause::corrupt, "calibration.json: not valid JSON, or cut off"};
  const CalibrationField information = CalibrationField{parsed, ""}["CalibrationInformation"];
  if (!information.json.is_object())
    return bad_field(information, "is missing: not a calibration of an Azure Kinect");
  auto calibration = read_kinect_cameras(CalibrationField{information.json, ""}["Cameras"]);
  if (!calibration) return calibration;
  const auto accelerometer =
      read_accelerometer(CalibrationField{information.json, ""}["InertialSensors"]);
  if (!accelerometer) return accelerometer.error();
  calibration->T_accelerometer_reference = *accelerometer;
  const CalibrationField serial = information["Metadata"]["SerialId"];
  if (is_kinect_serial(serial.json)) calibration->serial = serial.json.get<std::string>();
  return calibration;
}

std::span<const KinectMode> kinect_depth_modes() { return kDepthModes; }
std::span<const KinectMode> kinect_color_modes() { return kColorModes; }

const KinectMode* find_depth_mode(std::string_view name) { return find_mode(kDepthModes, name); }

const KinectMode* find_color_mode(std::string_view name) {
  return find_mode(kColorModes, name.substr(name.find('_') + 1));  // npos + 1 is 0
}

Result<Camera> depth_camera(const KinectCalibration& calibration, const KinectMode& mode) {
  return kinect_camera_of(calibration.depth, mode);
}

Result<Camera> color_camera(const KinectCalibration& calibration, const KinectMode& mode) {
  if (!calibration.color)
    return Error{Error::Cause::not_found,
                 "calibration.json: Cameras have no colour camera (Location "
                 "CALIBRATION_CameraLocationPV0)"};
  return kinect_camera_of(*calibration.color, mode);
}

Result<Camera> color_camera(const KinectCalibration& calibration, int width, int height) {
  for (const KinectMode& mode : kColorModes)
    if (mode.width == width && mode.height == height) return color_camera(calibration, mode);
  return Error{Error::Cause::unsupported,
               "calibration.json: no colour mode has " + std::to_string(width) + "x" +
                   std::to_string(height) +
                   " pixels, so the factory calibration does not fit; state color_camera"};
}

Pose T_color_depth(const KinectCalibration& calibration) {
  if (!calibration.color) return {};
  const Pose &color = calibration.color->T_camera_reference,
             &depth = calibration.depth.T_camera_reference;
  // Orbbec's wrapper writes the transform from depth to colour for either camera.
  return color == depth ? color : color * depth.inverse();
}

}  // namespace mr::sensor
