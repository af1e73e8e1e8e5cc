#include "mr/synth/mkv_recording.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <fstream>
#include <map>
#include <set>
#include <sstream>

#include "core/temp_dir.h"
#include "mr/core/file.h"
#include "mr/kit/image_io.h"
#include "mr/sensor/azure_kinect/calibration.h"
#include "mr/synth/export_rig.h"
#include "mr/synth/furniture.h"
#include "mr/synth/rig_errors.h"
#include "mr/synth/room.h"
#include "support/ebml.h"
#include "support/pictures.h"
#include "support/shared_data.h"

namespace mr::synth {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;
using test::Ebml;
using test::TempDir;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;
using MkvBytes = std::vector<std::byte>;

constexpr std::uint32_t kClusterId = 0x1F43B675, kTracksId = 0x1654AE6B, kTagsId = 0x1254C367;

Camera mkv_camera(int width, int height, double focal) {
  Camera c;
  c.width = width, c.height = height;
  c.fx = c.fy = focal, c.cx = width / 2.0, c.cy = height / 2.0;
  return c;
}

MkvDevice mkv_device() {
  MkvDevice out;
  out.depth_camera = mkv_camera(320, 288, 252);
  out.color_camera = mkv_camera(1280, 720, 612);
  out.T_color_depth.translation = {-0.032, 0, 0};
  return out;
}

Frame mkv_frame(int i, double fps = 30) {
  Frame frame;
  frame.exposure_start = frame.exposure_end =
      TimePoint(Duration(static_cast<std::int64_t>(i * 1e9 / fps)));
  frame.depth = ImageDepth(320, 288, 0.258f);
  frame.depth.data[0] = 0, frame.depth.data[1] = 4.660f;
  frame.color = test::gradient(1280, 720);
  return frame;
}

/// A block of a file, with the times of the container.
struct MkvBlock {
  std::uint64_t track = 0;
  Duration at{};
  int lacing = 0;
  MkvBytes payload;  ///< after the head
};

/// What a file holds, by a reader of its own.
struct MkvContent {
  explicit MkvContent(const std::filesystem::path& file) : bytes(*read_file(file)) {
    segment = test::parse_ebml(bytes).at(1);
    for (const Ebml& tag : segment.one(kTagsId).all(0x7373)) {
      const Ebml simple = tag.one(0x67C8);
      tags[simple.one(0x45A3).text()] = simple.one(0x4487).text();
      targets[simple.one(0x45A3).text()] = tag.one(0x63C0).one(0x63C5).number();
    }
    for (const Ebml& cluster : segment.all(kClusterId))
      for (const Ebml& child : cluster.children()) {
        if (child.id == 0xA3) add(child, cluster.one(0xE7).number());
        if (child.id == 0xA0) add(child.one(0xA1), cluster.one(0xE7).number());
      }
  }
  void add(const Ebml& block, std::uint64_t cluster_us) {
    const auto byte = [&](int i) { return std::to_integer<int>(block.content[i]); };
    const auto relative = static_cast<std::int16_t>(byte(1) << 8 | byte(2));
    blocks.push_back({static_cast<std::uint64_t>(byte(0) & 0x7F),
                      microseconds(static_cast<std::int64_t>(cluster_us) + relative),
                      byte(3) >> 1 & 3, MkvBytes(block.content.begin() + 4, block.content.end())});
  }
  std::vector<MkvBlock> of_track(std::uint64_t track) const {
    std::vector<MkvBlock> out;
    for (const MkvBlock& block : blocks)
      if (block.track == track) out.push_back(block);
    return out;
  }
  Ebml track(std::size_t i) const { return segment.one(kTracksId).all(0xAE).at(i); }
  std::string calibration() const { return segment.one(0x1941A469).one(0x61A7).one(0x465C).text(); }
  std::int64_t number(const std::string& tag) const { return std::stoll(tags.at(tag)); }

