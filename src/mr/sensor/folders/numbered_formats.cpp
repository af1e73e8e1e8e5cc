#include <fmt/format.h>

#include <algorithm>
#include <initializer_list>
#include <string>
#include <utility>
#include <vector>

#include "mr/sensor/folders/camera_files.h"
#include "mr/sensor/folders/folder_formats.h"
#include "mr/sensor/folders/numbered_files.h"
#include "mr/sensor/folders/text_lines.h"
#include "mr/yaml/flow_text.h"

namespace mr::sensor {
namespace {

using std::filesystem::path;

constexpr std::size_t kCameraBytes = 1 << 20;

bool is_file(const path& file) {
  std::error_code failed;
  return std::filesystem::is_regular_file(file, failed);
}

bool is_folder(const path& folder) {
  std::error_code failed;
  return std::filesystem::is_directory(folder, failed);
}

/// Whether a folder has one such file at least; looks at no more than the first 10,000 names.
bool has_numbered(const path& folder, std::string_view before, std::string_view after) {
  std::error_code failed;
  int left = 10'000;
  for (std::filesystem::directory_iterator at(folder, failed), end;
       !failed && at != end && left-- > 0; at.increment(failed)) {
    const std::string name = at->path().filename().string();
    if (name.starts_with(before) && name.ends_with(after) &&
        name.size() > before.size() + after.size() &&
        std::all_of(name.begin() + static_cast<std::ptrdiff_t>(before.size()),
                    name.end() - static_cast<std::ptrdiff_t>(after.size()),
                    [](char c) { return c >= '0' && c <= '9'; }))
      return true;
  }
  return false;
}

/// The first of some files that is there; empty: none.
path first_of(const std::vector<path>& files) {
  const auto found = std::ranges::find_if(files, is_file);
  return found == files.end() ? path() : *found;
}

PictureFolder numbered_folder(const char* format, const path& folder) {
  PictureFolder out;
  out.format = format, out.folder = folder;
  out.depth_unit_from = "the layout (millimetres)";
  return out;
}

/// Depth by number, and the colour of each. Error: there is no depth.
Status add_pictures(PictureFolder& out, const NumberedFiles& depth, const NumberedFiles& color) {
  if (depth.empty())
    return Error{Error::Cause::empty, out.folder.string() + ": holds no depth pictures"};
  for (const auto& [number, file] : depth) out.depth.push_back(file);
  std::size_t missing = 0;
  out.color = files_of_items(depth, color, missing);
  note_missing(out, missing, "colour picture: their frames are lost");
  if (color.size() > depth.size() - missing)
    out.notes.push_back(fmt::format("{} colour pictures have no depth and are not used",
                                    color.size() - (depth.size() - missing)));
  return {};
}

/// A pose file for each depth picture.
void add_pose_files(PictureFolder& out, const NumberedFiles& depth, const NumberedFiles& poses) {
  if (poses.empty()) return;
  std::size_t missing = 0;
  const std::vector<path> files = files_of_items(depth, poses, missing);
  note_missing(out, missing, "pose: their frames are lost");
  std::vector<path> there = files;
  std::erase_if(there, [](const path& file) { return !is_file(file); });
  read_pose_files(out, there);
  const std::string text = files_text(files);
  out.T_world_depth = text.starts_with('[') ? "{files: " + text + "}" : text;
}

/// A camera matrix of pictures of a size; a note where it cannot be used.
std::optional<Camera> matrix_camera(PictureFolder& out, const path& file, PictureSize size) {
  const auto text = read_text_file(file, kCameraBytes);
  if (!text) return std::nullopt;
  const auto camera = parse_camera_matrix(*text, size.width, size.height, file.string());
  if (!camera) {
    out.notes.push_back(camera.error().message);
    return std::nullopt;
  }
  out.cameras_from = file.string();
  return *camera;
}

}  // namespace

// ------------------------------------------------------------------------- 7-Scenes and 3DMatch

bool is_seven_scenes(const path& folder) {
  return has_numbered(folder, "frame-", ".depth.png") &&
         (has_numbered(folder, "frame-", ".color.png") ||
          has_numbered(folder, "frame-", ".color.jpg") ||
          has_numbered(folder, "frame-", ".pose.txt"));
}

Result<PictureFolder> open_seven_scenes(const path& folder) {
  PictureFolder out = numbered_folder("7-Scenes or 3DMatch folder", folder);
  out.invalid = {0, 65535};
  out.is_structured_light = true;
  const NumberedFiles depth = numbered_files(folder, "frame-", {".depth.png"});
  const NumberedFiles color = numbered_files(folder, "frame-", {".color.png", ".color.jpg"});
  if (const Status added = add_pictures(out, depth, color); !added) return added.error();
  add_pose_files(out, depth, numbered_files(folder, "frame-", {".pose.txt"}));
  const PictureSize size = picture_size(out.depth);
  const path matrix =
      first_of({folder / "camera-intrinsics.txt", folder.parent_path() / "camera-intrinsics.txt"});
  if (!matrix.empty()) out.depth_camera = matrix_camera(out, matrix, size);
  if (!out.depth_camera && size.width == 640 && size.height == 480) {
    const auto usual = usable_pinhole(640, 480, 585, 585, 320, 240, folder.string());
    if (usual) out.depth_camera = *usual;
    out.cameras_from = "the usual values of 7-Scenes (585, 585, 320, 240)";
    out.comments.push_back("The folder tells no intrinsics: these are " + out.cameras_from + ".");
  }
  if (!color.empty())
    out.comments.push_back(
        "Colour is taken as registered to depth; that of 7-Scenes is not, and "
        "lies about 6 pixels off.");
  return out;
}

// ------------------------------------------------------------------------------------- ScanNet

bool is_scannet(const path& folder) {
  return is_folder(folder / "color") && has_numbered(folder / "depth", "", ".png") &&
         (is_folder(folder / "intrinsic") || has_numbered(folder / "pose", "", ".txt"));
}

Result<PictureFolder> open_scannet(const path& folder) {
  PictureFolder out = numbered_folder("ScanNet export", folder);
  out.is_structured_light = true;
  const NumberedFiles depth = numbered_files(folder / "depth", "", {".png"});
  const NumberedFiles color = numbered_files(folder / "color", "", {".jpg", ".png"});
  if (const Status added = add_pictures(out, depth, color); !added) return added.error();
  add_pose_files(out, depth, numbered_files(folder / "pose", "", {".txt"}));
  if (!out.color.empty())
    out.color_camera =
        matrix_camera(out, folder / "intrinsic/intrinsic_color.txt", picture_size(out.color));
  out.depth_camera =
      matrix_camera(out, folder / "intrinsic/intrinsic_depth.txt", picture_size(out.depth));
  return out;
}

// ------------------------------------------------------------------------------------- Replica

bool is_replica(const path& folder) {
  return has_numbered(folder / "results", "depth", ".png") &&
         has_numbered(folder / "results", "frame", ".jpg");
}

Result<PictureFolder> open_replica(const path& folder) {
  constexpr double kUsualScale = 6553.5;
  PictureFolder out = numbered_folder("Replica folder (NICE-SLAM)", folder);
  const NumberedFiles depth = numbered_files(folder / "results", "depth", {".png"});
  const NumberedFiles color = numbered_files(folder / "results", "frame", {".jpg", ".png"});
  if (const Status added = add_pictures(out, depth, color); !added) return added.error();
  out.depth_unit_m = 1 / kUsualScale;
  out.depth_unit_from = "the layout (metres = value / 6553.5)";
  const path file =
      first_of({folder.parent_path() / "cam_params.json", folder / "cam_params.json"});
  if (file.empty()) {
    out.notes.push_back("cam_params.json is neither in the folder nor above it");
  } else {
    const auto text = read_text_file(file, kCameraBytes);
    if (!text) return text.error();
    const auto camera = parse_replica_camera(*text, file.string());
    if (!camera) return camera.error();
    out.depth_camera = out.color_camera = camera->camera;
    out.depth_unit_m = camera->depth_unit_m;
    out.depth_unit_from = "camera.scale of " + file.string();
    out.cameras_from = file.string();
  }
  if (is_file(folder / "traj.txt"))
    read_trajectory(out, folder / "traj.txt");
  else
    out.notes.push_back("traj.txt is missing");
  return out;
}

// -------------------------------------------------------------------------- Redwood and Open3D

bool is_redwood(const path& folder) {
  return has_numbered(folder / "depth", "", ".png") &&
         (is_folder(folder / "color") || is_folder(folder / "image"));
}

namespace {

/// trajectory.log, or the only other .log of a folder; empty: none.
path log_of(const path& folder) {
  if (is_file(folder / "trajectory.log")) return folder / "trajectory.log";
  std::vector<path> logs;
  std::error_code failed;
  for (std::filesystem::directory_iterator at(folder, failed), end; !failed && at != end;
       at.increment(failed))
    if (at->path().extension() == ".log" && logs.size() < 2) logs.push_back(at->path());
  return logs.size() == 1 ? logs[0] : path();
}

}  // namespace

Result<PictureFolder> open_redwood(const path& folder) {
  PictureFolder out = numbered_folder("Redwood or Open3D folder", folder);
  const char* color_name = is_folder(folder / "color") ? "color" : "image";
  const NumberedFiles depth = numbered_files(folder / "depth", "", {".png"});
  const NumberedFiles color = numbered_files(folder / color_name, "", {".jpg", ".png"});
  if (const Status added = add_pictures(out, depth, color); !added) return added.error();
  const path file = first_of(
      {folder / "camera_intrinsic.json", folder / "camera.json", folder / "intrinsic.json"});
  if (!file.empty()) {
    const auto text = read_text_file(file, kCameraBytes);
    if (!text) return text.error();
    const auto camera = parse_open3d_camera(*text, file.string());
    if (!camera) return camera.error();
    out.depth_camera = *camera;
    out.cameras_from = file.string();
  }
  if (const path log = log_of(folder); !log.empty())
    read_trajectory(out, log);
  else
    out.notes.push_back("no trajectory (.log) is in the folder");
  return out;
}

// ------------------------------------------------------------------------------------ still views

bool is_depth_views(const path& folder) {
  return has_numbered(folder, "depth_", ".png") && has_numbered(folder, "pose_", ".txt");
}

Result<PictureFolder> open_depth_views(const path& folder) {
  PictureFolder out = numbered_folder("still depth views (depth_0.png, pose_0.txt)", folder);
  out.depth_unit_from = "custom (millimetres), for the folder does not tell";
  NumberedFiles depth = numbered_files(folder, "depth_", {".png"});
  const NumberedFiles poses = numbered_files(folder, "pose_", {".txt"});
  const std::size_t all = depth.size();
  std::erase_if(depth, [&](const auto& view) { return !poses.contains(view.first); });
  const NumberedFiles color = numbered_files(folder, "color_", {".jpg", ".png"});
  if (const Status added = add_pictures(out, depth, color); !added) return added.error();
  if (depth.size() < all)
    out.notes.push_back(
        fmt::format("{} of {} views have no pose and are left out", all - depth.size(), all));
  std::size_t none = 0;
  out.still_poses = files_of_items(depth, poses, none);
  read_pose_files(out, out.still_poses);
  const path matrix = first_of({folder / "camera-intrinsics.txt"});
  if (!matrix.empty()) out.depth_camera = matrix_camera(out, matrix, picture_size(out.depth));
  return out;
}

}  // namespace mr::sensor
