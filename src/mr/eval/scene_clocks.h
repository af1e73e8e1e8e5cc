#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "mr/scene/scene.h"

/// The clocks of a scene's sensors, compared by what moves before them.
namespace mr::eval {

/// One sensor's clock against the reference's. `offset_ms` is how much later than stated it
/// captures, on top of the scene's clock_offset_ms.
struct SensorClock {
  std::string id;
  std::optional<double> offset_ms;
  double sigma_ms = 0;
  std::size_t overlap_points = 0;  ///< in motion, that another sensor sees, too
  std::optional<double> true_ms;   ///< of a synthetic rig
  double clock_offset_ms = 0;      ///< what the scene file should say
  std::string problem;             ///< one line: why there is no offset
};

struct ClockPairOffset {
  std::string a, b;
  double offset_ms = 0, sigma_ms = 0;
  std::size_t points = 0;
};

struct SceneClocks {
  std::string reference;            ///< empty: no offset is known, see `problem`
  std::vector<SensorClock> clocks;  ///< as in the scene
  std::vector<ClockPairOffset> pairs;
  std::size_t frames = 0;  ///< most that were read of one sensor
  double seconds = 0;      ///< that they cover
  std::string problem;     ///< one line
};

/// What is read of the recordings.
struct ClockSpan {
  double from_s = 0;   ///< after they begin: two places tell how clocks drift
  double seconds = 5;  ///< from the moment when the last of them has begun
};

/// Reads a span of all sensors, which the scene must hold (synth::rig_sensors). Pictures of a rig
/// are rendered or read from `rig_cache`. Runs in the caller's arena.
SceneClocks compare_clocks(const Scene& scene, const std::filesystem::path& rig_cache,
                           const ClockSpan& span = {});

}  // namespace mr::eval
