#pragma once

#include <cstdint>
#include <vector>

#include "mr/core/mesh.h"
#include "mr/merge/overlap.h"
#include "mr/merge/part.h"

namespace mr::merge {

/// What ownership goes by at a spot of a part.
struct FieldVertex {
  Vec3f position;
  float quality = 0;  ///< how well the spot was measured: cos(angle) / sigma, less at borders
  Vec3f normal;       ///< smoothed over the neighbours
  float sigma_m = 0;  ///< spread of the sensor that measured it
};

/// A part with how well each spot of it was measured, as a function that is linear on triangles.
struct PartField {
  static constexpr std::uint32_t kNoSource = 0xFFFFFFFFu;

  std::vector<FieldVertex> vertices;  ///< [V] of the part's mesh
  std::vector<std::uint32_t> source;  ///< [T] place in the part's sources; kNoSource: not known
  Box3f box;                          ///< of its vertices
  float slack_m = 0;                  ///< error of calibration and decimation
};

/// Quality falls off towards the part's borders: depth is at its worst there, and a sensor that
/// sees past the border can take over where both have surface. Where it is not known which source
/// measured a spot, the worst of them counts.
PartField part_field(const Part& part, const OverlapConfig& config);

}  // namespace mr::merge
