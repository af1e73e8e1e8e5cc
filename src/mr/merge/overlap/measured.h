#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "mr/core/mesh.h"
#include "mr/kit/part.h"
#include "mr/merge/overlap/overlap.h"

namespace mr::merge {

/// Tolerance for a part's error of calibration and decimation, metres. `error_m` is the largest
/// error of decimation anywhere; as two parts hardly ever both have it at the same place, each
/// counts with half of it.
float slack_m(const kit::Part& part, const OverlapConfig& config);

/// A point of a part's surface.
struct SurfacePoint {
  Vec3f position;
  Vec3f normal;              ///< unit
  float sigma_m = 0;         ///< depth noise of the sensor that measured it
  std::uint32_t source = 0;  ///< index of that sensor in the part's sources
};

/// Points p with dot(normal, p) = offset_m.
struct Plane {
  Vec3f normal;  ///< unit
  float offset_m = 0;

  float above(Vec3f p) const { return dot(normal, p) - offset_m; }  ///< metres
};

/// How well, and by which sensor, a part's surface was measured.
struct Measured {
  static constexpr std::uint32_t kNoSource = 0xFFFFFFFFu;

  std::vector<SurfacePoint> vertices;  ///< [V] of the part's mesh
  std::vector<std::uint32_t> label;    ///< [T] source of its view; kNoSource: none
  std::vector<std::uint32_t> source;   ///< [T] source that measured it: its label's, else the worst
  std::vector<float> quality;          ///< [T] cos(angle) / sigma, 1/m
  std::vector<Plane> plane;            ///< [T] through its centroid, with its vertices' mean normal
  float slack_m = 0;                   ///< of the part
};

Measured measured(const kit::Part& part, const OverlapConfig& config);

/// Upper bound of the distance along the normal at which two points count as one surface. Parallel.
double farthest_alike_m(std::span<const kit::Part> parts, const OverlapConfig& config);

}  // namespace mr::merge
