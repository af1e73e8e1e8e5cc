#include <fmt/format.h>

#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <fstream>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "mr/core/user_text.h"
#include "mr/kit/image_io.h"
#include "mr/sensor/azure_kinect/source.h"
#include "mr/sensor/folders/camera_files.h"
#include "mr/sensor/folders/folder_formats.h"
#include "mr/sensor/folders/text_lines.h"
#include "mr/sensor/realsense/source.h"
#include "mr/yaml/flow_text.h"

namespace mr::sensor {
namespace {

using std::filesystem::path;

Result<CwipcConfig> read_cwipc(const path& folder) {
  const path file = folder / "cameraconfig.json";
  const auto text = read_text_file(file, 4 << 20);
  if (!text) return text.error();
  auto config = parse_cwipc_config(*text, file.string());
  if (config)
    for (CwipcConfig::Camera& camera : config->cameras)
      if (camera.type.empty()) camera.type = config->type;
  return config;
}

/// The recording of a camera; cwipc names it by the serial number where the config does not.
path recording_of(const path& folder, const CwipcConfig::Camera& camera) {
  const char* const ending = camera.type.starts_with("realsense") ? ".bag" : ".mkv";
  return folder / (camera.file.empty() ? camera.serial + ending : camera.file);
}

/// The type of source that reads a camera's recording; empty: none does. Orbbec's SDK records bags,
/// too, of other topics.
std::string_view source_type_of(const path& file, const CwipcConfig::Camera& camera) {
  if (file.extension() == ".mkv") return KinectMkvSource::kType;
  const bool is_orbbec = camera.type.starts_with("orbbec");
  return file.extension() == ".bag" && !is_orbbec ? RealSenseBagSource::kType : "";
}

/// What is unusual about a recording of cwipc.
std::vector<std::string> cwipc_notes(const path& folder, const CwipcConfig& config) {
  std::vector<std::string> out;
  for (const CwipcConfig::Camera& camera : config.cameras) {
    const path file = recording_of(folder, camera);
    const std::string name = "camera " + in_quotes(camera.serial) + " ";
    std::error_code failed;
    if (camera.is_disabled)
      out.push_back(name + "is disabled and left out");
    else if (source_type_of(file, camera).empty())
      out.push_back(name + "is recorded as " + in_quotes(file.filename().string()) +
                    ", which is not supported: left out");
    else if (!std::filesystem::exists(file, failed))
      out.push_back(name + "has no recording: no such file " + in_quotes(file.string()));
    if (!camera.is_disabled && !camera.T_world_camera)
      out.push_back(name + "has no trafo: its place is not known");
    if (!camera.is_disabled && camera.starts_at_us > 0)
      out.push_back(
          fmt::format("{}begins at {:.3f} s (playback_inpoint_micros); it is played from "
                      "its first frame",
                      name, camera.starts_at_us * 1e-6));
  }
  return out;
}

/// Bytes of a file header, little-endian; everything is 0 once its end is passed.
class HeaderReader {
 public:
  explicit HeaderReader(const path& file) : in_(file, std::ios::binary) {}

  template <typename T>
  T get() {
    std::array<char, sizeof(T)> bytes{};
    if (!in_.read(bytes.data(), sizeof(T))) bytes = {};
    return std::bit_cast<T>(bytes);
  }
  std::string text(std::size_t size) {
    std::string out(size, '\0');
    if (!in_.read(out.data(), static_cast<std::streamsize>(size))) out.clear();
    return out;
  }
  bool good() const { return in_.good(); }

