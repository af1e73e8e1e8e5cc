#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "mr/core/mesh.h"
#include "mr/core/pose.h"
#include "mr/core/result.h"
#include "mr/eval/viewpoints.h"

namespace mr::eval {

/// The floor under a captured place and where somebody could walk on it (EVALUATION, Viewpoints 1
/// to 3). The floor frame's x axis runs along the longer side of the smallest rectangle around the
/// captured hull. All positions are finite, `captured` has triangles. too_large: more than 4
/// million cells.
Result<FloorMap> map_floor(const Mesh& captured, std::span<const Pose> sensors, Vec3d up,
                           const ViewpointConfig& config);

// The parts, each of which tests check on its own.

/// Height of the floor along `up`: the mean of the lowest level that holds a fair share of the
/// surface that faces up, so that noise below it does not count; the 2nd percentile of all heights
/// where nothing faces up. `captured` has triangles.
double floor_height_m(const Mesh& captured, Vec3d up);

/// Counter-clockwise, without the points on its edges.
std::vector<Vec2d> convex_hull(std::vector<Vec2d> points);

/// For each cell of a [height, width] grid the index of the nearest one that is not 0; exact
/// (Felzenszwalb and Huttenlocher 2012). -1 everywhere where all are 0.
std::vector<std::int32_t> nearest_seed(const std::vector<std::uint8_t>& seeds, int width,
                                       int height);

/// The generalised Voronoi diagram of the cells that are not free where it keeps `clearance_m` from
/// them: one cell thin, 8-connected where the walkable area is, loops around every obstacle in it.
/// Fills clearance_m and skeleton from the cells.
void find_skeleton(FloorMap& map, double clearance_m);

/// The cells of the skeleton's 8-connected components, in order; the largest first.
std::vector<std::vector<std::int32_t>> components(const FloorMap& map);

/// Middle of a cell, `height_m` above the floor, in the world.
Vec3d world_point(const FloorMap& map, std::int32_t cell, double height_m);

/// A horizontal direction, given which way is up.
Vec3d any_horizontal(Vec3d up);

}  // namespace mr::eval
