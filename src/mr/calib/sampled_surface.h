#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "mr/calib/depth_view.h"
#include "mr/core/pose.h"
#include "mr/core/vec.h"
#include "mr/kit/part.h"

namespace mr::calib {

inline constexpr std::size_t kSamples = 2048;  ///< of a part

/// A point of the surface with its unit normal.
struct SurfaceSample {
  Vec3d position, normal;
};

/// A part prepared for projective data association: samples, which are projected into other parts,
/// and inverse depth maps, into which samples of other parts are projected.
struct SampledSurface {
  std::vector<DepthView> views;
  std::vector<SurfaceSample> samples;  ///< uniform by area, where a plane fits and a sensor sees it
  double sample_m2 = 0;                ///< area per sample
  Box3f box;
  Vec3d eye;  ///< the middle of its sensors
};

/// Stratified sampling by area, the same points for the same mesh. Parallel.
std::vector<SampledSurface> sampled_surfaces(std::span<const kit::Part> parts, double voxel_m);

}  // namespace mr::calib
