#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "mr/core/sensor_config.h"
#include "mr/kit/image_io.h"
#include "mr/sensor/azure_kinect/calibration.h"
#include "mr/sensor/k4a/k4a_source.h"
#include "support/fake_k4a/fake_k4a.h"

namespace mr::sensor {

/// Devices that are plugged into a fake bus, and sensors of a scene for them.
class K4aRig : public testing::Test {
 protected:
  K4aRig() { fake_k4a::reset(); }
  ~K4aRig() override {
    EXPECT_EQ(fake_k4a::open_devices(), 0) << "a device is left open";
    EXPECT_EQ(fake_k4a::live_handles(), 0) << "a capture or an image is not released";
    fake_k4a::reset();
  }

  static fake_k4a::FakeDevice device(const std::string& serial) {
    return {.serial = serial, .calibration = fake_k4a::example_calibration()};
  }
  static K4aSource source(const std::string& serial, bool color = true) {
    K4aSource out;
    out.serial = serial;
    out.depth_mode = K4aSource::DepthMode::nfov_binned;  // small
    if (color) out.color = K4aSource::Color::p720;
    return out;
  }
  /// Its cameras as the device is calibrated.
  static SensorConfig sensor(const K4aSource& source) {
    const auto calibration = *parse_kinect_calibration(fake_k4a::example_calibration());
    SensorConfig out;
    out.id = "cam";
    out.source = source;
    out.depth_camera = *depth_camera(calibration, source.depth());
    if (source.color_mode()) out.color_camera = *color_camera(calibration, *source.color_mode());
    out.T_color_depth = T_color_depth(calibration);
    out.T_world_depth = {Pose{}};
    out.depth_near_m = 0.5, out.depth_far_m = 5;
    return out;
  }
  static std::unique_ptr<FrameSource> open(const SensorConfig& sensor) {
    return open_k4a(sensor, sensor_at(0), Timeline{});
  }

  /// A wall at a distance, and a picture of one colour.
  static fake_k4a::FakeCapture wall(std::uint16_t mm, std::uint64_t device_usec,
                                    bool color = true) {
    static const std::vector<std::byte> jpeg = *kit::encode_jpeg(ImageRgb(1280, 720, 200), 80);
    fake_k4a::FakeCapture out;
    out.depth = fake_k4a::flat_depth(320, 288, mm, device_usec);
    if (color) out.color = fake_k4a::image_of(jpeg, 1280, 720, device_usec);
    return out;
  }
  static std::string message(const Result<std::optional<Frame>>& frame) {
    return frame ? "" : frame.error().message;
  }
};

}  // namespace mr::sensor
