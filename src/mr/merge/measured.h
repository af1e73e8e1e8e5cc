#pragma once

#include <cstdint>
#include <vector>

#include "mr/core/mesh.h"
#include "mr/merge/overlap.h"
#include "mr/merge/part.h"

namespace mr::merge {

/// A place on a part's surface.
struct Spot {
  Vec3f position;
  Vec3f normal;       ///< unit
  float sigma_m = 0;  ///< spread of the sensor that measured it
};

/// What is known of a part's surface.
struct Measured {
  static constexpr std::uint32_t kNoSource = 0xFFFFFFFFu;

  std::vector<Spot> vertices;         ///< [V] of the part's mesh
  std::vector<std::uint32_t> source;  ///< [T] place in the part's sources; kNoSource: not known
  std::vector<float> quality;         ///< [T] how well it was measured: cos(angle) / sigma, 1/m
  float slack_m = 0;                  ///< error of calibration and decimation
};

/// Where it is not known which source measured a spot, the worst of them counts.
Measured measured(const Part& part, const OverlapConfig& config);

}  // namespace mr::merge
