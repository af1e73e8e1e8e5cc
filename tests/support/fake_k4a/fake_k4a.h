#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "k4a/k4a.h"

/// Depth cameras behind the interface of the Azure Kinect Sensor SDK, which a test plugs in and
/// feeds. Any thread.
namespace mr::fake_k4a {

struct FakeImage {
  int width = 0, height = 0, stride_bytes = 0;
  std::vector<std::uint8_t> bytes;
  std::uint64_t device_usec = 0;
  std::chrono::nanoseconds arrived{};  ///< of the steady clock; 0: now
};
struct FakeCapture {
  std::optional<FakeImage> depth, color;
};

/// What a device is like.
struct FakeDevice {
  std::string serial;
  std::string calibration;  ///< calibration.json
  bool in_use = false;      ///< by another program
  bool starts = true;
  bool sync_in = false, sync_out = false;
  std::set<k4a_color_control_command_t> refused{};
  /// Frames at the device's pace beside those of deliver(); empty: none.
  std::function<FakeCapture(std::uint64_t index)> stream{};
};

struct SetControl {
  std::string serial;
  k4a_color_control_command_t command;
  k4a_color_control_mode_t mode;
  std::int32_t value;
};
struct StartedCameras {
  std::string serial;
  k4a_device_configuration_t configuration;
};

/// Nothing plugged in, nothing recorded. Waits for frames last `patience` of what is asked for.
void reset(double patience = 0.02);
void plug(FakeDevice device);
/// Its handles stay, and fail.
void unplug(const std::string& serial);
/// The next capture of a device.
void deliver(const std::string& serial, FakeCapture capture);

// What was called.
std::vector<SetControl> controls();
std::vector<StartedCameras> started();  ///< in this order
int open_devices();
int live_handles();  ///< captures and images that were not released

/// A depth picture of one distance, and an image of bytes such as a JPEG.
FakeImage flat_depth(int width, int height, std::uint16_t mm, std::uint64_t device_usec,
                     int padding_bytes = 0);
FakeImage image_of(std::span<const std::byte> bytes, int width, int height,
                   std::uint64_t device_usec);

/// A calibration.json with the parameters of FORMATS.md 3.6.
std::string example_calibration();

}  // namespace mr::fake_k4a
