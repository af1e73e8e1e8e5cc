#pragma once

#include <functional>
#include <vector>

#include "mr/core/mesh.h"
#include "mr/core/pose.h"

namespace mr::synth {

/// A rectilinear grid: planes across the three axes of a frame, which may be denser in places.
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

/// Polygonizes the zero level set of `distance` (of a point in the person frame, negative inside,
/// gradient at most about 1.3) by marching cubes, then relaxes vertices tangentially for evenly
/// shaped triangles. Closed and manifold if the solid lies inside the grid; the same on any number
/// of threads.
Mesh polygonize(const DistanceFunction& distance, const Grid& grid);

}  // namespace mr::synth
