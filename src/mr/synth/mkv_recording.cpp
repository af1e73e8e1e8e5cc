#include "mr/synth/mkv_recording.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <cstdio>
#include <string_view>
#include <utility>

#include "mr/core/range.h"
#include "mr/synth/hash.h"

namespace mr::synth {
namespace {

constexpr std::uint64_t kColorTrack = 1, kDepthTrack = 2, kInfraredTrack = 3, kImuTrack = 4;
constexpr Duration kSampleEvery{8'000'000};
constexpr double kGravity_mps2 = 9.81;

/// A size of the device's pictures, and where it lies in the picture of the whole sensor.
struct MkvMode {
  const char* name;
  int width, height, sensor_width, sensor_height, left, top;
};
constexpr std::array<MkvMode, 4> kMkvDepthModes{{{"NFOV_2X2BINNED", 320, 288, 512, 512, 96, 90},
                                                 {"NFOV_UNBINNED", 640, 576, 1024, 1024, 192, 180},
                                                 {"WFOV_2X2BINNED", 512, 512, 512, 512, 0, 0},
                                                 {"WFOV_UNBINNED", 1024, 1024, 1024, 1024, 0, 0}}};
constexpr std::array<MkvMode, 6> kMkvColorModes{{{"720P", 1280, 720, 1280, 960, 0, 120},
                                                 {"1080P", 1920, 1080, 1920, 1440, 0, 180},
                                                 {"1440P", 2560, 1440, 2560, 1920, 0, 240},
                                                 {"1536P", 2048, 1536, 2048, 1536, 0, 0},
                                                 {"2160P", 3840, 2160, 3840, 2880, 0, 360},
                                                 {"3072P", 4096, 3072, 4096, 3072, 0, 0}}};

/// How a colour format is named and announced.
struct MkvFormat {
  const char* tag;
  const char* fourcc;
  int bits;  ///< per pixel
};
MkvFormat format_of(MkvColor color) {
  constexpr MkvFormat kFormats[] = {
      {"MJPG", "MJPG", 24}, {"NV12", "NV12", 12}, {"YUY2", "YUY2", 16}, {"BGRA", "BGRA", 32}};
  return kFormats[static_cast<int>(color)];
}

const MkvMode* mode_of(std::span<const MkvMode> modes, const Camera& camera) {
  const auto found = std::ranges::find_if(modes, [&](const MkvMode& mode) {
    return mode.width == camera.width && mode.height == camera.height;
  });
  return found == modes.end() ? nullptr : &*found;
}

std::string size_text(const Camera& camera) {
  return std::to_string(camera.width) + "x" + std::to_string(camera.height);
}

// --- calibration.json

std::string json_list(std::span<const double> values) {
  std::string out;
  for (const double v : values) {
    std::array<char, 32> text{};
    std::snprintf(text.data(), text.size(), "%.17g", v);
    out += (out.empty() ? "[" : ",") + std::string(text.data());
  }
  return out + "]";
}

std::string json_pose(const Pose& T) {
  const Vec3d t = T.translation;
  return R"({"Rotation":)" + json_list(T.rotation.m) + R"(,"Translation":)" +
         json_list(std::array<double, 3>{t.x, t.y, t.z}) + "}";
}

std::string json_camera(const Camera& camera, const MkvMode& mode, bool is_color,
                        const Pose& T_camera_depth) {
  const std::array<double, 14> parameters{(camera.cx + mode.left + 0.5) / mode.sensor_width,
                                          (camera.cy + mode.top + 0.5) / mode.sensor_height,
                                          camera.fx / mode.sensor_width,
                                          camera.fy / mode.sensor_height};
  const std::string prefix = R"(":"CALIBRATION_)";
  return R"({"Intrinsics":{"ModelParameterCount":14,"ModelParameters":)" + json_list(parameters) +
         R"(,"ModelType)" + prefix + R"(LensDistortionModelBrownConrady"},"Location)" + prefix +
         (is_color ? "CameraLocationPV0" : "CameraLocationD0") + R"(","Purpose)" + prefix +
         (is_color ? "CameraPurposePhotoVideo" : "CameraPurposeDepth") + R"(","MetricRadius":)" +
         (is_color ? "0" : "1.7399997711181641") + R"(,"Rt":)" + json_pose(T_camera_depth) +
         (is_color ? R"(,"SensorHeight":3072,"SensorWidth":4096})"
                   : R"(,"SensorHeight":1024,"SensorWidth":1024})");
}

/// The axes of the accelerometer of a device, to whole quarters of a turn.
const Pose& accelerometer_from_depth() {
  static const Pose pose{{{0, 0, -1, -1, 0, 0, 0, 1, 0}}, {-0.051, 0.0035, 0.0013}};
  return pose;
}

// --- tracks and tags

