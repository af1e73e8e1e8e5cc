#pragma once

#include <array>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "mr/core/camera.h"
#include "mr/core/pose.h"
#include "mr/core/result.h"

/// The factory calibration of an Azure Kinect, and of an Orbbec camera behind the same interface:
/// the attachment calibration.json of a recording. Names and formulas are those of the Azure Kinect
/// Sensor SDK (calibration.c, mode_specific_calibration.c, intrinsic_transformation.c).
namespace mr::sensor {

/// One of the device's two cameras, for the whole picture of its sensor.
struct KinectCamera {
  enum class Model { brown_conrady, rational_6kt } model = Model::brown_conrady;
  double cx = 0, cy = 0, fx = 0, fy = 0;  ///< shares of width and height; (0, 0) is a corner
  std::array<double, 6> k{};              ///< k1 to k3 above, k4 to k6 below the fraction bar
  double p1 = 0, p2 = 0;
  /// Of the plane z = 1: the lens model holds within it. Where the file does not know it, 1.7.
  double metric_radius = 1.7;
  int sensor_width = 0, sensor_height = 0;  ///< pixels
  Pose T_camera_reference;                  ///< the depth camera is the reference
};

struct KinectCalibration {
  KinectCamera depth;
  std::optional<KinectCamera> color;
  std::optional<Pose> T_accelerometer_reference;
  std::string serial;  ///< empty where the file does not say
};

/// Reads a calibration.json; a byte-order mark and zeros at its end are allowed. An Error is one
/// line that names the field. A model that mr::Camera cannot express is `unsupported`.
Result<KinectCalibration> parse_kinect_calibration(std::string_view json);

/// How a mode cuts its pictures out of the sensor's, which it first scales to the binned size.
struct KinectMode {
  std::string_view name;  ///< as in tags: "NFOV_UNBINNED"; colour without its format: "720P"
  int width, height;      ///< of its pictures
  int binned_width, binned_height;
  int left, top;         ///< of the picture in the binned one
  double near_m, far_m;  ///< depth that the vendor promises; 0: none (colour, passive infrared)
};

std::span<const KinectMode> kinect_depth_modes();
std::span<const KinectMode> kinect_color_modes();

/// The mode that a tag names, in large or small letters; null for OFF and for unknown names.
const KinectMode* find_depth_mode(std::string_view name);
/// The same; the format in front may be left out: "MJPG_720P", "720P".
const KinectMode* find_color_mode(std::string_view name);

/// The cameras in pixels of a mode. An Error if the lens does not fit the mode.
Result<Camera> depth_camera(const KinectCalibration& calibration, const KinectMode& mode);
Result<Camera> color_camera(const KinectCalibration& calibration, const KinectMode& mode);
/// An Error for sizes of no mode: recordings made smaller afterwards.
Result<Camera> color_camera(const KinectCalibration& calibration, int width, int height);

/// The identity where there is no colour camera.
Pose T_color_depth(const KinectCalibration& calibration);

}  // namespace mr::sensor
