#pragma once

#include <functional>
#include <vector>

#include "mr/core/mesh.h"
#include "mr/core/pose.h"

namespace mr::synth {

/// Planes across the three axes of a frame: a grid that may be finer in places.
struct Grid {
  Pose T_person_grid;
  std::array<std::vector<double>, 3> planes;  ///< metres, increasing
};

/// Planes from `low` to `high` that are `step` apart.
std::vector<double> planes(double low, double high, double step);
/// The same, `fine` apart between `fine_low` and `fine_high`, `coarse` elsewhere.
std::vector<double> planes(double low, double high, double coarse, double fine_low,
                           double fine_high, double fine);

using DistanceFunction = std::function<double(Vec3d)>;

/// The surface where `distance` (of a point of the person frame, negative inside, no steeper than
/// about 1.3) is zero: marching cubes, then vertices spread evenly along the surface. Closed and
/// manifold if the solid stays inside the grid; the same on any number of threads.
Mesh polygonize(const DistanceFunction& distance, const Grid& grid);

}  // namespace mr::synth