std::vector<std::byte> bitmap_header(const Camera& camera, const char* fourcc, int bits,
                                     std::uint32_t bytes) {
  std::vector<std::byte> out;
  const auto put = [&](std::uint32_t value, int count) {
    for (int i = 0; i < count; ++i) out.push_back(static_cast<std::byte>(value >> 8 * i));
  };
  put(40, 4);
  put(camera.width, 4);
  put(camera.height, 4);
  put(1, 2);
  put(bits, 2);
  for (int i = 0; i < 4; ++i) put(static_cast<unsigned char>(fourcc[i]), 1);
  put(bytes, 4);
  out.resize(40);
  return out;
}

std::uint64_t uid_of(const MkvDevice& device, std::uint64_t number) {
  std::uint64_t hash = mix(number);
  for (const char c : device.serial) hash = mix(hash, static_cast<unsigned char>(c));
  return hash >> 5 | 1;
}

std::vector<kit::MatroskaTrack> tracks_of(const MkvDevice& device) {
  const MkvFormat color = format_of(device.color);
  const auto pictures = [&](std::uint64_t number, const char* name, const Camera& camera,
                            const char* fourcc, int bits) {
    kit::MatroskaTrack track;
    track.number = number, track.uid = uid_of(device, number), track.name = name;
    track.codec_id = "V_MS/VFW/FOURCC";
    const std::uint32_t bytes =
        std::string_view(fourcc) == "MJPG" ? 0 : camera.width * camera.height * bits / 8;
    track.codec_private = bitmap_header(camera, fourcc, bits, bytes);
    track.default_duration = Duration(static_cast<std::int64_t>(1e9 / device.fps));
    track.width = camera.width, track.height = camera.height;
    return track;
  };
  kit::MatroskaTrack imu;
  imu.number = kImuTrack, imu.uid = uid_of(device, kImuTrack), imu.name = "IMU";
  imu.kind = kit::MatroskaTrack::Kind::subtitle;
  imu.codec_id = "S_K4A/IMU";
  return {pictures(kColorTrack, "COLOR", device.color_camera, color.fourcc, color.bits),
          pictures(kDepthTrack, "DEPTH", device.depth_camera, "b16g", 16),
          pictures(kInfraredTrack, "IR", device.depth_camera, "b16g", 16), imu};
}

/// In the order of k4arecorder.
std::vector<kit::MatroskaTag> tags_of(const MkvDevice& device, std::uint64_t calibration_uid) {
  constexpr const char* kSync[] = {"STANDALONE", "MASTER", "SUBORDINATE"};
  const auto nanoseconds = [](Duration value) { return std::to_string(value.count()); };
  std::vector<kit::MatroskaTag> tags;
  const auto of_track = [&](const std::string& name, std::uint64_t number, std::string mode) {
    const std::uint64_t uid = uid_of(device, number);
    tags.push_back({"K4A_" + name + "_TRACK", std::to_string(uid), uid});
    tags.push_back({"K4A_" + name + "_MODE", std::move(mode), uid});
  };
  of_track("COLOR", kColorTrack,
           std::string(format_of(device.color).tag) + "_" +
               mode_of(kMkvColorModes, device.color_camera)->name);
  of_track("DEPTH", kDepthTrack, mode_of(kMkvDepthModes, device.depth_camera)->name);
  of_track("IR", kInfraredTrack, "ACTIVE");
  tags.push_back({"K4A_DEPTH_DELAY_NS", nanoseconds(device.depth_delay)});
  tags.push_back({"K4A_WIRED_SYNC_MODE", kSync[static_cast<int>(device.sync)]});
  if (device.sync == MkvDevice::Sync::subordinate)
    tags.push_back({"K4A_SUBORDINATE_DELAY_NS", nanoseconds(device.subordinate_delay)});
  tags.push_back({"K4A_COLOR_FIRMWARE_VERSION", "1.6.110"});
  tags.push_back({"K4A_DEPTH_FIRMWARE_VERSION", "1.6.79"});
  tags.push_back({"K4A_DEVICE_SERIAL_NUMBER", device.serial});
  tags.push_back({"K4A_CALIBRATION_FILE", "calibration.json", 0, calibration_uid});
  of_track("IMU", kImuTrack, "ON");
  tags.push_back({"K4A_START_OFFSET_NS", nanoseconds(device.start_offset)});
  return tags;
}

// --- IMU

/// 40 bytes: time and acceleration, time and turn; little-endian.
std::vector<std::byte> imu_sample(Duration at, Vec3d acceleration_mps2) {
  std::vector<std::byte> out;
  const auto put = [&](std::uint64_t value, int count) {
    for (int i = 0; i < count; ++i) out.push_back(static_cast<std::byte>(value >> 8 * i));
  };
  for (const Vec3d value : {acceleration_mps2, Vec3d{}}) {
    put(at.count(), 8);
    for (int axis = 0; axis < 3; ++axis)
      put(std::bit_cast<std::uint32_t>(static_cast<float>(value[axis])), 4);
  }
  return out;
}

}  // namespace

