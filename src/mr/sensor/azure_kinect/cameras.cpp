#include <string>

#include "mr/core/file.h"
#include "mr/sensor/azure_kinect/calibration.h"
#include "mr/sensor/azure_kinect/recording.h"
#include "mr/sensor/azure_kinect/source.h"

namespace mr::sensor {
namespace {

constexpr double kNearest_m = 0.25;  // measured in all modes, if not as exactly as farther away
/// Of depth: random up to 17 mm and systematic up to 11 mm + 0.1 %, as the vendor states them.
constexpr Precision kTimeOfFlight{.base_m = 0.002, .per_m2 = 0.001};

Result<std::string> calibration_text(const KinectHeader& header,
                                     const std::filesystem::path& instead) {
  if (instead.empty()) {
    if (header.calibration.empty())
      return Error{Error::Cause::not_found,
                   "it holds no calibration.json; name one: calibration: FILE"};
    return header.calibration;
  }
  const auto bytes = read_file(instead, kMostKinectCalibrationBytes);
  if (!bytes) return bytes.error();
  return std::string(reinterpret_cast<const char*>(bytes->data()), bytes->size());
}

/// The mode of the depth track: by its tag, else by its size.
Result<const KinectMode*> depth_mode_of(const KinectPictures& depth) {
  const KinectMode* mode = find_depth_mode(depth.mode);
  if (mode && mode->width == depth.width && mode->height == depth.height) return mode;
  for (const KinectMode& other : kinect_depth_modes())
    if (!mode && other.width == depth.width && other.height == depth.height && other.far_m > 0)
      return &other;
  return Error{Error::Cause::unsupported,
               "depth mode '" + depth.mode + "' with pictures of " + std::to_string(depth.width) +
                   "x" + std::to_string(depth.height) +
                   " pixels is none of an Azure Kinect's; state depth_camera in the scene"};
}

Result<SourceCameras> cameras_of(const KinectHeader& header, const std::filesystem::path& instead) {
  if (!header.depth)
    return Error{Error::Cause::unsupported, "it has no depth track: nothing to reconstruct"};
  const auto text = calibration_text(header, instead);
  if (!text) return text.error();
  const auto calibration = parse_kinect_calibration(*text);
  if (!calibration) return calibration.error();
  const auto mode = depth_mode_of(*header.depth);
  if (!mode) return mode.error();
  SourceCameras out;
  auto depth = depth_camera(*calibration, **mode);
  if (!depth) return depth.error();
  out.depth = *std::move(depth);
  out.depth_near_m = kNearest_m;
  if ((*mode)->far_m > 0) out.depth_far_m = (*mode)->far_m;
  out.precision = kTimeOfFlight;
  if (!header.color) return out;
  auto color = color_camera(*calibration, header.color->width, header.color->height);
  if (!color) return color.error();
  out.color = *std::move(color);
  out.T_color_depth = T_color_depth(*calibration);
  return out;
}

}  // namespace

Result<SourceCameras> kinect_cameras(const KinectHeader& header, const std::filesystem::path& file,
                                     const std::filesystem::path& calibration) {
  auto cameras = cameras_of(header, calibration);
  if (!cameras) return Error{cameras.error().cause, file.string() + ": " + cameras.error().message};
  return cameras;
}

}  // namespace mr::sensor
