#pragma once

#include <string>
#include <vector>

#include "mr/core/camera.h"
#include "mr/core/image.h"
#include "mr/core/pose.h"
#include "mr/core/range.h"
#include "mr/core/vec.h"

namespace mr::sensor {

/// The floor as a plane: what is at most `margin_m` above it is dropped before fusion.
struct FloorConfig {
  double height_m = 0;     ///< along the scene's up
  double margin_m = 0.03;  ///< sensor noise and calibration

  static constexpr Range kHeight_m{-1e5, 1e5}, kMargin_m{0, 10};
  /// The invalid fields, one line each; empty: valid.
  std::vector<std::string> problems() const {
    return out_of_range({{"height_m", height_m, kHeight_m}, {"margin_m", margin_m, kMargin_m}});
  }
  friend bool operator==(const FloorConfig&, const FloorConfig&) = default;
};

/// Sets the depth pixels that lie on the floor, or below it, to 0: in a capture volume in front of
/// a known background only what stands on the floor is of interest (paper, Fig. 11). The camera is
/// without distortion; `up` is the world's, unit length. Parallel over rows.
void remove_floor(ImageDepth& depth, const Camera& camera, const Pose& T_world_camera,
                  const FloorConfig& floor, Vec3d up);

}  // namespace mr::sensor
