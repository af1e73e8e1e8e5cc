#include <algorithm>
#include <string>

#include "mr/core/user_text.h"
#include "mr/sensor/realsense/recording.h"
#include "mr/sensor/realsense/source.h"

namespace mr::sensor {
namespace {

/// Of stereo depth: a tenth of a pixel of disparity at 5 cm between the cameras and f = 600 px.
constexpr Precision kStereo{.base_m = 0.002, .per_m2 = 0.003};
constexpr Precision kCloseStereo{.base_m = 0.0005, .per_m2 = 0.01};
constexpr Precision kRealSenseLidar{.base_m = 0.004, .per_m2 = 0.0005};

bool has_coefficients(const RealSenseLens& lens) {
  return std::ranges::any_of(lens.coefficients, [](double c) { return c != 0; });
}

bool is_inverse(const RealSenseLens& lens) {
  return lens.model.starts_with("Inverse") && has_coefficients(lens);
}

/// Sets the distortion; false: the model is not known.
///
/// "Modified" and "Inverse" Brown Conrady differ from Brown in theory. The SDK projects with both
/// as with Brown (rs2_project_point_to_pixel: tangential terms of the distorted radius, which is
/// below a tenth of a pixel), and so do its own aligned pictures.
bool set_distortion(const RealSenseLens& lens, Camera& camera) {
  if (lens.model.empty() || lens.model == "None") return true;
  if (!lens.model.ends_with("Brown Conrady")) return false;
  if (!has_coefficients(lens)) return true;
  const auto& c = lens.coefficients;
  camera.distortion = DistortionModel::brown;
  camera.k = {c[0], c[1], c[4]};
  camera.p = {c[2], c[3]};
  return true;
}

Result<Camera> camera_of(const RealSensePictures& pictures, const char* which) {
  const auto refuse = [&](const std::string& why) {
    return Error{Error::Cause::unsupported, std::string(which) + ": " + why};
  };
  if (!pictures.lens) return refuse("the recording has no camera_info of it");
  const RealSenseLens& lens = *pictures.lens;
  if (lens.width != pictures.width || lens.height != pictures.height)
    return refuse("camera_info is of " + std::to_string(lens.width) + "x" +
                  std::to_string(lens.height) + " pixels, its pictures have " +
                  std::to_string(pictures.width) + "x" + std::to_string(pictures.height));
  Camera out;
  out.width = lens.width, out.height = lens.height;
  out.fx = lens.fx, out.fy = lens.fy, out.cx = lens.cx, out.cy = lens.cy;
  if (!set_distortion(lens, out))
    return refuse("its lens model " + in_quotes(lens.model) + " is not supported");
  if (const auto problems = out.problems(); !problems.empty())
    return refuse("camera_info: " + problems.front());
  return out;
}

void set_depth_figures(const std::string& name, SourceCameras& out) {
  out.precision = kStereo;
  out.depth_near_m = 0.2, out.depth_far_m = 5;
  if (name.find("D405") != std::string::npos) {
    out.precision = kCloseStereo;
    out.depth_near_m = 0.07, out.depth_far_m = 1;
  }
  if (name.find("L515") != std::string::npos) {
    out.precision = kRealSenseLidar;
    out.depth_near_m = 0.25, out.depth_far_m = 6;
  }
}

Result<SourceCameras> all_cameras(const RealSenseHeader& header) {
  if (!header.depth)
    return Error{Error::Cause::unsupported, "it has no depth stream: nothing to reconstruct"};
  SourceCameras out;
  auto depth = camera_of(*header.depth, "depth");
  if (!depth) return depth.error();
  out.depth = *std::move(depth);
  set_depth_figures(header.name, out);
  if (!header.color) return out;
  auto color = camera_of(*header.color, "colour");
  if (!color) return color.error();
  out.color = *std::move(color);
  out.T_color_depth = header.T_color_depth;
  return out;
}

}  // namespace

Result<SourceCameras> realsense_cameras(const RealSenseHeader& header,
                                        const std::filesystem::path& file) {
  auto cameras = all_cameras(header);
  if (!cameras) return Error{cameras.error().cause, file.string() + ": " + cameras.error().message};
  return cameras;
}

std::vector<std::string> realsense_lens_notes(const RealSenseHeader& header) {
  std::vector<std::string> out;
  const auto look_at_lens = [&](const auto& pictures, const char* which, const char* key) {
    if (pictures && pictures->lens && is_inverse(*pictures->lens))
      out.push_back(std::string("lens of ") + which + ": " + pictures->lens->model +
                    " is taken as the SDK projects with it (Brown); where pictures do not fit at "
                    "their corners, calibrate it and state " +
                    key + " in the scene");
  };
  look_at_lens(header.depth, "depth", "depth_camera");
  look_at_lens(header.color, "colour", "color_camera");
  return out;
}

}  // namespace mr::sensor