Status check_recordable(const Camera& depth, const Camera& color, double fps) {
  const auto refuse = [](const std::string& why) {
    return Error{Error::Cause::unsupported, "an Azure Kinect cannot record " + why};
  };
  if (!mode_of(kMkvDepthModes, depth))
    return refuse("depth of " + size_text(depth) +
                  " pixels; it has 320x288, 640x576, 512x512 and 1024x1024");
  if (!mode_of(kMkvColorModes, color))
    return refuse("colour of " + size_text(color) +
                  " pixels; it has 1280x720, 1920x1080, 2560x1440, 2048x1536, 3840x2160 and "
                  "4096x3072");
  if (fps != 5 && fps != 15 && fps != 30)
    return refuse(number_text(fps) + " frames a second; it has 5, 15 and 30");
  return {};
}

std::string mkv_calibration(const MkvDevice& device) {
  const Camera &depth = device.depth_camera, &color = device.color_camera;
  return R"({"CalibrationInformation":{"Cameras":[)" +
         json_camera(depth, *mode_of(kMkvDepthModes, depth), false, {}) + "," +
         json_camera(color, *mode_of(kMkvColorModes, color), true, device.T_color_depth) +
         R"(],"InertialSensors":[{"SensorType":"CALIBRATION_InertialSensorType_Accelerometer",)"
         R"("Rt":)" +
         json_pose(accelerometer_from_depth()) + R"(}],"Metadata":{"SerialId":")" + device.serial +
         R"("}}})";
}

Result<MkvRecording> MkvRecording::create(const std::filesystem::path& file,
                                          const MkvDevice& device) {
  MR_ASSERT(device.depth_camera.distortion == DistortionModel::none);
  MR_ASSERT(device.color_camera.distortion == DistortionModel::none);
  if (const Status can = check_recordable(device.depth_camera, device.color_camera, device.fps);
      !can)
    return can.error();
  const std::string text = mkv_calibration(device);
  const auto bytes = std::as_bytes(std::span(text));
  kit::MatroskaAttachment calibration{"calibration.json",
                                      "application/octet-stream",
                                      uid_of(device, 5),
                                      {bytes.begin(), bytes.end()}};
  kit::MatroskaSettings settings = device.file;
  settings.title = "Azure Kinect", settings.writing_app = "meshreduce synth";
  auto tags = tags_of(device, calibration.uid);
  auto writer = kit::MatroskaWriter::create(file, settings, tracks_of(device), {calibration},
                                            std::move(tags));
  if (!writer) return writer.error();
  return MkvRecording(device, std::move(*writer));
}

Status MkvRecording::write(const Frame& frame) {
  const Duration color_at =
      device_.epoch + device_.subordinate_delay + frame.captured_at().time_since_epoch();
  const Duration depth_at = color_at + device_.depth_delay;
  if (const Status ok = write_samples(std::min(color_at, depth_at)); !ok) return ok;
  if (depth_at < color_at)
    if (const Status ok = write_depth(frame, depth_at); !ok) return ok;
  if (!frame.color.empty()) {
    const auto color = mkv_color(frame.color, device_.color, device_.jpeg_quality);
    if (!color) return color.error();
    const Status ok = writer_.write_frame(kColorTrack, color_at - device_.start_offset, *color);
    if (!ok) return ok;
  }
  return depth_at < color_at ? Status{} : write_depth(frame, depth_at);
}

/// Depth and infrared.
Status MkvRecording::write_depth(const Frame& frame, Duration at) {
  if (frame.depth.empty()) return {};
  const Duration in_file = at - device_.start_offset;
  const Status ok = writer_.write_frame(kDepthTrack, in_file, mkv_depth(frame.depth));
  if (!ok) return ok;
  return writer_.write_frame(kInfraredTrack, in_file,
                             mkv_infrared(frame.depth, device_.depth_camera, frame.color,
                                          device_.color_camera, device_.T_color_depth));
}

/// The samples before a device time; each block holds up to 64.
Status MkvRecording::write_samples(Duration until) {
  constexpr std::size_t kMostInBlock = 64;
  const Vec3d rest =
      accelerometer_from_depth().rotation * (normalized(device_.up_depth) * kGravity_mps2);
  while (next_sample_ < until) {
    const Duration first = next_sample_;
    const std::size_t most = device_.imu_lacing == kit::MatroskaLacing::none ? 1 : kMostInBlock;
    std::vector<std::vector<std::byte>> samples;
    for (; next_sample_ < until && samples.size() < most; next_sample_ += kSampleEvery)
      samples.push_back(imu_sample(next_sample_, rest));
    const std::vector<kit::MatroskaWriter::Frame> frames(samples.begin(), samples.end());
    const Status ok =
        writer_.write_group(kImuTrack, first - device_.start_offset,
                            next_sample_ - kSampleEvery - first, frames, device_.imu_lacing);
    if (!ok) return ok;
  }
  return {};
}

}  // namespace mr::synth
