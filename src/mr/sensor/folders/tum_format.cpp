#include <fmt/format.h>

#include <algorithm>
#include <string>
#include <utility>

#include "mr/sensor/folders/camera_files.h"
#include "mr/sensor/folders/folder_formats.h"
#include "mr/sensor/folders/tum.h"
#include "mr/yaml/flow_text.h"

namespace mr::sensor {
namespace {

/// Cameras of the benchmark's sequences, by words of a folder's name; 640x480 pixels.
struct TumCamera {
  const char *word, *short_word;
  double fx, fy, cx, cy;
};
constexpr TumCamera kTumCameras[] = {
    {"freiburg1", "fr1", 517.3, 516.5, 318.6, 255.3},
    {"freiburg2", "fr2", 520.9, 521.0, 325.1, 249.7},
    {"freiburg3", "fr3", 535.4, 539.2, 320.1, 247.6},
};
constexpr TumCamera kUsualCamera{"", "", 525, 525, 319.5, 239.5};

/// The cameras of sequences that are known, else the benchmark's usual ones.
void add_cameras_by_name(PictureFolder& out) {
  const PictureSize size = picture_size(out.depth);
  if (size.width != 640 || size.height != 480) return;
  out.is_structured_light = true;
  const std::string name = id_of(out.folder);
  const auto* found = std::ranges::find_if(kTumCameras, [&](const TumCamera& camera) {
    return name.find(camera.word) != std::string::npos ||
           name.find(camera.short_word) != std::string::npos;
  });
  const bool is_known = found != std::end(kTumCameras);
  const TumCamera& camera = is_known ? *found : kUsualCamera;
  if (const auto usable = usable_pinhole(size.width, size.height, camera.fx, camera.fy, camera.cx,
                                         camera.cy, out.folder.string()))
    out.depth_camera = *usable;
  out.cameras_from =
      is_known ? fmt::format("the benchmark's values of {}, by the folder's name", camera.word)
               : "the benchmark's usual values (525, 525, 319.5, 239.5)";
  if (!is_known)
    out.comments.push_back(
        "The folder's name tells no camera: these are the benchmark's usual "
        "ones; put in your own.");
}

}  // namespace

bool is_tum(const std::filesystem::path& folder) {
  std::error_code failed;
  return std::filesystem::is_regular_file(folder / "rgb.txt", failed) &&
         std::filesystem::is_regular_file(folder / "depth.txt", failed);
}

Result<PictureFolder> open_tum_recording(const std::filesystem::path& folder) {
  auto tum = read_tum_folder(folder);
  if (!tum) return tum.error();
  PictureFolder out;
  out.format = "TUM RGB-D folder", out.folder = folder;
  out.depth = std::move(tum->pictures.depth), out.color = std::move(tum->pictures.color);
  out.times = std::move(tum->pictures.times);
  out.depth_unit_m = TumSource::kDepthUnit_m;
  out.depth_unit_from = "the layout (metres = value / 5000)";
  out.source = "{type: tum, folder: " + yaml::quoted_text(folder.string()) +
               ", depth_unit_m: " + yaml::exact_text(out.depth_unit_m) + ", loop: true}";
  if (tum->without_color > 0)
    out.notes.push_back(fmt::format("{} of {} depth pictures are left out: no colour within 20 ms",
                                    tum->without_color, tum->without_color + out.depth.size()));
  std::error_code failed;
  const auto poses = folder / "groundtruth.txt";
  if (std::filesystem::exists(poses, failed))
    read_trajectory(out, poses);
  else
    out.notes.push_back("groundtruth.txt is missing");
  add_cameras_by_name(out);
  return out;
}

}  // namespace mr::sensor
