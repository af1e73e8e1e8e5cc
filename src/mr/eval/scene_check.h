#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "mr/scene/scene.h"

/// Checks the first pictures of a scene, to find why someone's own recordings do not reconstruct.
namespace mr::eval {

/// Statistics of a sensor's first pictures.
struct SensorCheck {
  std::string id;
  std::string problem;  ///< one line: why they cannot be read. Then the rest is empty
  int depth_width = 0, depth_height = 0;
  int color_width = 0, color_height = 0;  ///< 0: no colour
  double valid_ratio = 0;                 ///< pixels with depth within depth_range_m, of all
  double outside_ratio = 0;               ///< pixels beyond depth_range_m, of those with depth
  /// Of the valid pixels; if there are none, of all pixels with depth; else 0.
  double min_m = 0, median_m = 0, max_m = 0;
  std::vector<std::string> hints;  ///< probable mistakes and what to do about them
};

enum class Fit { good, usable, bad };
const char* to_string(Fit fit);

/// Residual between two sensors' surfaces where they overlap (calib::pair_residuals). `noise_mm` is
/// the residual expected of calibrated sensors: half a voxel or, if that is more, the scene's
/// calibration_error_m combined with both sensors' precision at their median depth.
///   good    at most noise_mm apart
///   usable  at most twice that
///   bad     farther, or less than 85 % of what both should see is within 10 cm
struct PairFit {
  std::string a, b;
  double residual_mm = 0;  ///< untrimmed
  double noise_mm = 0;
  double shared_m2 = 0, expected_m2 = 0;  ///< overlap within 10 cm; overlap expected from the poses
  Fit fit = Fit::good;
};

struct SceneCheck {
  std::vector<SensorCheck> sensors;  ///< as in the scene
  std::vector<PairFit> pairs;        ///< worst first; those that should share at least 0.1 m2
  std::vector<std::string> misfits;  ///< sensors that disagree with most of the others

  std::optional<Fit> fit() const;  ///< of the worst pair; nullopt without pairs
};

/// Reads the first pictures of all sensors, which the scene must hold (synth::rig_sensors). Those
/// of a rig are rendered or read from `rig_cache`. Runs in the caller's arena.
SceneCheck check_scene(const Scene& scene, const std::filesystem::path& rig_cache);

}  // namespace mr::eval
