#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "core/temp_dir.h"
#include "mr/kit/image_io.h"
#include "mr/scene/scene.h"
#include "mr/sensor/lidar_360/source.h"
#include "mr/sensor/ouster/source.h"
#include "mr/sensor/timelines.h"
#include "support/ouster_packets.h"
#include "support/realsense_bag.h"

/// Sources that tell their own cameras, from the keys of a scene file to frames.
namespace mr {
namespace {

using namespace std::chrono_literals;
using test::Bytes;
using test::TempDir;

std::string text_of(const Bytes& bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

std::string problems_of(const SceneResult& result) {
  std::string out;
  for (const SceneProblem& problem : result.problems) out += to_string(problem) + "\n";
  return out;
}

/// A scene of one sensor with a source, given as the value of the key.
SceneResult scene_with(const std::string& source, const TempDir& dir,
                       const std::string& more = {}) {
  return parse_scene("scene: s\nfps: 10\nsensors:\n  - id: a\n    source: " + source +
                         "\n    T_world_depth: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]\n" +
                         more,
                     dir / "scene.yaml");
}

std::unique_ptr<FrameSource> open(const Scene& scene) {
  const SensorConfig& sensor = scene.sensors.at(0);
  const sensor::SourceType* type = sensor::find_source_type(sensor.source.type());
  return type->open(sensor, {}, sensor::timelines(scene.sensors, scene.fps).at(0));
}

// --- Ouster

/// Writes turns of a sensor all of whose beams measure `range_mm` of the turn; 10 Hz, from 5 s on.
void write_capture(const TempDir& dir, const test::OusterJson& about,
                   const std::vector<std::uint32_t>& range_mm, int lost_packet = -1) {
  const sensor::OusterMetadata metadata = test::ouster_metadata(about);
  const sensor::PacketFormat format = metadata.packet_format();
  std::vector<Bytes> frames;
  unsigned datagram = 0;
  for (std::size_t turn = 0; turn < range_mm.size(); ++turn)
    for (int first = 0; first < metadata.width; first += metadata.columns_per_packet) {
      Bytes packet = test::lidar_packet(
          metadata,
          {.frame_id = static_cast<std::uint32_t>(65534 + turn) & 0xffff, .first_column = first},
          [&](int, int) {
            sensor::LidarPixel pixel;
            pixel.range_mm = range_mm[turn], pixel.near_ir = 500;
            return pixel;
          });
      for (int c = 0; c < format.columns; ++c) {
        const auto since = turn * 100'000'000 + std::uint64_t(first + c) * 100'000'000 /
                                                    static_cast<std::uint64_t>(metadata.width);
        test::put(packet, format.header_bytes + format.column_bytes() * static_cast<std::size_t>(c),
                  8, 5'000'000'000 + since);
      }
      if (lost_packet >= 0 && first / metadata.columns_per_packet == lost_packet) continue;
      for (const Bytes& part : test::ipv4_fragments(test::udp_packet(packet), 1480, ++datagram))
        frames.push_back(test::ethernet(part));
    }
  dir.write("turns.pcap", text_of(test::pcap_file(frames)));
  dir.write("turns.json", test::ouster_json(about));
}

constexpr const char* kOuster = "{type: ouster-pcap, file: turns.pcap, metadata: turns.json}";

TEST(RecordedSources, AnOusterRecordingNeedsNoCameras) {
  const TempDir dir;
  write_capture(dir, {}, {2000, 3000, 4000});
  const SceneResult result = scene_with(kOuster, dir);
  ASSERT_TRUE(result.problems.empty()) << problems_of(result);
  const SensorConfig& sensor = result.scene.sensors[0];
  EXPECT_EQ(sensor.depth_camera.model, CameraModel::lidar);
  EXPECT_EQ(sensor.depth_camera.width, 512);
  EXPECT_EQ(sensor.color_camera->model, CameraModel::equirectangular);
  const auto source = open(result.scene);
  for (int turn = 0; turn < 3; ++turn) {
    const auto frame = source->next();
    ASSERT_TRUE(frame && *frame) << frame.error().message;
    EXPECT_NEAR(*(*frame)->depth.at(200, 8), 2 + turn, 0.001) << turn;
    EXPECT_EQ((*frame)->captured_at(), TimePoint(turn * 100ms));
    EXPECT_NEAR(static_cast<double>(((*frame)->exposure_end - (*frame)->exposure_start).count()),
                1e8 * 511 / 512, 1e3);
    EXPECT_EQ((*frame)->color.height, 256);
  }
  const auto end = source->next();
  EXPECT_TRUE(end && !*end);
}

TEST(RecordedSources, ALostPacketIsAHoleAndNoShift) {
  const TempDir dir;
  write_capture(dir, {}, {2000}, 10);
  const SceneResult result = scene_with(kOuster, dir);
  ASSERT_TRUE(result.problems.empty()) << problems_of(result);
  const auto frame = open(result.scene)->next();
  ASSERT_TRUE(frame && *frame);
  int holes = 0;
  for (int x = 0; x < 512; ++x) holes += *(*frame)->depth.at(x, 8) == 0;
  EXPECT_EQ(holes, 16);
}

TEST(RecordedSources, OusterMistakesAreOneLineEach) {
  const TempDir dir;
  write_capture(dir, {}, {2000});
  dir.write("other.json", test::ouster_json({.width = 1024, .height = 32, .window_last = 1023}));
  dir.write("broken.json", "{");
  const auto first = [&](const std::string& source) {
    const SceneResult result = scene_with(source, dir);
    return result.problems.empty() ? "" : result.problems.front().message;
  };
  EXPECT_NE(first("{type: ouster-pcap, file: turns.pcap, metadata: other.json}")
                .find("is the metadata of this recording?"),
            std::string::npos);
  EXPECT_NE(
      first("{type: ouster-pcap, file: turns.pcap, metadata: broken.json}").find("broken.json"),
      std::string::npos);
  EXPECT_NE(first("{type: ouster-pcap, file: turns.json, metadata: turns.json}").find("turns.json"),
            std::string::npos);
  EXPECT_NE(first("{type: ouster-pcap, file: none.pcap, metadata: turns.json}").find("none.pcap"),
            std::string::npos);
  EXPECT_NE(first("{type: ouster-pcap, file: turns.pcap, metadata: turns.json, sender: me}")
                .find("sender"),
            std::string::npos);
}

// --- RealSense

/// Two captures of 64x48 pixels of depth, 1500 counts, and 96x64 of colour.
test::RealSenseMade realsense() {
  test::RealSenseMade made;
  made.depth_camera.width = 64, made.depth_camera.height = 48;
  made.depth_camera.fx = made.depth_camera.fy = 60;
  made.depth_camera.cx = 32, made.depth_camera.cy = 24;
  made.color_camera = made.depth_camera;
  made.color_camera.width = 96;
  made.T_color_depth.translation = {0.015, 0, 0};
  return made;
}

void write_bag(const TempDir& dir, const test::RealSenseMade& made) {
  test::RealSenseBag bag(made);
  for (const Duration at : {5000ms, 5100ms}) {
    bag.depth(at, std::vector<std::uint16_t>(64 * 48, 1500));
    bag.color(at, Bytes(96 * 48 * 3, std::byte{77}));
  }
  dir.write("rs.bag", text_of(bag.bag.close()));
}

TEST(RecordedSources, ARealSenseRecordingNeedsNoCameras) {
  const TempDir dir;
  write_bag(dir, realsense());
  const SceneResult result =
      scene_with("{type: realsense-bag, file: rs.bag, depth_unit_m: 0.002}", dir);
  ASSERT_TRUE(result.problems.empty()) << problems_of(result);
  const SensorConfig& sensor = result.scene.sensors[0];
  EXPECT_EQ(sensor.depth_camera, realsense().depth_camera);
  EXPECT_EQ(sensor.color_camera, realsense().color_camera);
  EXPECT_EQ(sensor.T_color_depth.translation.x, 0.015);
  const auto source = open(result.scene);
  for (int i = 0; i < 2; ++i) {
    const auto frame = source->next();
    ASSERT_TRUE(frame && *frame) << frame.error().message;
    EXPECT_EQ((*frame)->captured_at(), TimePoint(i * 100ms));
    EXPECT_EQ((*frame)->depth.data[0], 3.0f);
    EXPECT_EQ((*frame)->color.data[0], 77);
  }
}

TEST(RecordedSources, ALensThatIsNotReadHasToBeStated) {
  const TempDir dir;
  test::RealSenseMade made = realsense();
  made.color_model = "Ftheta";
  write_bag(dir, made);
  const std::string source = "{type: realsense-bag, file: rs.bag}";
  EXPECT_NE(problems_of(scene_with(source, dir)).find("or state color_camera in the scene"),
            std::string::npos)
      << problems_of(scene_with(source, dir));
  const SceneResult stated = scene_with(
      source, dir, "    color_camera: {size: [96, 48], fx: 50, fy: 50, cx: 48, cy: 24}\n");
  ASSERT_TRUE(stated.problems.empty()) << problems_of(stated);
  EXPECT_EQ(stated.scene.sensors[0].T_color_depth.translation.x, 0.015);
  const auto frame = open(stated.scene)->next();
  ASSERT_TRUE(frame && *frame) << frame.error().message;
  EXPECT_FALSE((*frame)->color.empty());
  dir.write("rs.bag", "nothing");
  EXPECT_NE(problems_of(scene_with(source, dir)).find("rs.bag: no ROS bag"), std::string::npos);
}

// --- a LiDAR with a 360-degree camera

/// Red where the camera looks left, blue where it looks right, green ahead.
ImageRgb directions(int width) {
  ImageRgb out(width, width / 2);
  for (int y = 0; y < out.height; ++y)
    for (int x = 0; x < width; ++x) {
      const double longitude = ((x + 0.5) / width - 0.5) * 360;
      std::uint8_t* pixel = out.at(x, y);
      if (std::abs(longitude) < 30) pixel[1] = 255;
      if (longitude < -60 && longitude > -120) pixel[0] = 255;
      if (longitude > 60 && longitude < 120) pixel[2] = 255;
    }
  return out;
}

TEST(RecordedSources, ALidarWithACameraIsOneSensor) {
  const TempDir dir;
  write_capture(dir, {}, {2000, 3000});
  ASSERT_TRUE(kit::write_png(dir / "0.png", directions(256)).ok());
  ASSERT_TRUE(kit::write_png(dir / "1.png", ImageRgb(256, 128, std::uint8_t{77})).ok());
  const std::string lidar = "lidar: {type: ouster-pcap, file: turns.pcap, metadata: turns.json}";
  const SceneResult result = scene_with(
      "{type: lidar-360, " + lidar + ", color: {pictures: [0.png, 1.png], fps: 10}}", dir);
  ASSERT_TRUE(result.problems.empty()) << problems_of(result);
  EXPECT_EQ(result.scene.sensors[0].color_camera->width, 256);
  const auto source = open(result.scene);
  const auto first = source->next(), second = source->next();
  ASSERT_TRUE(first && *first && second && *second);
  EXPECT_EQ((*first)->color.at(128, 64)[1], 255);
  EXPECT_EQ((*second)->color.at(128, 64)[1], 77);
}

TEST(RecordedSources, YawTurnsTheCamera) {
  const TempDir dir;
  write_capture(dir, {}, {2000});
  ASSERT_TRUE(kit::write_png(dir / "0.png", directions(256)).ok());
  for (const double yaw : {0.0, 90.0}) {
    const SceneResult result =
        scene_with("{type: lidar-360, lidar: " + std::string(kOuster) +
                       ", color: {pictures: 0.png, yaw_deg: " + std::to_string(yaw) + "}}",
                   dir, "    T_color_depth: [1, 0, 0, 0, 0, 1, 0, 0.1, 0, 0, 1, 0, 0, 0, 0, 1]\n");
    ASSERT_TRUE(result.problems.empty()) << problems_of(result);
    const SensorConfig& sensor = result.scene.sensors[0];
    const auto frame = open(result.scene)->next();
    ASSERT_TRUE(frame && *frame);
    // What lies to the right of the LiDAR lies ahead of a camera that is turned to the right.
    const auto pixel = project(*sensor.color_camera, sensor.T_color_depth * Vec3d{5, 0, 0});
    ASSERT_TRUE(pixel.has_value());
    const std::uint8_t* color = (*frame)->color.at(static_cast<int>(pixel->x), 64);
    EXPECT_EQ(color[yaw == 0 ? 2 : 1], 255) << yaw;
  }
}

TEST(RecordedSources, PanoramasMustBeWholeSpheres) {
  const TempDir dir;
  write_capture(dir, {}, {2000});
  ASSERT_TRUE(kit::write_png(dir / "flat.png", ImageRgb(320, 240)).ok());
  const auto first = [&](const std::string& color) {
    const SceneResult result = scene_with(
        "{type: lidar-360, lidar: " + std::string(kOuster) + ", color: " + color + "}", dir);
    return result.problems.empty() ? "" : result.problems.front().message;
  };
  EXPECT_NE(first("{pictures: flat.png}").find("flat.png: 320x240 pixels"), std::string::npos);
  EXPECT_NE(first("{video: turns.json}").find("turns.json"), std::string::npos);
  EXPECT_NE(first("{fps: 3}").find("one of video, pictures, device"), std::string::npos);
}

}  // namespace
}  // namespace mr
