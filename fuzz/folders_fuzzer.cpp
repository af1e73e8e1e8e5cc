#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <string_view>

#include "mr/core/pose.h"
#include "mr/sensor/folders/camera_files.h"
#include "mr/sensor/folders/trajectory_file.h"
#include "mr/sensor/folders/tum.h"

namespace {

void check(bool holds) {
  if (!holds) std::abort();
}

void check_trajectory(std::string_view text) {
  const auto file = mr::sensor::parse_trajectory(text, "poses");
  if (!file) return;
  for (const mr::TimedPose& pose : file->timed.poses()) check(mr::is_rigid(pose.T_world_sensor));
  for (const mr::Pose& pose : file->by_item) check(mr::is_rigid(pose));
  for (const auto& [item, error] : file->lost)
    check(!file->timed.poses().empty() || item < file->by_item.size());
}

void check_lists(std::string_view text) {
  const auto list = mr::sensor::parse_file_list(text, "list");
  if (!list) return;
  for (std::size_t i = 1; i < list->size(); ++i) check((*list)[i - 1].at < (*list)[i].at);
  const auto middle = static_cast<std::ptrdiff_t>(list->size() / 2);
  const std::span<const mr::sensor::TimedFile> all(*list);
  const auto pairs = mr::sensor::associate(all, all.subspan(static_cast<std::size_t>(middle)),
                                           std::chrono::milliseconds(20));
  check(pairs.size() == all.size());
}

void check_camera(const mr::Result<mr::Camera>& camera) {
  check(!camera || camera->problems().empty());
}

}  // namespace

/// Any bytes, after a first one that says what they are, as a file of a data set: an error, or what
/// the pipeline can rely on.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const std::string_view text(reinterpret_cast<const char*>(data) + 1, size - 1);
  switch (data[0] % 6) {
    case 0:
      check_trajectory(text);
      break;
    case 1:
      check_lists(text);
      break;
    case 2:
      check_camera(mr::sensor::parse_camera_matrix(text, 640, 480, "matrix"));
      break;
    case 3:
      check_camera(mr::sensor::parse_open3d_camera(text, "json"));
      break;
    case 4:
      if (const auto replica = mr::sensor::parse_replica_camera(text, "json"))
        check(replica->camera.problems().empty() && replica->depth_unit_m > 0);
      break;
    default:
      if (const auto cwipc = mr::sensor::parse_cwipc_config(text, "json"))
        for (const auto& camera : cwipc->cameras)
          check(!camera.T_world_camera || mr::is_rigid(*camera.T_world_camera));
  }
  return 0;
}
