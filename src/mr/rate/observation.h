#pragma once

#include <optional>
#include <vector>

#include "mr/rate/grid.h"
#include "mr/rate/setting.h"
#include "mr/rate/sweep.h"

namespace mr::rate {

/// What is known of a scene when a setting is chosen.
struct Observation {
  /// What the encoders produced under a setting, lately.
  struct Produced {
    Setting setting;
    double geometry_mbps = 0, texture_mbps = 0;

    double mbps() const { return geometry_mbps + texture_mbps; }
  };

  bool layers = true;  ///< still.layers
  std::vector<Feature> features;
  std::vector<Produced> produced;  ///< oldest first; empty: nothing was coded yet
  /// The lattice in force, as its bits. Nothing: an epoch begins, and it may be chosen.
  std::optional<int> bits = {};
  /// No setting may have another error. Our model heeds that; those of the paper do not.
  double least_error_voxels = 0, coarsest_error_voxels = kErrorNodes_voxels[kErrors - 1];
  /// 0..1: of the quality of what moves in what our model looks for; the rest is of the whole
  /// picture.
  double moving_weight = 0;
};

}  // namespace mr::rate
