#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "mr/eval/viewpoints.h"

/// Image processing on the floor's occupancy grid: distance transform, connected components and
/// thinning. Grids have a border of cells that are not free.
namespace mr::eval {

/// The eight neighbours of a cell in circular order, from cell + 1 on.
std::array<std::int32_t, 8> ring(std::int32_t cell, int width);

/// The feature transform that belongs to the exact Euclidean distance transform (Felzenszwalb and
/// Huttenlocher 2012): for each cell of a [height, width] grid the index of the nearest cell that
/// is not 0; -1 everywhere when all are 0.
std::vector<std::int32_t> nearest_seed(const std::vector<std::uint8_t>& seeds, int width,
                                       int height);

/// Fills map.clearance_m with the distances to the nearest cell that is not free; returns the index
/// of that cell for each cell.
std::vector<std::int32_t> measure_clearance(FloorMap& map);

/// 1 for the cells with at least that clearance.
std::vector<std::uint8_t> walkable(const FloorMap& map, double clearance_m);

/// The connected components of a mask.
struct ConnectedComponents {
  std::vector<std::int32_t> of_cell;  ///< -1: not in the mask
  int count = 0;
};
/// `diagonal`: 8-connected, else 4-connected.
ConnectedComponents connected_components(const std::vector<std::uint8_t>& mask, int width,
                                         bool diagonal);

/// Fills map.clearance_m (distance transform) and map.skeleton from the cells. The skeleton is the
/// generalised Voronoi diagram of the cells that are not free, as far as it keeps `clearance_m`
/// from them; one cell thin, 8-connected where the walkable area is, with a loop around every
/// obstacle.
void find_skeleton(FloorMap& map, double clearance_m);

/// The cells of the skeleton's 8-connected components, in order; the largest first.
std::vector<std::vector<std::int32_t>> components(const FloorMap& map);

}  // namespace mr::eval
