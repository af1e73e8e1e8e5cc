#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "mr/core/mesh.h"
#include "mr/core/pose.h"
#include "mr/core/result.h"
#include "mr/eval/viewpoints.h"

namespace mr::eval {

/// Builds the occupancy grid of the floor under a captured surface (docs/evaluation.md,
/// Viewpoints). The floor frame's x axis runs along the longer side of the minimum-area bounding
/// rectangle of the captured surface's convex hull. All positions must be finite, and `captured`
/// must have triangles. too_large: more than 4 million cells.
Result<FloorMap> map_floor(const Mesh& captured, std::span<const Pose> sensors, Vec3d up,
                           const ViewpointConfig& config);

// The steps, declared for the tests.

/// Height of the floor along `up`: the mean of the lowest level of a height histogram that holds a
/// fair share of the area that faces up, so that noise below the floor does not count; the 2nd
/// percentile of all heights when nothing faces up. `captured` must have triangles.
double floor_height_m(const Mesh& captured, Vec3d up);

/// The convex hull, counter-clockwise, without points on its edges.
std::vector<Vec2d> convex_hull(std::vector<Vec2d> points);

/// The centre of a cell, `height_m` above the floor; world frame.
Vec3d world_point(const FloorMap& map, std::int32_t cell, double height_m);

/// An arbitrary unit vector at right angles to `up`.
Vec3d any_horizontal(Vec3d up);

}  // namespace mr::eval
