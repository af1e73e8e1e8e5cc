#pragma once

#include <span>
#include <vector>

#include "mr/core/camera.h"
#include "mr/core/image.h"
#include "mr/core/mesh.h"
#include "mr/core/pose.h"
#include "mr/kit/part.h"
#include "mr/merge/overlap/overlap.h"

namespace mr::merge {

/// Removes those parts of the moving surface that coincide with the still surface (docs/layers.md,
/// The merger), as both would be drawn and z-fight. Tested against low-resolution depth maps of
/// the still surface from every sensor.
class StillSurfaceMask {
 public:
  /// Low-resolution depth maps of the still surface from a sensor's pose: of its own part (`own`)
  /// and of the merged surface (`merged`); 0: none.
  struct SensorView {
    SensorId sensor{};
    double scale = 1;  ///< columns of `camera` / columns of the depth picture
    Camera camera;
    Pose T_camera_world;
    Precision precision;
    ImageDepth own, merged;
  };

  StillSurfaceMask() = default;
  /// `merged`: the still surface that is shown. `parts`: the inputs' contributions to it, with the
  /// poses of their sources.
  StillSurfaceMask(const Mesh& merged, std::span<const kit::Part> parts,
                   const OverlapConfig& config);

  /// A moving part without covered triangles. A triangle is covered if its own sensor has still
  /// surface at the same place, and that or another sensor's within 5 cm of it is shown; or if
  /// another sensor's still surface is shown at the same place and its own has none within 5 cm
  /// behind it (otherwise a hand on a table would vanish). Parts of sources that are not pinholes
  /// are returned unchanged.
  Mesh uncovered(const kit::Part& moving) const;

  /// By sensor; only pinhole sources have one.
  std::span<const SensorView> views() const { return views_; }
  const SensorView* view_of(SensorId sensor) const;  ///< null: none

 private:
  bool is_covered(const Mesh& mesh, std::size_t t, const SensorView& view) const;

  OverlapConfig config_;
  std::vector<SensorView> views_;  // by sensor
};

}  // namespace mr::merge
