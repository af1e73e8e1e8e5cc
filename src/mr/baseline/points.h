#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "mr/baseline/cameras.h"
#include "mr/baseline/monolithic.h"

namespace mr::baseline {

/// Coloured points, world frame.
struct PointSet {
  std::vector<Vec3f> positions;
  std::vector<std::array<std::uint8_t, 3>> colors;  ///< [positions] sRGB

  friend bool operator==(const PointSet&, const PointSet&) = default;
};

/// Invalidates flying pixels, which sensors measure between two surfaces at depth edges: pixels
/// with few neighbours at a similar depth.
void drop_flying_pixels(ImageDepth& depth, const Camera& camera, const Precision& precision);

/// Unprojects every valid depth pixel of a sensor inside `volume`, coloured from its own colour
/// picture. Points that are outside the colour camera's picture or occluded in it are left out;
/// usually another sensor has them.
PointSet colored_points(const PreparedDepth& depth, const ImageRgb& color, const View& view,
                        const std::optional<Box3d>& volume);

/// Voxel-grid downsampling: one point per voxel with the mean position and colour of its points, in
/// the order of the first point in each.
PointSet voxel_sampled(std::span<const PointSet> sets, double voxel_m);

}  // namespace mr::baseline
