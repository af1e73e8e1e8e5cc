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

/// Takes from the moving surface what the still surface shows already (DESIGN section 9, The
/// merger): both would be drawn, and flicker through each other.
class StillSurfaceMask {
 public:
  /// The still surface from a source's place, at a low resolution; depth 0: none.
  struct SensorView {
    std::uint32_t sensor = 0;
    double scale = 1;  ///< columns of `camera` / columns of the depth picture
    Camera camera;
    Pose T_camera_world;
    Precision precision;
    ImageDepth own, merged;
  };

  StillSurfaceMask() = default;
  /// `merged`: the still surface that is shown. `parts`: what each input brought to it, with every
  /// source's place.
  StillSurfaceMask(const Mesh& merged, std::span<const kit::Part> parts,
                   const OverlapConfig& config);

  /// What stays of a moving part. A triangle goes where its own sensor has still surface at the
  /// same place, that or another's within 5 cm is shown; or where another's is shown at the same
  /// place and its own has none within 5 cm behind: else hands on tables would vanish. Sources that
  /// are no pinholes keep all.
  Mesh uncovered(const kit::Part& moving) const;

  /// By sensor; sources that are no pinholes have none.
  std::span<const SensorView> views() const { return views_; }
  const SensorView* view_of(std::uint32_t sensor) const;  ///< null: none

 private:
  bool is_covered(const Mesh& mesh, std::size_t t, const SensorView& view) const;

  OverlapConfig config_;
  std::vector<SensorView> views_;  // by sensor
};

}  // namespace mr::merge
