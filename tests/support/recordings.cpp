#include "support/recordings.h"

#include <cstdlib>

#include "mr/core/file.h"
#include "mr/synth/mkv_recording.h"
#include "support/ouster_packets.h"
#include "support/realsense_bag.h"

namespace mr::test {
namespace {

/// Recordings of tests are made, or there is no test.
void need(const Status& status) {
  if (status) return;
  std::fputs((status.error().message + "\n").c_str(), stderr);
  std::abort();
}

Camera pinhole(int width, int height, double focal_px) {
  Camera camera;
  camera.width = width, camera.height = height;
  camera.fx = camera.fy = focal_px;
  camera.cx = width / 2.0, camera.cy = height / 2.0;
  return camera;
}

}  // namespace

void write_kinect_recording(const std::filesystem::path& mkv,
                            const std::filesystem::path& calibration) {
  synth::MkvDevice device;
  device.depth_camera = pinhole(320, 288, 252), device.color_camera = pinhole(1280, 720, 612);
  auto recording = synth::MkvRecording::create(mkv, device);
  need(recording ? Status() : Status(recording.error()));
  for (int i = 0; i < 2; ++i) {
    Frame frame;
    frame.exposure_start = frame.exposure_end = TimePoint(i * std::chrono::microseconds(33'333));
    frame.depth = ImageDepth(320, 288, 1.5f);
    frame.color = ImageRgb(1280, 720, std::uint8_t{100});
    need(recording->write(frame));
  }
  need(recording->close());
  need(write_file(calibration, synth::mkv_calibration(device)));
}

void write_ouster_recording(const std::filesystem::path& pcap,
                            const std::filesystem::path& metadata) {
  const OusterJson about;
  const sensor::OusterMetadata sensor = ouster_metadata(about);
  std::vector<Bytes> frames;
  for (std::uint32_t turn = 0; turn < 2; ++turn)
    for (int first = 0; first < sensor.width; first += sensor.columns_per_packet) {
      Bytes packet =
          lidar_packet(sensor, {.frame_id = turn + 1, .first_column = first}, [](int, int) {
            sensor::LidarPixel pixel;
            pixel.range_mm = 2500;
            return pixel;
          });
      frames.push_back(ethernet(ipv4_packet(udp_packet(packet))));
    }
  need(write_file(pcap, pcap_file(frames)));
  need(write_file(metadata, ouster_json(about)));
}

void write_realsense_recording(const std::filesystem::path& bag) {
  RealSenseMade made;
  made.depth_camera = pinhole(64, 48, 60), made.color_camera = pinhole(96, 64, 80);
  RealSenseBag recording(made);
  for (int i = 0; i < 2; ++i) {
    const Duration at = std::chrono::seconds(5) + i * std::chrono::microseconds(33'333);
    recording.depth(at, std::vector<std::uint16_t>(64 * 48, 1500));
    recording.color(at, Bytes(96 * 64 * 3, std::byte{100}));
  }
  need(write_file(bag, recording.bag.close()));
}

}  // namespace mr::test