  const MkvBytes bytes;
  Ebml segment;
  std::map<std::string, std::string> tags;
  std::map<std::string, std::uint64_t> targets;
  std::vector<MkvBlock> blocks;
};

MkvContent recorded(const TempDir& dir, const MkvDevice& of, int frames) {
  auto recording = MkvRecording::create(dir / "a.mkv", of);
  EXPECT_TRUE(recording) << recording.error().message;
  for (int i = 0; i < frames; ++i) EXPECT_TRUE(recording->write(mkv_frame(i, of.fps)));
  EXPECT_TRUE(recording->close());
  return MkvContent(dir / "a.mkv");
}

/// The ids of an element's parts and of theirs, as far as they have any, in order.
std::string shape_of(const Ebml& element) {
  static const std::set<std::uint32_t> kMasters{0x1654AE6B, 0xAE,   0xE0,   0x1941A469, 0x61A7,
                                                0x1254C367, 0x7373, 0x63C0, 0x67C8,     0xA0};
  std::ostringstream out;
  for (const Ebml& child : element.children()) {
    out << std::hex << child.id;
    if (child.id == 0x45A3) out << "=" << child.text();
    if (kMasters.contains(child.id)) out << "(" << shape_of(child) << ")";
    out << " ";
  }
  return out.str();
}

TEST(MkvRecording, HasTheLayoutOfAGenuineOne) {
  const auto file = test::shared_data() / "azure_kinect_mkv/recording.mkv";
  if (!std::filesystem::exists(file)) GTEST_SKIP() << "no recordings at " << file;
  const MkvContent genuine(file);
  const TempDir dir;
  MkvDevice of = mkv_device();
  of.fps = 5, of.depth_camera = mkv_camera(640, 576, 504);
  auto recording = MkvRecording::create(dir / "a.mkv", of);
  ASSERT_TRUE(recording);
  Frame frame = mkv_frame(0);
  frame.depth = ImageDepth(640, 576, 1.0f);
  ASSERT_TRUE(recording->write(frame));
  ASSERT_TRUE(recording->close());
  const MkvContent ours(dir / "a.mkv");
  const auto ids = [](const MkvContent& content) {
    std::vector<std::uint32_t> out;
    for (const Ebml& child : content.segment.children())
      if (out.empty() || out.back() != child.id) out.push_back(child.id);
    return out;
  };
  EXPECT_EQ(ids(ours), ids(genuine));
  for (const std::uint32_t id : {kTracksId, 0x1941A469u, kTagsId})
    EXPECT_EQ(shape_of(ours.segment.one(id)), shape_of(genuine.segment.one(id)));
  for (std::size_t i = 0; i < 4; ++i)
    for (const std::uint32_t id : {0x83u, 0x86u, 0x536Eu, 0x63A2u, 0x23E383u})
      EXPECT_EQ(ours.track(i).one(id).text(), genuine.track(i).one(id).text());
  for (const char* tag : {"K4A_COLOR_MODE", "K4A_DEPTH_MODE", "K4A_IR_MODE", "K4A_IMU_MODE",
                          "K4A_DEPTH_DELAY_NS", "K4A_WIRED_SYNC_MODE", "K4A_CALIBRATION_FILE"})
    EXPECT_EQ(ours.tags.at(tag), genuine.tags.at(tag));
  for (const std::uint64_t track : {2, 3})
    EXPECT_EQ(ours.of_track(track).at(0).payload.size(),
              genuine.of_track(track).at(0).payload.size());
}

TEST(MkvRecording, TagsPointAtTheirTracks) {
  const TempDir dir;
  const MkvContent ours = recorded(dir, mkv_device(), 1);
  const char* const names[] = {"COLOR", "DEPTH", "IR", "IMU"};
  for (std::size_t i = 0; i < 4; ++i) {
    const std::uint64_t uid = ours.track(i).one(0x73C5).number();
    const std::string tag = "K4A_" + std::string(names[i]);
    EXPECT_EQ(ours.track(i).one(0x536E).text(), names[i]);
    EXPECT_EQ(ours.tags.at(tag + "_TRACK"), std::to_string(uid));
    EXPECT_EQ(ours.targets.at(tag + "_TRACK"), uid);
    EXPECT_EQ(ours.targets.at(tag + "_MODE"), uid);
  }
  EXPECT_EQ(ours.tags.at("K4A_DEPTH_MODE"), "NFOV_2X2BINNED");
  EXPECT_EQ(ours.tags.count("K4A_SUBORDINATE_DELAY_NS"), 0u);
}

TEST(MkvRecording, DepthIsMillimetresHighByteFirst) {
  const TempDir dir;
  const MkvContent ours = recorded(dir, mkv_device(), 1);
  const MkvBytes depth = ours.of_track(2).at(0).payload;
  ASSERT_EQ(depth.size(), 2u * 320 * 288);
  const std::array<std::byte, 6> expected{std::byte{0},    std::byte{0}, std::byte{0x12},
                                          std::byte{0x34}, std::byte{1}, std::byte{2}};
  EXPECT_EQ(std::memcmp(depth.data(), expected.data(), 6), 0);
  const MkvBytes infrared = ours.of_track(3).at(0).payload;
  ASSERT_EQ(infrared.size(), depth.size());
  EXPECT_EQ(infrared[0], std::byte{0});
  EXPECT_EQ(infrared[1], std::byte{0});
  EXPECT_NE(infrared[infrared.size() / 2], std::byte{0});
}

TEST(MkvRecording, ColourInEveryFormat) {
  const TempDir dir;
  const ImageRgb picture = mkv_frame(0).color;
  for (const auto format : {MkvColor::mjpg, MkvColor::nv12, MkvColor::yuy2, MkvColor::bgra}) {
    MkvDevice of = mkv_device();
    of.color = format;
    const MkvContent ours = recorded(dir, of, 1);
    const MkvBytes payload = ours.of_track(1).at(0).payload;
    const auto at = [&](std::size_t i) { return std::to_integer<int>(payload.at(i)); };
    const int x = 700, y = 310;  // even
    const std::size_t i = std::size_t{1280} * y + x;
    const std::uint8_t* rgb = picture.at(x, y);
    const double luma = 0.299 * rgb[0] + 0.587 * rgb[1] + 0.114 * rgb[2];
    const double y601 = 16 + luma * 219 / 255, cb = 128 + (rgb[2] - luma) / 1.772 * 224 / 255;
    const double cr = 128 + (rgb[0] - luma) / 1.402 * 224 / 255;
    std::string mode = "BGRA_720P";
    if (format == MkvColor::mjpg) {
      mode = "MJPG_720P";
      const auto decoded = kit::decode_color(payload);
      ASSERT_TRUE(decoded);
      EXPECT_NEAR(decoded->at(x, y)[1], rgb[1], 4);
    } else if (format == MkvColor::nv12) {
      mode = "NV12_720P";
      ASSERT_EQ(payload.size(), 1280u * 720 * 3 / 2);
      EXPECT_NEAR(at(i), y601, 0.51);
      EXPECT_NEAR(at(1280 * 720 + 1280 * y / 2 + x), cb, 2);
      EXPECT_NEAR(at(1280 * 720 + 1280 * y / 2 + x + 1), cr, 2);
    } else if (format == MkvColor::yuy2) {
      mode = "YUY2_720P";
      ASSERT_EQ(payload.size(), 1280u * 720 * 2);
      EXPECT_NEAR(at(2 * i), y601, 0.51);
      EXPECT_NEAR(at(2 * i + 1), cb, 2);
      EXPECT_NEAR(at(2 * i + 3), cr, 2);
    } else {
      ASSERT_EQ(payload.size(), 1280u * 720 * 4);
      EXPECT_EQ(at(4 * i), rgb[2]);
      EXPECT_EQ(at(4 * i + 1), rgb[1]);
      EXPECT_EQ(at(4 * i + 2), rgb[0]);
      EXPECT_EQ(at(4 * i + 3), 255);
    }
    EXPECT_EQ(ours.tags.at("K4A_COLOR_MODE"), mode);
    const std::string header = ours.track(0).one(0x63A2).text();
    ASSERT_EQ(header.size(), 40u);
    EXPECT_EQ(header.substr(16, 4), mode.substr(0, 4));
  }
}

TEST(MkvRecording, TimesAreTheDevicesLessTheStart) {
  const TempDir dir;
  MkvDevice of = mkv_device();
  of.sync = MkvDevice::Sync::subordinate;
  of.subordinate_delay = microseconds(320), of.depth_delay = microseconds(-100);
  of.epoch = std::chrono::seconds(2), of.start_offset = milliseconds(1960);
  const MkvContent ours = recorded(dir, of, 10);
  EXPECT_EQ(ours.tags.at("K4A_WIRED_SYNC_MODE"), "SUBORDINATE");
  EXPECT_EQ(ours.number("K4A_SUBORDINATE_DELAY_NS"), 320'000);
  EXPECT_EQ(ours.number("K4A_DEPTH_DELAY_NS"), -100'000);
  EXPECT_EQ(ours.number("K4A_START_OFFSET_NS"), 1'960'000'000);
  const std::vector<MkvBlock> color = ours.of_track(1), depth = ours.of_track(2);
  ASSERT_EQ(color.size(), 10u);
  ASSERT_EQ(depth.size(), 10u);
  for (int i = 0; i < 10; ++i) {
    const double captured_us = i * 1e6 / 30;
    EXPECT_NEAR(color[i].at.count() * 1e-3, 40'000 + 320 + captured_us, 0.51);
    EXPECT_NEAR(depth[i].at.count() * 1e-3, 40'000 + 220 + captured_us, 0.51);
  }
  EXPECT_EQ(ours.track(0).one(0x23E383).number(), 33'333'333u);
}

TEST(MkvRecording, FramesMayLackAPicture) {
  const TempDir dir;
  auto recording = MkvRecording::create(dir / "a.mkv", mkv_device());
  ASSERT_TRUE(recording);
  Frame no_color = mkv_frame(0), no_depth = mkv_frame(1);
  no_color.color = {}, no_depth.depth = {};
  ASSERT_TRUE(recording->write(no_color));
  ASSERT_TRUE(recording->write(no_depth));
  ASSERT_TRUE(recording->close());
  const MkvContent ours(dir / "a.mkv");
  EXPECT_EQ(ours.of_track(1).size(), 1u);
  EXPECT_EQ(ours.of_track(2).size(), 1u);
  EXPECT_EQ(ours.of_track(3).size(), 1u);
}

float float_at(const MkvBytes& bytes, std::size_t at) {
  float out = 0;
  std::memcpy(&out, &bytes.at(at), 4);
  return out;
}

TEST(MkvRecording, TheAccelerometerMeasuresWhatHoldsItUp) {
  const TempDir dir;
  MkvDevice of = mkv_device();
  of.up_depth = normalized(Vec3d{0.1, -0.9, -0.4});
  const MkvContent ours = recorded(dir, of, 3);
  const auto calibration = sensor::parse_kinect_calibration(ours.calibration());
  ASSERT_TRUE(calibration) << calibration.error().message;
  const std::vector<MkvBlock> blocks = ours.of_track(4);
  ASSERT_EQ(blocks.size(), 3u);
  EXPECT_EQ(blocks[0].at, Duration{});
  std::uint64_t before = 0;
  for (const MkvBlock& block : blocks) {
    EXPECT_EQ(block.lacing, 2);  // fixed sizes
    const auto count = std::to_integer<std::size_t>(block.payload[0]) + 1;
    ASSERT_EQ(block.payload.size(), 1 + 40 * count);
    for (std::size_t at = 1; at < block.payload.size(); at += 40) {
      std::uint64_t time = 0;
      std::memcpy(&time, &block.payload[at], 8);
      EXPECT_EQ(time, before == 0 ? 980'000'000u : before + 8'000'000);
      before = time;
      const Vec3d measured{float_at(block.payload, at + 8), float_at(block.payload, at + 12),
                           float_at(block.payload, at + 16)};
      const Vec3d up = transposed(calibration->T_accelerometer_reference->rotation) * measured;
      EXPECT_LT(length(up - 9.81 * of.up_depth), 1e-5);
      EXPECT_EQ(float_at(block.payload, at + 28), 0);
    }
  }
  EXPECT_GT(before, 1'058'000'000u);  // up to the last picture
}

TEST(MkvRecording, TheCalibrationGivesTheCamerasBack) {
  const TempDir dir;
  const std::pair<Camera, Camera> sizes[] = {
      {mkv_camera(320, 288, 252), mkv_camera(1280, 720, 612)},
      {mkv_camera(640, 576, 504), mkv_camera(1920, 1080, 918)},
      {mkv_camera(512, 512, 252), mkv_camera(2560, 1440, 1224)},
      {mkv_camera(1024, 1024, 504), mkv_camera(2048, 1536, 979)},
      {mkv_camera(640, 576, 504), mkv_camera(3840, 2160, 1836)},
      {mkv_camera(640, 576, 504), mkv_camera(4096, 3072, 1958)}};
  RigConfig rig;
  const Pose T = rig_sensors(rig)[0].T_color_depth;
  for (const auto& [depth, color] : sizes) {
    MkvDevice of = mkv_device();
    of.depth_camera = depth, of.color_camera = color, of.T_color_depth = T;
    const auto read = sensor::parse_kinect_calibration(mkv_calibration(of));
    ASSERT_TRUE(read) << read.error().message;
    EXPECT_EQ(read->serial, of.serial);
    const sensor::KinectMode* mode = nullptr;
    for (const sensor::KinectMode& each : sensor::kinect_depth_modes())
      if (each.width == depth.width && each.far_m > 0) mode = &each;
    ASSERT_NE(mode, nullptr);
    const auto depth_read = sensor::depth_camera(*read, *mode);
    const auto color_read = sensor::color_camera(*read, color.width, color.height);
    ASSERT_TRUE(depth_read && color_read);
    EXPECT_EQ(depth_read->distortion, DistortionModel::none);
    EXPECT_EQ(*depth_read, depth);
    EXPECT_NEAR(color_read->fx, color.fx, 1e-9);
    EXPECT_NEAR(color_read->fy, color.fy, 1e-9);
    EXPECT_NEAR(color_read->cx, color.cx, 1e-9);
    EXPECT_NEAR(color_read->cy, color.cy, 1e-9);
    const Pose T_read = sensor::T_color_depth(*read);
    EXPECT_LT(length(T_read.translation - T.translation), 1e-12);
    for (int i = 0; i < 9; ++i) EXPECT_NEAR(T_read.rotation.m[i], T.rotation.m[i], 1e-12);
  }
}

TEST(MkvRecording, WhatTheDeviceCannotIsOneLine) {
  const Camera depth = mkv_camera(640, 576, 504), color = mkv_camera(1280, 720, 612);
  EXPECT_TRUE(check_recordable(depth, color, 15));
  EXPECT_THAT(check_recordable(mkv_camera(640, 480, 500), color, 30).error().message,
              AllOf(HasSubstr("640x480"), HasSubstr("640x576"), Not(HasSubstr("\n"))));
  EXPECT_THAT(check_recordable(depth, mkv_camera(640, 480, 500), 30).error().message,
              AllOf(HasSubstr("640x480"), HasSubstr("1280x720"), Not(HasSubstr("\n"))));
  EXPECT_THAT(check_recordable(depth, color, 25).error().message, HasSubstr("25 frames"));
  const TempDir dir;
  MkvDevice of = mkv_device();
  of.color_camera.width = 1281;
  EXPECT_FALSE(MkvRecording::create(dir / "a.mkv", of));
  EXPECT_FALSE(std::filesystem::exists(dir / "a.mkv"));
  EXPECT_THAT(MkvRecording::create(dir / "none/a.mkv", mkv_device()).error().message,
              HasSubstr("none/a.mkv"));
}

// --- a whole rig

std::string text_of_file(const std::filesystem::path& file) {
  std::ostringstream out;
  out << std::ifstream(file).rdbuf();
  return out.str();
}

RigConfig mkv_rig() {
  RigConfig rig;
  rig.sensors = 2, rig.frames = 1, rig.loop = true;
  rig.depth_width = 320, rig.depth_height = 288;
  rig.clock_offset_ms = 20, rig.calib_error_mm = 5;
  return rig;
}

Frame rendered_frame(const RigConfig& rig, std::size_t sensor) {
  const std::vector<SensorConfig> sensors = rig_sensors(rig);
  const SensorId wanted[] = {sensor_at(sensor)};
  return **open_rig(rig, sensors, wanted, 30, {})[0]->next();
}

TEST(ExportRig, MkvHoldsTheRigsPicturesOnOneClock) {
  const TempDir dir;
  RigConfig rig = mkv_rig();
  rig.lidars = 1;
  RigExport what{rig, 30, dir.path()};
  what.format = RigExport::Format::mkv, what.mkv_color = MkvColor::bgra;
  ASSERT_TRUE(export_rig(what));
  const MkvContent first(dir / "cam-0.mkv"), second(dir / "cam-1.mkv");
  EXPECT_EQ(first.tags.at("K4A_WIRED_SYNC_MODE"), "MASTER");
  EXPECT_EQ(second.tags.at("K4A_WIRED_SYNC_MODE"), "SUBORDINATE");
  EXPECT_EQ(second.number("K4A_SUBORDINATE_DELAY_NS"), 160'000);
  EXPECT_NE(first.number("K4A_START_OFFSET_NS"), second.number("K4A_START_OFFSET_NS"));
  EXPECT_EQ(first.tags.at("K4A_DEVICE_SERIAL_NUMBER"), "000001000001");
  EXPECT_EQ(second.tags.at("K4A_DEVICE_SERIAL_NUMBER"), "000001000002");
  const Frame frame = rendered_frame(rig, 1);
  const Duration at = first.of_track(1).at(0).at + Duration(first.number("K4A_START_OFFSET_NS"));
  const MkvBlock color = second.of_track(1).at(0), depth = second.of_track(2).at(0);
  EXPECT_EQ(color.at + Duration(second.number("K4A_START_OFFSET_NS")) - at, microseconds(160));
  EXPECT_EQ(color.payload, *mkv_color(frame.color, MkvColor::bgra, 0));
  EXPECT_EQ(depth.payload, mkv_depth(frame.depth));
  const std::string scene = text_of_file(dir / "scene.yaml");
  EXPECT_THAT(scene, AllOf(HasSubstr("source: {type: azure-kinect-mkv, file: cam-1.mkv, loop: true}"
                                     "\n    T_world_depth: ["),
                           HasSubstr("lidar-0/depth/%06d.png"), HasSubstr("model: lidar"),
                           HasSubstr("truth: {mesh:"), Not(HasSubstr("pinhole"))));
  EXPECT_TRUE(std::filesystem::exists(dir / "lidar-0/color/000000.png"));
  EXPECT_FALSE(std::filesystem::exists(dir / "cam-0"));
  EXPECT_TRUE(std::filesystem::exists(dir / "truth/000000.ply"));

  // Gravity is that of the room, seen from where the camera really is.
  const auto calibration = sensor::parse_kinect_calibration(second.calibration());
  ASSERT_TRUE(calibration);
  const MkvBytes sample = second.of_track(4).at(0).payload;
  const Vec3d measured{float_at(sample, 9), float_at(sample, 13), float_at(sample, 17)};
  const Vec3d up_depth = transposed(calibration->T_accelerometer_reference->rotation) * measured;
  const Vec3d up = exact_sensors(rig)[1].T_world_depth[0].rotation * up_depth;
  EXPECT_LT(length(up / 9.81 - room_pose().rotation * Vec3d{0, 0, 1}), 1e-6);
}

TEST(ExportRig, MkvOfAnotherSizeIsRefusedBeforeAnythingIsWritten) {
  const TempDir dir;
  RigExport what{mkv_rig(), 30, dir / "out"};
  what.rig.color_width = 640, what.rig.color_height = 360, what.format = RigExport::Format::mkv;
  const Status written = export_rig(what);
  ASSERT_FALSE(written);
  EXPECT_THAT(written.error().message, HasSubstr("640x360"));
  EXPECT_FALSE(std::filesystem::exists(dir / "out"));
}

}  // namespace
}  // namespace mr::synth
