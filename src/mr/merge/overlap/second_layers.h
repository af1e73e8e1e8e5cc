#pragma once

#include <span>

#include "mr/core/mesh.h"

namespace mr::merge {

struct SecondLayersConfig {
  double apart_m = 0.03;     ///< how far apart two layers lie at most; 0: none is removed
  double large_m2 = 0.0125;  ///< of two larger components sensors decide, not areas
};

/// The config for a voxel size: layers up to three voxels apart.
inline SecondLayersConfig second_layers_config(double voxel_m) {
  return {3 * voxel_m, 125 * voxel_m * voxel_m};
}

/// Removes what overlap removal leaves of one surface over another, where sensors disagree by more
/// than is expected; the zipper would join both as a second layer. A triangle goes if, along its
/// normal and within `apart_m`, over its middle and, where it is large, near its corners, another
/// component takes precedence and faces alike: one with more area; of two large ones, that of the
/// later sensor. So what was covered stays covered. Of one sensor within a part, two surfaces are
/// two. As the redundant triangles of Turk and Levoy 1994 (section 4.1), but not from the border
/// on. Parallel; deterministic.
void remove_second_layers(std::span<Mesh> parts, const SecondLayersConfig& config);

}  // namespace mr::merge
