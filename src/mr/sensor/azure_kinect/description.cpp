#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "mr/sensor/azure_kinect/calibration.h"
#include "mr/sensor/azure_kinect/captures.h"
#include "mr/sensor/azure_kinect/source.h"
#include "mr/sensor/depth_to_color.h"
#include "mr/sensor/folders/picture_folder.h"
#include "mr/sensor/folders/text_lines.h"
#include "mr/yaml/flow_text.h"

namespace mr::sensor {
namespace {

double milliseconds(Duration d) { return std::chrono::duration<double, std::milli>(d).count(); }

const char* name_of(KinectHeader::Sync sync) {
  constexpr const char* kNames[] = {"standalone", "master", "subordinate"};
  return kNames[static_cast<int>(sync)];
}

const char* name_of(KinectColorFormat format) {
  constexpr const char* kNames[] = {"MJPG", "NV12", "YUY2", "BGRA"};
  return kNames[static_cast<int>(format)];
}

void add_pictures(const char* track, const std::optional<KinectPictures>& pictures,
                  RecordingInfo& out) {
  if (!pictures) return;
  const std::string name = track;
  out.fields.push_back({name + "_size",
                        std::vector<double>{double(pictures->width), double(pictures->height)},
                        "px"});
  if (!pictures->mode.empty()) out.fields.push_back({name + "_mode", pictures->mode});
}

void add_times(const KinectHeader& header, RecordingInfo& out) {
  out.fields.push_back({"fps", 1e3 / milliseconds(header.period)});
  if (header.first && header.last)
    out.fields.push_back({"duration", milliseconds(*header.last - *header.first) / 1e3, "s"});
  out.fields.push_back({"sync", std::string(name_of(header.sync))});
  out.fields.push_back({"start_offset", std::int64_t{header.start_offset.count()}, "ns"});
  out.fields.push_back({"depth_delay", std::int64_t{header.depth_delay.count()}, "ns"});
  if (header.sync == KinectHeader::Sync::subordinate)
    out.fields.push_back(
        {"subordinate_delay", std::int64_t{header.subordinate_delay.count()}, "ns"});
}

std::vector<double> intrinsics(const Camera& c) { return {c.fx, c.fy, c.cx, c.cy}; }

void add_intrinsics(const SourceCameras& cameras, RecordingInfo& out) {
  out.fields.push_back({"depth_fx_fy_cx_cy", intrinsics(cameras.depth), "px"});
  if (!cameras.color) return;
  out.fields.push_back({"color_fx_fy_cx_cy", intrinsics(*cameras.color), "px"});
  const Vec3d t = cameras.T_color_depth.translation;
  out.fields.push_back({"color_from_depth", std::vector<double>{t.x, t.y, t.z}, "m"});
}

void add_cameras(const KinectHeader& header, const std::filesystem::path& file,
                 RecordingInfo& out) {
  const auto cameras = kinect_cameras(header, file, {});
  if (!cameras) {
    out.notes.push_back(cameras.error().message);
    return;
  }
  add_intrinsics(*cameras, out);
}

/// Metres.
Result<ImageDepth> decode_depth(const KinectBlock& block, const KinectPictures& of) {
  std::vector<float> metres(65536);
  for (std::size_t i = 0; i < metres.size(); ++i) metres[i] = static_cast<float>(i) * 0.001f;
  return decode_counts(block.bytes, of, metres);
}

/// Of the first capture's depth.
void add_first_depth(const KinectPictures& depth, const KinectBlock& block, RecordingInfo& out) {
  auto picture = decode_depth(block, depth);
  if (!picture) {
    out.notes.push_back("first depth picture: " + picture.error().message);
    return;
  }
  ImageDepth::Values& values = picture->data;
  const auto pixels = static_cast<double>(values.size());
  std::erase(values, 0.0f);
  out.fields.push_back({"first_valid_ratio", static_cast<double>(values.size()) / pixels});
  if (values.empty()) return;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::ranges::nth_element(values, middle);
  out.fields.push_back({"first_median", *middle, "m"});
}

/// How much of the first depth picture the colour camera sees: neither outside its picture nor
/// hidden from it.
void add_first_color(const KinectHeader& header, const std::filesystem::path& file,
                     const KinectBlock& depth_block, const KinectBlock& color_block,
                     RecordingInfo& out) {
  const auto cameras = kinect_cameras(header, file, {});
  const auto depth = decode_depth(depth_block, *header.depth);
  const auto color = decode_kinect_color(color_block.bytes, *header.color);
  if (!color) out.notes.push_back("first colour picture: " + color.error().message);
  if (!cameras || !cameras->color || !depth || !color) return;
  const DepthColors colors =
      color_for_depth(*depth, *color, cameras->depth, *cameras->color, cameras->T_color_depth);
  const auto count = [](const auto& values) {
    return static_cast<double>(std::ranges::count_if(values, [](auto v) { return v > 0; }));
  };
  const double valid = count(depth->data);
  if (valid > 0) out.fields.push_back({"first_color_seen_ratio", count(colors.seen.data) / valid});
}

/// Goes through the whole file: how many pictures there are, and whether it can be read to its end.
void add_counts(KinectRecording& recording, const std::filesystem::path& file, RecordingInfo& out) {
  std::int64_t count[4] = {}, samples = 0;
  std::optional<KinectBlock> first_depth, first_color;
  while (true) {
    const auto block = recording.next();
    if (!block) out.notes.push_back(block.error().message);
    if (!block || !*block) break;
    ++count[static_cast<int>((*block)->track)];
    if ((*block)->track == KinectTrack::imu)
      samples += static_cast<std::int64_t>(decode_imu((*block)->bytes).size());
    if ((*block)->track == KinectTrack::depth && !first_depth) first_depth = **block;
    if ((*block)->track == KinectTrack::color && !first_color) first_color = **block;
  }
  if (first_depth) add_first_depth(*recording.header().depth, *first_depth, out);
  if (first_depth && first_color)
    add_first_color(recording.header(), file, *first_depth, *first_color, out);
  const auto of = [&](KinectTrack track) { return count[static_cast<int>(track)]; };
  const KinectHeader& header = recording.header();
  const std::int64_t stated =
      header.first && header.last ? (*header.last - *header.first) / header.period + 1 : 1;
  if (header.depth && of(KinectTrack::depth) < stated)
    out.notes.push_back(
        fmt::format("{} of about {} depth pictures are there: the recording is cut "
                    "off or has gaps",
                    of(KinectTrack::depth), stated));
  out.fields.push_back({"color_pictures", of(KinectTrack::color)});
  out.fields.push_back({"depth_pictures", of(KinectTrack::depth)});
  out.fields.push_back({"infrared_pictures", of(KinectTrack::infrared)});
  out.fields.push_back({"imu_samples", samples});
}

/// Where up is for the depth camera, by the first samples of the accelerometer: what it measures at
/// rest holds the device against gravity. Nothing where the recording has none.
std::optional<Vec3d> up_of(KinectRecording& recording) {
  const auto calibration = parse_kinect_calibration(recording.header().calibration);
  if (!calibration || !calibration->T_accelerometer_reference) return std::nullopt;
  constexpr int kMostBlocks = 100;
  for (int i = 0; i < kMostBlocks; ++i) {
    const auto block = recording.next();
    if (!block || !*block) return std::nullopt;
    if ((*block)->track != KinectTrack::imu) continue;
    Vec3d sum;
    for (const KinectImuSample& sample : decode_imu((*block)->bytes)) {
      const auto& [x, y, z] = sample.acceleration_mps2;
      sum += Vec3d{x, y, z};
    }
    const Vec3d up = transposed(calibration->T_accelerometer_reference->rotation) * sum;
    if (!is_finite(up) || length(up) < 1e-3) return std::nullopt;
    const auto rounded = [](double v) { return std::round(v * 1e4) / 1e4; };
    const Vec3d unit = normalized(up);
    return Vec3d{rounded(unit.x), rounded(unit.y), rounded(unit.z)};
  }
  return std::nullopt;
}

}  // namespace

bool is_kinect_mkv(const std::filesystem::path& path) {
  std::error_code failed;
  return path.extension() == ".mkv" && std::filesystem::is_regular_file(path, failed);
}

Result<RecordingInfo> describe_kinect_mkv(const std::filesystem::path& path) {
  auto recording = KinectRecording::open(path);
  if (!recording) return recording.error();
  const KinectHeader& header = recording->header();
  RecordingInfo out;
  out.format = "Azure Kinect recording (MKV)";
  out.notes = header.notes;
  out.fields.push_back({"serial", header.serial});
  if (!header.color_firmware.empty())
    out.fields.push_back(
        {"firmware", header.color_firmware + " colour, " + header.depth_firmware + " depth"});
  add_pictures("color", header.color, out);
  if (header.color)
    out.fields.push_back({"color_format", std::string(name_of(header.color->format))});
  add_pictures("depth", header.depth, out);
  add_pictures("infrared", header.infrared, out);
  add_times(header, out);
  add_cameras(header, path, out);
  add_counts(*recording, path, out);
  return out;
}

Result<ImportedScene> import_kinect_mkv(const std::filesystem::path& path) {
  auto recording = KinectRecording::open(path);
  if (!recording) return recording.error();
  const KinectHeader& header = recording->header();
  const auto cameras = kinect_cameras(header, path, {});
  if (!cameras) return cameras.error();
  ImportedScene out;
  out.name = id_of(path.stem());
  out.fps = std::round(1e5 / milliseconds(header.period)) / 1e2;
  ImportedSensor sensor;
  sensor.id = id_of(path.stem());
  sensor.source =
      "{type: azure-kinect-mkv, file: " + yaml::quoted_text(path.string()) + ", loop: true}";
  sensor.comments.push_back(
      fmt::format("serial {}, {}; the recording does not say where the sensor stood", header.serial,
                  name_of(header.sync)));
  out.sensors.push_back(std::move(sensor));
  out.notes = header.notes;
  if ((out.up = up_of(*recording)))
    out.notes.push_back("up is what the accelerometer measures at the beginning");
  return out;
}

bool is_kinect_calibration(const std::filesystem::path& path) {
  return is_json_with_key(path, "CalibrationInformation");
}

Result<RecordingInfo> describe_kinect_calibration(const std::filesystem::path& path) {
  const auto in_file = [&](const Error& error) {
    return Error{error.cause, path.string() + ": " + error.message};
  };
  const auto text = read_text_file(path, kMostKinectCalibrationBytes);
  if (!text) return text.error();
  const auto calibration = parse_kinect_calibration(*text);
  if (!calibration) return in_file(calibration.error());
  const auto depth = depth_camera(*calibration, *find_depth_mode("NFOV_UNBINNED"));
  if (!depth) return in_file(depth.error());
  SourceCameras cameras;
  cameras.depth = *depth;
  if (calibration->color) {
    const auto color = color_camera(*calibration, *find_color_mode("720P"));
    if (!color) return in_file(color.error());
    cameras.color = *color;
    cameras.T_color_depth = T_color_depth(*calibration);
  }
  RecordingInfo out;
  out.format = "Azure Kinect calibration (JSON)";
  if (!calibration->serial.empty()) out.fields.push_back({"serial", calibration->serial});
  out.fields.push_back({"depth_mode", std::string("NFOV_UNBINNED")});
  if (cameras.color) out.fields.push_back({"color_mode", std::string("720P")});
  add_intrinsics(cameras, out);
  out.notes.push_back("the cameras of two modes, for example; a recording (.mkv) holds pictures");
  return out;
}

}  // namespace mr::sensor
