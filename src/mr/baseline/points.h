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

/// Makes pixels invalid that hang between two surfaces, as sensors give them at depth edges: those
/// that have few neighbours at about their depth.
void drop_flying_pixels(ImageDepth& depth, const Camera& camera, const Precision& precision);

/// Every valid depth pixel of a sensor inside `volume`, coloured from its own colour picture.
/// Points that the colour camera does not see, for lack of field or behind something nearer, are
/// left out: as a rule another sensor has them.
PointSet colored_points(const PreparedDepth& depth, const ImageRgb& color, const View& view,
                        const std::optional<Box3d>& volume);

/// One point per voxel: the mean place and colour of those in it. In order of the first in each.
PointSet voxel_sampled(std::span<const PointSet> sets, double voxel_m);

}  // namespace mr::baseline
