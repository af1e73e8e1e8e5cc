#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "mr/core/range.h"
#include "mr/core/source_config.h"
#include "mr/sensor/azure_kinect/calibration.h"
#include "mr/sensor/source_registry.h"

namespace mr::sensor {

/// An Azure Kinect, or an Orbbec Femto behind the same interface, that is plugged in. The scene
/// states its cameras: other computers need them, too (`meshreduce devices` prints them).
struct K4aSource {
  static constexpr std::string_view kType = "k4a";

  enum class DepthMode { nfov, nfov_binned, wfov, wfov_binned };
  enum class Color { off, p720, p1080, p1440, p1536, p2160, p3072 };
  enum class Sync { standalone, master, subordinate };

  std::string serial;  ///< empty: by number
  int device = 0;      ///< number, in the order of the USB ports, where there is no serial
  DepthMode depth_mode = DepthMode::nfov;
  Color color = Color::off;
  int fps = 30;  ///< 5, 15 or 30
  Sync sync = Sync::standalone;
  int subordinate_delay_us = 0;  ///< of a subordinate's exposures after the master's
  int depth_delay_us = 0;        ///< of the depth exposure after the colour exposure
  // Nothing: the device sets them itself.
  std::optional<int> exposure_us{}, gain{}, white_balance_k{};
  std::optional<int> powerline_hz{};  ///< 50 or 60; nothing: as the device was set
  double depth_unit_m = 0.001;        ///< metres per count

  static constexpr Range kDevice{0, 255}, kDelay_us{-1e6, 1e6}, kExposure_us{500, 133330},
      kGain{0, 255}, kWhiteBalance_k{2500, 12500}, kDepthUnit_m{0, 1, true};

  /// The invalid fields, one line each; empty: valid.
  std::vector<std::string> problems() const;
  SourceContent content() const { return {.items = 0, .loops = true}; }
  friend bool operator==(const K4aSource&, const K4aSource&) = default;

  /// "device 000123456789", "device number 0".
  std::string name() const;
  const KinectMode& depth() const;
  const KinectMode* color_mode() const;  ///< null: off
};

/// The word of a scene file: "nfov_binned", "1080p".
std::string_view word_of(K4aSource::DepthMode mode);
std::string_view word_of(K4aSource::Color color);

/// Nothing for other words.
std::optional<K4aSource::DepthMode> k4a_depth_mode(std::string_view word);
std::optional<K4aSource::Color> k4a_color(std::string_view word);

/// The keys serial or device, depth_mode, color, fps, sync, subordinate_delay_us, depth_delay_us,
/// exposure_us, gain, white_balance_k, powerline_hz and depth_unit_m.
SourceKeys read_k4a(yaml::MapReader& map, const std::string& key);

}  // namespace mr::sensor
