#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "mr/core/camera.h"
#include "mr/core/packet.h"
#include "mr/core/pose.h"
#include "mr/core/result.h"

/// The recordings and data sets that `meshreduce info` describes and `meshreduce import` turns into
/// scene files. A new format is three functions in a folder here and a line in
/// recording_formats.cpp.
namespace mr::sensor {

/// What a recording holds, for people and programs.
struct RecordingInfo {
  struct Field {
    std::string name;  ///< such as "depth_size"
    std::variant<std::string, std::int64_t, double, std::vector<double>> value;
    std::string unit{};  ///< such as "px"; empty: none
  };
  std::string format;              ///< such as "Azure Kinect recording (MKV)"
  std::vector<Field> fields;       ///< in the order in which people want to read them
  std::vector<std::string> notes;  ///< what is missing or unusual, one line each
};

/// A sensor of an imported scene. Texts are values of YAML, on one line; paths in them are absolute
/// or relative to the working directory.
struct ImportedSensor {
  std::string id;
  std::string source;                  ///< such as `{type: tum, folder: "/data/fr1_desk"}`
  std::optional<Camera> depth_camera;  ///< nothing: the source tells its cameras
  std::optional<Camera> color_camera{};
  std::optional<Pose> T_color_depth{};
  std::string T_world_depth;  ///< value of the key; empty: not known, the identity with a comment
  std::optional<double> depth_near_m{}, depth_far_m{};
  std::optional<Precision> precision{};
  std::vector<std::string> comments{};  ///< a line each, above the sensor
};

struct ImportedScene {
  std::string name;  ///< an id: letters, digits, - and _
  std::optional<Vec3d> up{};
  double fps = 30;
  double voxel_m = 0.01;  ///< that suits the sensors
  std::vector<ImportedSensor> sensors;
  std::vector<std::string> notes{};  ///< what the user should check, one line each
};

struct RecordingFormat {
  std::string_view name;
  /// Whether a file or folder is of this format, by its name and first bytes. Quick, no errors.
  bool (*recognizes)(const std::filesystem::path& path);
  /// Errors name the file, the field, and what to do.
  Result<RecordingInfo> (*describe)(const std::filesystem::path& path);
  /// Null where the format alone makes no scene.
  Result<ImportedScene> (*import)(const std::filesystem::path& path);
};

/// All formats; the first that recognizes a path has it.
std::span<const RecordingFormat> recording_formats();
/// Null where none recognizes the path.
const RecordingFormat* recognize(const std::filesystem::path& path);

}  // namespace mr::sensor
