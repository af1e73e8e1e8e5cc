#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "mr/core/mesh.h"
#include "mr/kit/part.h"
#include "mr/merge/overlap/overlap.h"

namespace mr::merge {

/// How far a part may lie off because of calibration and decimation. `error_m` is the largest error
/// that decimation made anywhere: two parts hardly ever both have it at one place, so each counts
/// with half of it.
float slack_m(const kit::Part& part, const OverlapConfig& config);

/// A place on a part's surface.
struct SurfacePoint {
  Vec3f position;
  Vec3f normal;              ///< unit
  float sigma_m = 0;         ///< spread of the sensor that measured it
  std::uint32_t source = 0;  ///< that sensor's place in the part's sources
};

/// Points p with dot(normal, p) = offset_m.
struct Plane {
  Vec3f normal;  ///< unit
  float offset_m = 0;
};

/// What is known of a part's surface.
struct Measured {
  static constexpr std::uint32_t kNoSource = 0xFFFFFFFFu;

  std::vector<SurfacePoint> vertices;  ///< [V] of the part's mesh
  std::vector<std::uint32_t> label;    ///< [T] source whose view it has; kNoSource: none of them
  std::vector<std::uint32_t> source;   ///< [T] that measured it: the labelled one, else the worst
  std::vector<float> quality;          ///< [T] how well: cos(angle) / sigma, 1/m
  std::vector<Plane> plane;            ///< [T] through its middle, facing as its corners do
  float slack_m = 0;                   ///< of the part
};

Measured measured(const kit::Part& part, const OverlapConfig& config);

/// How far apart two spots may lie, along the normal, and be one surface, at the most. Parallel.
double farthest_alike_m(std::span<const kit::Part> parts, const OverlapConfig& config);

}  // namespace mr::merge
