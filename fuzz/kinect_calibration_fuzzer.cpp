#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <string_view>

#include "mr/sensor/azure_kinect/calibration.h"

/// A camera that was given out is usable, or it is an Error of one line.
static void check(const mr::Result<mr::Camera>& camera) {
  if (camera && !camera->problems().empty()) std::abort();
  if (!camera && camera.error().message.find('\n') != std::string::npos) std::abort();
}

/// Any bytes as a calibration.json: an Error or cameras for every mode, never a crash.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace mr::sensor;
  const auto read = parse_kinect_calibration({reinterpret_cast<const char*>(data), size});
  if (!read) {
    const std::string& message = read.error().message;
    if (message.empty() || message.find('\n') != std::string::npos) std::abort();
    return 0;
  }
  for (const KinectMode& mode : kinect_depth_modes()) check(depth_camera(*read, mode));
  for (const KinectMode& mode : kinect_color_modes()) check(color_camera(*read, mode));
  if (!mr::is_rigid(T_color_depth(*read))) std::abort();
  return 0;
}
