#pragma once

#include <cstddef>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "mr/core/camera.h"
#include "mr/core/frame.h"
#include "mr/core/pose.h"
#include "mr/core/result.h"
#include "mr/kit/matroska_writer.h"
#include "mr/synth/mkv_pictures.h"

/// Recordings of a rig's Kinects in the layout of k4arecorder, so that readers can be tested
/// without devices, against a known truth.
namespace mr::synth {

/// A device and what its recording says of it.
struct MkvDevice {
  enum class Sync { standalone, master, subordinate };

  Camera depth_camera, color_camera;  ///< without distortion, of sizes that the device has
  Pose T_color_depth;
  Vec3d up_depth{0, -1, 0};  ///< away from the ground, in the depth camera's frame
  double fps = 30;           ///< 5, 15 or 30
  std::string serial = "000000000001";
  Sync sync = Sync::standalone;
  Duration subordinate_delay{};        ///< of all its pictures after the master's
  Duration depth_delay{};              ///< of depth and infrared after colour; or before
  Duration epoch{1'000'000'000};       ///< device time of what is captured at the time 0
  Duration start_offset{980'000'000};  ///< device time at which the file begins
  MkvColor color = MkvColor::mjpg;
  int jpeg_quality = 95;
  kit::MatroskaLacing imu_lacing = kit::MatroskaLacing::fixed;
  kit::MatroskaSettings file;  ///< title and writing_app are set by the recording
};

/// What an Azure Kinect cannot record, in one line; none: it can.
Status check_recordable(const Camera& depth, const Camera& color, double fps);

/// The calibration.json from which a reader gets the device's cameras back.
std::string mkv_calibration(const MkvDevice& device);

/// Writes one file. The colour picture of a frame that is captured at t has the device time epoch +
/// subordinate_delay + t, in the file less start_offset; depth and infrared follow by depth_delay.
/// The accelerometer rests and measures what holds the device up.
class MkvRecording {
 public:
  /// Errors: check_recordable(); io.
  static Result<MkvRecording> create(const std::filesystem::path& file, const MkvDevice& device);

  /// Frames come in the order of their times. A frame without colour or without depth gets no
  /// block for it.
  Status write(const Frame& frame);
  Status close() { return writer_.close(); }

 private:
  MkvRecording(const MkvDevice& device, kit::MatroskaWriter writer)
      : device_(device), writer_(std::move(writer)), next_sample_(device.start_offset) {}

  Status write_samples(Duration until);
  Status write_depth(const Frame& frame, Duration at);

  MkvDevice device_;
  kit::MatroskaWriter writer_;
  Duration next_sample_;  ///< device time of the IMU
};

}  // namespace mr::synth
