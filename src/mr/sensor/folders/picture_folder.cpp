#include "mr/sensor/folders/picture_folder.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <utility>

#include "mr/kit/image_io.h"
#include "mr/sensor/folders/camera_files.h"
#include "mr/sensor/folders/numbered_files.h"
#include "mr/sensor/folders/text_lines.h"
#include "mr/sensor/folders/trajectory_file.h"
#include "mr/sensor/rgbd_images.h"
#include "mr/yaml/flow_text.h"

namespace mr::sensor {
namespace {

using Field = RecordingInfo::Field;

constexpr std::size_t kFirstPictures = 10;  ///< opened until one can be read
constexpr double kUsualFps = 30;

std::string size_text(PictureSize size) { return fmt::format("{}x{}", size.width, size.height); }

/// What the first depth picture that can be read holds.
struct FirstDepth {
  PictureSize size;
  double valid_ratio = 0, median_m = 0;
};

Result<FirstDepth> first_depth(const PictureFolder& folder) {
  std::optional<Error> error;
  for (std::size_t i = 0; i < std::min(folder.depth.size(), kFirstPictures); ++i) {
    const auto picture = kit::read_depth16(folder.depth[i]);
    if (!picture && !error) error = picture.error();
    if (!picture) continue;
    std::vector<std::uint16_t> valid;
    for (const std::uint16_t count : picture->data)
      if (std::ranges::find(folder.invalid, count) == folder.invalid.end() && count > 0)
        valid.push_back(count);
    FirstDepth out{{picture->width, picture->height}};
    out.valid_ratio = static_cast<double>(valid.size()) / static_cast<double>(picture->data.size());
    if (valid.empty()) return out;
    const auto middle = valid.begin() + static_cast<std::ptrdiff_t>(valid.size() / 2);
    std::nth_element(valid.begin(), middle, valid.end());
    out.median_m = *middle * folder.depth_unit_m;
    return out;
  }
  return error.value_or(
      Error{Error::Cause::empty, folder.folder.string() + ": holds no depth pictures"});
}

/// By the median of the times between captures; a camera's nominal rate where one is near.
double fps_of(const std::vector<TimePoint>& times) {
  if (times.size() < 2) return kUsualFps;
  std::vector<double> apart_s;
  for (std::size_t i = 1; i < times.size(); ++i)
    apart_s.push_back(std::chrono::duration<double>(times[i] - times[i - 1]).count());
  const auto middle = apart_s.begin() + static_cast<std::ptrdiff_t>(apart_s.size() / 2);
  std::nth_element(apart_s.begin(), middle, apart_s.end());
  const double fps = std::clamp(1 / std::max(*middle, 1e-6), 0.1, 240.0);
  for (const double nominal : {5.0, 10.0, 15.0, 25.0, 30.0, 50.0, 60.0, 90.0})
    if (std::abs(fps - nominal) < 0.03 * nominal) return nominal;
  return fps;
}

double span_s(const std::vector<TimePoint>& times) {
  return std::chrono::duration<double>(times.back() - times.front()).count();
}

/// To so many parts of one, such as 1000 for thousandths.
double rounded(double value, double parts) { return std::round(value * parts) / parts; }

std::vector<double> intrinsics(const Camera& camera) {
  return {camera.fx, camera.fy, camera.cx, camera.cy};
}

void add_cameras(const PictureFolder& folder, RecordingInfo& info) {
  if (folder.depth_camera)
    info.fields.push_back({"depth_fx_fy_cx_cy", intrinsics(*folder.depth_camera), "px"});
  if (folder.color_camera)
    info.fields.push_back({"color_fx_fy_cx_cy", intrinsics(*folder.color_camera), "px"});
  info.fields.push_back(
      {"cameras_from", folder.cameras_from.empty() ? "not known" : folder.cameras_from});
}

void add_times(const PictureFolder& folder, RecordingInfo& info) {
  if (!folder.still_poses.empty()) return;
  if (folder.times.empty()) {
    info.notes.push_back("the pictures have no times; 30 a second are taken for granted");
    return;
  }
  info.fields.push_back({"span", rounded(span_s(folder.times), 1e4), "s"});
  info.fields.push_back({"fps", rounded(fps_of(folder.times), 1e3)});
}

/// Usual intrinsics of cameras with pictures of this size; nothing: none is known.
struct NominalCamera {
  const char* name;
  int width, height;
  double fx, fy, cx, cy;
};
constexpr NominalCamera kNominalCameras[] = {
    {"Kinect v1 and PrimeSense", 640, 480, 525, 525, 319.5, 239.5},
    {"Azure Kinect NFOV", 640, 576, 504, 504, 320, 288},
    {"Azure Kinect NFOV binned", 320, 288, 252, 252, 160, 144},
    {"Kinect v2", 512, 424, 365.5, 365.5, 256, 212},
};

/// The cameras of a folder that does not tell them.
Status add_nominal_camera(PictureFolder& folder, PictureSize size) {
  if (folder.depth_camera) return {};
  const auto* found = std::ranges::find_if(kNominalCameras, [&](const NominalCamera& camera) {
    return camera.width == size.width && camera.height == size.height;
  });
  if (found == std::end(kNominalCameras))
    return Error{Error::Cause::not_found,
                 fmt::format("{}: no intrinsics are known for depth of {} pixels; write the 3x3 "
                             "camera matrix to camera-intrinsics.txt there",
                             folder.folder.string(), size_text(size))};
  const auto camera = usable_pinhole(size.width, size.height, found->fx, found->fy, found->cx,
                                     found->cy, folder.folder.string());
  if (!camera) return camera.error();
  folder.depth_camera = *camera;
  folder.cameras_from = std::string("nominal values of ") + found->name;
  folder.comments.push_back("The folder tells no intrinsics: these are " + folder.cameras_from +
                            "; put in your own.");
  return {};
}

/// A camera of pictures that are `scale` times as large.
Camera scaled(Camera camera, double scale, PictureSize size) {
  camera.fx *= scale, camera.fy *= scale;
  camera.cx = (camera.cx + 0.5) * scale - 0.5, camera.cy = (camera.cy + 0.5) * scale - 0.5;
  camera.width = size.width, camera.height = size.height;
  return camera;
}

/// Where the folder does not tell it: the depth camera, if pictures of both have the same sides;
/// for 16:9 that of an Azure Kinect.
Status add_color_camera(PictureFolder& folder) {
  if (folder.color.empty() || folder.color_camera) return {};
  const PictureSize size = picture_size(folder.color);
  const Camera& depth = *folder.depth_camera;
  const double scale = static_cast<double>(size.width) / depth.width;
  if (size.width > 0 && std::abs(scale * depth.height - size.height) <= 1) {
    folder.color_camera = scaled(depth, scale, size);
    return {};
  }
  if (size.width == 0 || size.width * 9 != size.height * 16)
    return Error{Error::Cause::not_found,
                 fmt::format("{}: no intrinsics are known for colour of {} pixels",
                             folder.folder.string(), size_text(size))};
  const double focal = 612.0 * size.width / 1280;
  const auto camera = usable_pinhole(size.width, size.height, focal, focal, size.width / 2.0,
                                     size.height / 2.0, folder.folder.string());
  if (!camera) return camera.error();
  folder.color_camera = *camera;
  folder.comments.push_back(
      "The folder tells no colour camera: these are nominal values of an "
      "Azure Kinect's, and T_color_depth is not known; put in your own.");
  return {};
}

/// Against the mean of the cameras' y axes: people hold cameras upright.
std::optional<Vec3d> mean_up(const std::vector<Pose>& poses) {
  Vec3d sum;
  for (const Pose& pose : poses) sum = sum - pose.rotation.column(1);
  if (poses.empty() || length(sum) < 0.3 * static_cast<double>(poses.size())) return std::nullopt;
  const Vec3d up = normalized(sum);
  return Vec3d{rounded(up.x, 1e3), rounded(up.y, 1e3), rounded(up.z, 1e3)};
}

/// `items`: as the keys depth and color have them.
std::string images_source(const PictureFolder& folder, const std::string& depth,
                          const std::string& color) {
  std::string invalid;
  for (const std::uint16_t count : folder.invalid)
    invalid += (invalid.empty() ? "" : ", ") + std::to_string(count);
  return "{type: rgbd-images, " + (color.empty() ? "" : "color: " + color + ", ") +
         "depth: " + depth + ", depth_unit_m: " + yaml::exact_text(folder.depth_unit_m) +
         ", invalid: [" + invalid + "], loop: true}";
}

ImportedSensor imported_sensor(const PictureFolder& folder, std::string id) {
  ImportedSensor out;
  out.id = std::move(id), out.source = folder.source;
  out.depth_camera = folder.depth_camera;
  if (!folder.color.empty()) {
    out.color_camera = folder.color_camera;
    out.T_color_depth = folder.T_color_depth;
  }
  out.T_world_depth = folder.T_world_depth;
  if (folder.is_structured_light) {
    out.depth_near_m = 0.4, out.depth_far_m = 4;
    out.precision = Precision{.base_m = 0.002, .per_m2 = 0.003};
  }
  out.comments = folder.comments;
  return out;
}

void add_sensors(const PictureFolder& folder, ImportedScene& scene) {
  if (folder.still_poses.empty()) {
    ImportedSensor sensor = imported_sensor(folder, scene.name);
    if (sensor.source.empty())
      sensor.source = images_source(folder, files_text(folder.depth),
                                    folder.color.empty() ? "" : files_text(folder.color));
    return scene.sensors.push_back(std::move(sensor));
  }
  for (std::size_t i = 0; i < folder.depth.size(); ++i) {
    ImportedSensor view = imported_sensor(folder, "view-" + std::to_string(i));
    view.source = images_source(folder, files_text({folder.depth[i]}),
                                folder.color.empty() ? "" : files_text({folder.color[i]}));
    view.T_world_depth = "{file: " + yaml::quoted_text(folder.still_poses[i].string()) + "}";
    if (i > 0) view.comments.clear();
    scene.sensors.push_back(std::move(view));
  }
}

}  // namespace

PictureSize picture_size(const std::vector<std::filesystem::path>& files) {
  for (std::size_t i = 0; i < std::min(files.size(), kFirstPictures); ++i)
    if (const auto header = kit::read_picture_header(files[i]))
      return {header->width, header->height};
  return {};
}

void note_missing(PictureFolder& folder, std::size_t missing, const std::string& what) {
  if (missing > 0)
    folder.notes.push_back(
        fmt::format("{} of {} depth pictures have no {}", missing, folder.depth.size(), what));
}

void read_pose_files(PictureFolder& folder, const std::vector<std::filesystem::path>& files) {
  std::optional<Error> first;
  for (const auto& file : files) {
    const auto read = read_trajectory_file(file);
    if (read && read->by_item.size() == 1) {
      folder.poses.push_back(read->by_item[0]);
      continue;
    }
    ++folder.lost_poses;
    if (!first && !read) first = read.error();
  }
  if (folder.lost_poses > 0)
    folder.notes.push_back(fmt::format("{} of {} poses cannot be used, their frames are lost{}",
                                       folder.lost_poses, files.size(),
                                       first ? "; first: " + first->message : ""));
}

void read_trajectory(PictureFolder& folder, const std::filesystem::path& file) {
  const auto read = read_trajectory_file(file);
  if (!read) {
    folder.notes.push_back("no poses: " + read.error().message);
    return;
  }
  for (const TimedPose& pose : read->timed.poses()) folder.poses.push_back(pose.T_world_sensor);
  for (std::size_t i = 0; i < read->by_item.size(); ++i)
    if (!read->lost.contains(i)) folder.poses.push_back(read->by_item[i]);
  folder.lost_poses = read->lost.size();
  const std::size_t items = folder.depth.size(), all = read->by_item.size();
  if (!read->by_item.empty() && all != items) {
    folder.notes.push_back(fmt::format("{} holds {} poses for {} depth pictures; they are not used",
                                       file.string(), all, items));
    return;
  }
  folder.T_world_depth = "{trajectory: " + yaml::quoted_text(file.string()) + "}";
}

std::string id_of(const std::filesystem::path& path) {
  const std::filesystem::path whole = path.has_filename() ? path : path.parent_path();
  std::string out;
  for (const char c : whole.filename().string().substr(0, 64)) {
    const bool is_allowed = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') ||
                            (c >= '0' && c <= '9') || c == '-' || c == '_';
    out += is_allowed ? c : '-';
  }
  return out.empty() || out == "." || out == ".." ? "recording" : out;
}

Result<RecordingInfo> describe(const PictureFolder& folder) {
  const auto depth = first_depth(folder);
  if (!depth) return depth.error();
  RecordingInfo info;
  info.format = folder.format;
  info.fields = {{"depth_pictures", static_cast<std::int64_t>(folder.depth.size())},
                 {"color_pictures", static_cast<std::int64_t>(folder.color.size())},
                 {"depth_size", size_text(depth->size), "px"}};
  if (!folder.color.empty())
    info.fields.push_back({"color_size", size_text(picture_size(folder.color)), "px"});
  info.fields.push_back({"depth_unit", folder.depth_unit_m, "m"});
  info.fields.push_back({"depth_unit_from", folder.depth_unit_from});
  info.fields.push_back({"first_depth_median", rounded(depth->median_m, 1e4), "m"});
  info.fields.push_back({"first_depth_valid", rounded(100 * depth->valid_ratio, 10), "%"});
  info.notes = folder.notes;
  add_times(folder, info);
  info.fields.push_back({"poses", static_cast<std::int64_t>(folder.poses.size())});
  add_cameras(folder, info);
  RgbdImagesSource unit;
  unit.depth_unit_m = folder.depth_unit_m;
  if (const auto hint = unit.depth_hint(depth->median_m)) info.notes.push_back(*hint);
  if (folder.T_world_depth.empty() && folder.still_poses.empty())
    info.notes.push_back("no poses are known: the camera has to stand still");
  return info;
}

Result<ImportedScene> imported(const PictureFolder& folder) {
  const auto depth = first_depth(folder);
  if (!depth) return depth.error();
  PictureFolder whole = folder;
  if (const Status known = add_nominal_camera(whole, depth->size); !known) return known.error();
  if (const Status known = add_color_camera(whole); !known) return known.error();
  ImportedScene scene;
  scene.name = id_of(folder.folder);
  scene.fps = fps_of(folder.times);
  scene.up = mean_up(folder.poses);
  if (scene.up) scene.notes.push_back("up is where the cameras' pictures point upwards on average");
  scene.notes.push_back(
      fmt::format("depth_unit_m is {} by {}; the first picture's median depth "
                  "is then {:.2f} m",
                  yaml::exact_text(folder.depth_unit_m), folder.depth_unit_from, depth->median_m));
  scene.notes.push_back("cameras: " + whole.cameras_from);
  scene.notes.insert(scene.notes.end(), folder.notes.begin(), folder.notes.end());
  add_sensors(whole, scene);
  return scene;
}

}  // namespace mr::sensor