 private:
  std::ifstream in_;
};

}  // namespace

// --------------------------------------------------------------------------------------- cwipc

bool is_cwipc(const path& folder) {
  std::error_code failed;
  return std::filesystem::is_regular_file(folder / "cameraconfig.json", failed);
}

Result<RecordingInfo> describe_cwipc(const path& folder) {
  const auto config = read_cwipc(folder);
  if (!config) return config.error();
  RecordingInfo info;
  info.format = "cwipc recording";
  info.fields = {{"type", config->type},
                 {"cameras", static_cast<std::int64_t>(config->cameras.size())}};
  if (config->fps) info.fields.push_back({"fps", *config->fps});
  if (!config->sync_master.empty()) info.fields.push_back({"sync_master", config->sync_master});
  for (const CwipcConfig::Camera& camera : config->cameras)
    info.fields.push_back({"camera " + camera.serial, recording_of(folder, camera).string()});
  info.notes = cwipc_notes(folder, *config);
  return info;
}

Result<ImportedScene> import_cwipc(const path& folder) {
  const auto config = read_cwipc(folder);
  if (!config) return config.error();
  ImportedScene scene;
  scene.name = id_of(folder);
  scene.up = Vec3d{0, 1, 0};
  scene.fps = config->fps.value_or(scene.fps);
  scene.notes = cwipc_notes(folder, *config);
  scene.notes.push_back("up is y, as cwipc has it once its floor is aligned");
  for (const CwipcConfig::Camera& camera : config->cameras) {
    const path file = recording_of(folder, camera);
    const std::string_view type = source_type_of(file, camera);
    if (camera.is_disabled || type.empty()) continue;
    ImportedSensor sensor;
    sensor.id = camera.serial.empty() ? "cam-" + std::to_string(scene.sensors.size())
                                      : id_of(camera.serial);
    sensor.source = "{type: " + std::string(type) + ", file: " + yaml::quoted_text(file.string()) +
                    ", loop: true}";
    if (camera.T_world_camera)
      sensor.T_world_depth = yaml::list_text(camera.T_world_camera->matrix());
    scene.sensors.push_back(std::move(sensor));
  }
  if (scene.sensors.empty())
    return Error{Error::Cause::unsupported, (folder / "cameraconfig.json").string() +
                                                ": names no .mkv and no .bag of an enabled camera"};
  return scene;
}

// --------------------------------------------------------------------------------------- .sens

bool is_sens(const path& file) {
  std::error_code failed;
  return file.extension() == ".sens" && std::filesystem::is_regular_file(file, failed);
}

Result<RecordingInfo> describe_sens(const path& file) {
  static_assert(std::endian::native == std::endian::little);
  constexpr std::uint64_t kMostNameBytes = 4096;
  HeaderReader in(file);
  const auto version = in.get<std::uint32_t>();
  const auto name_bytes = in.get<std::uint64_t>();
  const auto refuse = [&](const std::string& why) {
    return Error{Error::Cause::corrupt, file.string() + ": " + why};
  };
  if (version != 4) return refuse("version " + std::to_string(version) + " of .sens, not 4");
  if (name_bytes > kMostNameBytes) return refuse("the sensor's name is too long");
  RecordingInfo info;
  info.format = "ScanNet recording (.sens)";
  info.fields = {{"sensor", in.text(name_bytes)}};
  std::array<std::array<float, 16>, 4> matrices;  // colour, its extrinsics, depth, its extrinsics
  for (auto& matrix : matrices)
    for (float& value : matrix) value = in.get<float>();
  const auto color_coding = in.get<std::int32_t>(), depth_coding = in.get<std::int32_t>();
  std::uint32_t size[4];
  for (std::uint32_t& side : size) side = in.get<std::uint32_t>();
  const auto shift = in.get<float>();
  const auto frames = in.get<std::uint64_t>();
  if (!in.good() || !(shift > 0)) return refuse("the header is truncated or wrong");
  const auto intrinsics = [](const std::array<float, 16>& m) {
    return std::vector<double>{m[0], m[5], m[2], m[6]};
  };
  const auto name_of = [](std::int32_t coding, std::array<const char*, 3> names) {
    return std::string(coding >= 0 && coding < 3 ? names[static_cast<std::size_t>(coding)]
                                                 : "unknown");
  };
  info.fields.insert(info.fields.end(),
                     {{"frames", static_cast<std::int64_t>(frames)},
                      {"depth_size", fmt::format("{}x{}", size[2], size[3]), "px"},
                      {"color_size", fmt::format("{}x{}", size[0], size[1]), "px"},
                      {"depth_coding", name_of(depth_coding, {"raw", "zlib", "occi"})},
                      {"color_coding", name_of(color_coding, {"raw", "png", "jpeg"})},
                      {"depth_unit", 1.0 / shift, "m"},
                      {"depth_unit_from", "depth_shift of the header"},
                      {"depth_fx_fy_cx_cy", intrinsics(matrices[2]), "px"},
                      {"color_fx_fy_cx_cy", intrinsics(matrices[0]), "px"}});
  info.notes = {
      "export it with ScanNet's SensReader (reader.py) to color/, depth/, pose/ and "
      "intrinsic/; that folder can be imported"};
  return info;
}

// ------------------------------------------------------------------------------ equirectangular

bool is_equirectangular(const path& file) {
  const std::string ending = file.extension().string();
  std::error_code failed;
  if (!(ending == ".jpg" || ending == ".jpeg" || ending == ".JPG") ||
      !std::filesystem::is_regular_file(file, failed))
    return false;
  const auto header = kit::read_picture_header(file);
  return header && header->width == 2 * header->height && header->width >= 1024;
}

Result<RecordingInfo> describe_equirectangular(const path& file) {
  const auto picture = kit::read_color(file);
  if (!picture) return picture.error();
  RecordingInfo info;
  info.format = "equirectangular picture";
  info.fields = {{"color_size", fmt::format("{}x{}", picture->width, picture->height), "px"},
                 {"degrees_a_pixel", 360.0 / picture->width, "deg"}};
  info.notes = {"twice as wide as high: taken for a picture of 360 by 180 degrees",
                "it has no depth and makes no scene by itself"};
  return info;
}

}  // namespace mr::sensor
