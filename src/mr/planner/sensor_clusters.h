#pragma once

#include <cstddef>
#include <vector>

#include "mr/core/vec.h"
#include "mr/planner/coverage.h"

/// Agglomerative clustering of sensors by what they see together.
namespace mr::planner {

/// Groups of sensors with what they have to do and share.
struct SensorClusters {
  std::vector<SensorSet> groups;
  std::vector<double> cost;                 // triangles
  std::vector<Vec3d> middle;                // of what they see
  std::vector<std::vector<double>> shared;  // [groups][groups] triangles that both see
};

/// One cluster for each sensor.
SensorClusters one_each(const Coverage& coverage);

/// Joins until `wanted` groups are left that have at most `slack` times their share to do, if
/// that can be.
SensorClusters clustered(SensorClusters c, std::size_t wanted, double slack);

}  // namespace mr::planner
