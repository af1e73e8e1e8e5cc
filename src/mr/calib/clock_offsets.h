#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "mr/calib/depth_track.h"

namespace mr::calib {

struct ClockConfig {
  double most_offset_s = 0.3;      ///< between two sensors
  double coarse_step_s = 0.02;     ///< of the search; the best step is refined
  double gate_m = 0.1;             ///< points farther from the other sensor's surface do not count
  std::size_t least_points = 300;  ///< in common motion, for a pair of sensors to count
  double most_sigma_s = 0.02;      ///< an offset that is known less exactly is not given
};

/// How much later than stated a sensor captures, against the reference.
struct ClockOffset {
  std::optional<double> offset_s;
  double sigma_s = 0;             ///< by leaving out a tenth of the time in turn; at least 0.3 ms
  std::size_t shared_points = 0;  ///< points in motion that another sensor sees, too
  std::string problem;            ///< one line: why there is no offset
};

/// The clocks of two sensors.
struct ClockPair {
  std::size_t a = 0, b = 0;  ///< places of the sensors
  double offset_s = 0;       ///< of a against b
  double sigma_s = 0;
  std::size_t points = 0;
};

struct ClockEstimate {
  std::optional<std::size_t> reference;  ///< nothing: no offset is known, see `problem`
  std::vector<ClockOffset> clocks;       ///< as many as tracks; the reference has 0
  std::vector<ClockPair> pairs;
  std::string problem;
};

/// Estimates by how much the clocks of several sensors that stand still disagree, from people or
/// things that move and that two sensors see at once. Points of one sensor's moving surface are
/// compared along the rays of another sensor with its pictures, interpolated between two captures:
/// point-to-plane ICP whose unknowns are the difference of the clocks, a small rigid motion (what
/// calibration leaves, found together on the resting surfaces) and a common offset of depth. The
/// speed that enters is measured by the sensor whose picture is not interpolated (an instrumental
/// variable): noise of depth then gives no bias. Pairs are combined by weighted least squares.
/// Parallel over pairs; deterministic.
ClockEstimate estimate_clock_offsets(std::span<const DepthTrack> tracks,
                                     const ClockConfig& config = {});

}  // namespace mr::calib
