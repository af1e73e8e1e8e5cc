#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "mr/scene/scene.h"

/// A look at the first pictures of a scene, for people whose own pictures do not become a room.
namespace mr::eval {

/// What the first pictures of a sensor hold.
struct SensorCheck {
  std::string id;
  std::string problem;  ///< why they cannot be read, in one line; then all below is empty
  int depth_width = 0, depth_height = 0;
  int color_width = 0, color_height = 0;  ///< 0: no colour
  double valid_ratio = 0;                 ///< pixels with depth within depth_range_m, of all
  double outside_ratio = 0;               ///< pixels beyond depth_range_m, of those with depth
  /// Of the valid pixels; of all with depth where none is valid; 0 where none has any.
  double min_m = 0, median_m = 0, max_m = 0;
  std::vector<std::string> hints;  ///< what looks wrong, and what to do
};

enum class Fit { good, usable, bad };
const char* to_string(Fit fit);

/// How well two sensors' surfaces fit where both should see the same (calib::pair_residuals). With
/// `noise_mm` what is to be expected of two sensors that are calibrated: half a voxel, or the
/// scene's calibration_error_m and both sensors' precision at their median depth together, if that
/// is more.
///   good    at most noise_mm apart
///   usable  at most twice that
///   bad     farther, or less than 85 % of what both should see is within 10 cm
struct PairFit {
  std::string a, b;
  double residual_mm = 0;  ///< untrimmed
  double noise_mm = 0;
  double shared_m2 = 0, expected_m2 = 0;  ///< what is within 10 cm, and what should be
  Fit fit = Fit::good;
};

struct SceneCheck {
  std::vector<SensorCheck> sensors;  ///< as in the scene
  std::vector<PairFit> pairs;        ///< worst first; those that should share at least 0.1 m2
  std::vector<std::string> misfits;  ///< sensors that do not fit most of the others

  std::optional<Fit> fit() const;  ///< of the worst pair; nothing without pairs
};

/// Looks at the first pictures of all sensors, which must be filled in (synth::rig_sensors). Those
/// of a rig are rendered, or come from `rig_cache`. Runs in the caller's arena.
SceneCheck check_scene(const Scene& scene, const std::filesystem::path& rig_cache);

}  // namespace mr::eval
