#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "mr/core/vec.h"
#include "mr/planner/merge_costs.h"
#include "mr/planner/sensor_frustum.h"
#include "mr/planner/sensor_sample.h"
#include "mr/scene/scene.h"

/// Which sensor sees which surface: what the planner knows of a scene.
namespace mr::planner {

/// A set of sensors, one bit each.
using SensorSet = std::vector<std::uint64_t>;

inline bool has(const SensorSet& group, std::size_t sensor) {
  return group[sensor / 64] >> (sensor % 64) & 1;
}
inline void put(SensorSet& group, std::size_t sensor) {
  group[sensor / 64] |= std::uint64_t{1} << (sensor % 64);
}

/// A part of a sensor's surface.
struct SurfacePoint {
  Vec3d at;
  std::uint32_t sensor = 0;
  double triangles = 0;
  SensorSet seen;  // by these sensors, its own included
};

/// The scene as the planner knows it.
struct Coverage {
  const Scene* scene = nullptr;
  const MergeCosts* costs = nullptr;
  std::vector<SensorFrustum> frusta;  // [sensors]
  std::vector<double> triangles;      // [sensors]
  std::vector<SurfacePoint> points;   // by sensor

  std::size_t sensors() const { return frusta.size(); }
  SensorSet none() const { return SensorSet((sensors() + 63) / 64, 0); }
};

/// How many sensors are in both.
int common(const SensorSet& a, const SensorSet& b);

/// `samples`: of all sensors, as long as the result is used.
Coverage make_coverage(const Scene& scene, std::span<const SensorSample> samples,
                       const MergeCosts& costs);

/// The ids of a set's sensors, in the scene's order.
std::vector<std::string> sensor_ids(const Coverage& coverage, const SensorSet& group);

/// All sensors.
SensorSet all_sensors(const Coverage& coverage);

/// One set for each sensor of a set.
std::vector<SensorSet> one_by_one(const Coverage& coverage, const SensorSet& group);

}  // namespace mr::planner
