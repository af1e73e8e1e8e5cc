#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "mr/core/result.h"
#include "mr/eval/geometry_error.h"
#include "mr/render/renderer.h"
#include "mr/scene/scene.h"

namespace mr::eval {

/// How the still surface of a synthetic scene is measured (docs/evaluation.md, Still surface).
struct StillErrorConfig {
  int captures = 100;  ///< processed before; a stateless pipeline skips them
  int pairs = 10;      ///< of consecutive captures whose pictures are compared
  int level = 16;      ///< of 255: a pixel has changed when a channel differs by more
  double seen_s = 10;  ///< occluded surface counts if it was seen within this time
  int samples = 200'000;
  std::filesystem::path rig_cache;
  std::function<void(const std::string& step, std::size_t done, std::size_t of)> progress{};
  std::function<void(const std::string& message)> notice{};  ///< one line
};

/// The figures that `eval still` prints.
struct StillError {
  std::string scene;
  bool layers = false;
  int captures = 0, pairs = 0, views = 0;  ///< pairs: that were compared
  /// Share of the covered pixels that change between two consecutively shown captures although
  /// their truth does not.
  double changed_ratio = 0;
  /// From a surface to the noiseless truth, where the nearest truth does not move.
  struct Distance {
    SurfaceDistance all;
    SurfaceDistance wall;  ///< where that is flat: wall_triangles()
  };
  /// Of the still surface as shown (without layers: of all that is shown); `anew`: the same of one
  /// capture without layers.
  Distance still, anew;
  /// Share of the still truth that some sensor measured within `seen_s` with nothing within a voxel
  /// now.
  double hidden_missing = 0;
  double hidden_ratio = 0;        ///< share of that truth which no sensor sees now
  double hidden_now_missing = 0;  ///< what is missing of that share
  /// The same share of what some sensor saw, though perhaps too grazing or too dark to be measured.
  double seen_missing = 0;
  double first_s = 0;  ///< when the first capture was shown
};

/// Runs the scene, which must be prepared, and draws what a client has from the viewpoints.
/// unsupported: its truth is not known.
Result<StillError> still_error(const Scene& scene, const std::vector<render::Viewpoint>& views,
                               const StillErrorConfig& config);

/// For each triangle of a truth's surface whether it is the same in another frame's: people and
/// what they carry come last in both.
std::vector<std::uint8_t> still_triangles(const Mesh& surface, const Mesh& other);

/// For each triangle of a truth's surface whether it lies in a plane with at least a square metre
/// of it: walls, floors, large table tops. On clutter, such as shelves and desks, the
/// error depends more on the voxel size than on noise.
std::vector<std::uint8_t> wall_triangles(const Mesh& surface);

std::string to_json(const StillError& error);
std::string to_text(const StillError& error);

}  // namespace mr::eval
