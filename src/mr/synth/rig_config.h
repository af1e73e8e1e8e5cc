#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "mr/core/range.h"
#include "mr/core/vec.h"

namespace mr::synth {

/// An event in a synthetic rig, timed by the rig's captures: its frames 0, 1, …, again
/// from 0 where it loops. Which fields count follows from the kind.
struct RigEvent {
  enum class Kind {
    sit,       ///< somebody walks in, sits from `at` on for `frames`, gets up and leaves
    chair,     ///< a chair is moved by `by_m`, from `at` on, within `frames`
    door,      ///< a door opens at `at` and begins to close `frames` later; either takes a second
    carry,     ///< somebody walks in, picks up a box at `at` and carries it away
    vanish,    ///< a box is gone from `at` on; who stands before `sensor` for `frames` hides that
    light,     ///< light falls to the share `level` at `at`, and is back after `frames`
    screen,    ///< a screen plays from `at` on for `frames`, else it stands still
    push,      ///< `sensor` is moved by by_mm and turned by by_deg at `at`; its stated pose is not
    dropout,   ///< `sensor` measures no depth from `at` on for `frames`
    exposure,  ///< the exposure of `sensor` is off by `stops` from `at` on for `frames`
    hunt,      ///< it swings by ± `stops` and back in `period_s`, from `at` on for `frames`
  } kind = Kind::sit;
  int at = 0;
  int frames = 0;                ///< how long; usual_frames(kind) where a file leaves it out
  std::string sensor;            ///< an id of the rig; empty: all, of `vanish` none
  std::optional<Vec2d> place_m;  ///< on the floor, room frame; none: a free place
  double by_m = 1;
  double by_mm = 30, by_deg = 2;
  double level = 0.2;
  double stops = 1, period_s = 1;

  static constexpr Range kAt{0, 1'000'000}, kFrames{1, 1'000'000}, kPlace_m{-25, 25},
      kBy_m{0.05, 5}, kBy_mm{0, 1000}, kBy_deg{0, 90}, kLevel{0, 1}, kStops{-4, 4},
      kPeriod_s{0.1, 3600};
  /// The invalid fields, one line each; empty: valid.
  std::vector<std::string> problems() const;
  friend bool operator==(const RigEvent&, const RigEvent&) = default;
};

/// How long an event of a scene file without `frames` takes, in captures.
int usual_frames(RigEvent::Kind kind);
/// The name of a kind in scene files.
const char* name_of(RigEvent::Kind kind);

/// A synthetic rig in place of `sensors`. Errors are drawn from the seed, one set per sensor.
struct RigConfig {
  enum class Kind { room, conference, office, corridor, hallway } kind = Kind::room;
  std::uint32_t seed = 1;
  Vec3d room_m{6, 5, 3};       ///< width, depth, height
  int people = 0;              ///< who walk and gesture
  int sensors = 4;             ///< Kinects, "cam-0" and so on; up to 400, 0 beside LiDARs only
  int lidars = 0;              ///< 360-degree LiDARs with a panorama, "lidar-0" and so on
  int lidar_beams = 128;       ///< of each LiDAR, from the horizon straight down
  double lidar_noise_mm = 10;  ///< deviation of its ranges, the same at any distance
  int depth_width = 640,
      depth_height = 576;  ///< depth_mode nfov; wfov_binned 512x512, nfov_binned 320x288
  int color_width = 1280, color_height = 720;
  bool noise = true;          ///< `kinect`; `none` is noiseless
  double depth_noise = 1;     ///< its deviation, as a multiple of what the sensor's precision says
  double depth_noise_px = 0;  ///< how far it is correlated: exp(-r² / (2 px²)); 0: not at all
  double color_noise = 0;     ///< deviation of every colour value of a frame, in 8-bit levels
  double exposure_drift = 0;  ///< stops: exposure swings slowly by ± this, each camera by itself
  double exposure_period_s = 20;  ///< of that swing
  double calib_error_mm = 0;      ///< each stated pose is off by so much, in some direction
  double calib_error_deg = 0;     ///< and turned by so much, about some axis
  double exposure_spread =
      0;  ///< stops: exposure is off by up to ± this, red and blue by a quarter
  double clock_offset_ms = 0;  ///< each clock is off by up to ± this, unknown to the receivers
  double detail = 0.5;         ///< texture contrast and clutter, 0..1
  int frames = 300;            ///< the source ends, or starts again, after so many
  bool loop = false;           ///< start again; then motion repeats after `frames`
  std::vector<RigEvent> events;

  static constexpr Range kRoom_m{1, 50}, kPeople{0, 100}, kSensors{0, 400}, kLidars{0, 16},
      kLidarBeams{8, 128}, kLidarNoise_mm{0.1, 1000}, kColor{16, 8192}, kDepth{16, 8192},
      kDepthNoise{0, 100}, kDepthNoise_px{0, 16}, kColorNoise{0, 64}, kExposure{0, 4},
      kExposurePeriod_s{0.1, 36'000}, kCalibError_mm{0, 1000}, kCalibError_deg{0, 90},
      kClockOffset_ms{0, 10'000}, kDetail{0, 1}, kFrames{1, 1'000'000};
  /// The invalid fields, one line each; empty: valid.
  std::vector<std::string> problems() const;
  /// The ids of its sensors, in order.
  std::vector<std::string> sensor_ids() const;
  friend bool operator==(const RigConfig&, const RigConfig&) = default;
};

/// A size that suits a kind of room; what a scene file without `room` means.
Vec3d usual_room_m(RigConfig::Kind kind);

}  // namespace mr::synth
