#include "mr/planner/coverage.h"

#include <bit>

#include "mr/core/parallel.h"

namespace mr::planner {
namespace {

constexpr int kPoints = 128;  // that stand for a sensor's surface

void add_points(Coverage& coverage, std::uint32_t sensor, const SensorSample& sample) {
  std::vector<Vec3d> at;
  if (sample.surface.empty() && sample.depth.empty())
    at = coverage.frusta[sensor].points(kPoints);
  else
    for (int i = 0; i < kPoints && !sample.surface.empty(); ++i)
      at.push_back(vec_cast<double>(sample.surface[i * sample.surface.size() / kPoints]));
  if (coverage.scene->volume)
    std::erase_if(at, [&](Vec3d p) { return !coverage.scene->volume->contains(p); });
  coverage.triangles.push_back(at.empty() ? 0 : sample.triangles);
  for (const Vec3d p : at)
    coverage.points.push_back({p, sensor, sample.triangles / static_cast<double>(at.size()), {}});
}

}  // namespace

Coverage make_coverage(const Scene& scene, std::span<const SensorSample> samples,
                       const MergeCosts& costs) {
  Coverage coverage;
  coverage.scene = &scene, coverage.costs = &costs;
  for (std::size_t i = 0; i < scene.sensors.size(); ++i)
    coverage.frusta.emplace_back(scene.sensors[i], samples[i]);
  for (std::uint32_t i = 0; i < scene.sensors.size(); ++i) add_points(coverage, i, samples[i]);
  parallel_for(coverage.points.size(), 64, [&](std::size_t begin, std::size_t end) {
    for (std::size_t k = begin; k < end; ++k) {
      SurfacePoint& point = coverage.points[k];
      point.seen = coverage.none();
      for (std::size_t i = 0; i < coverage.sensors(); ++i)
        if (i == point.sensor || coverage.frusta[i].sees(point.at)) put(point.seen, i);
    }
  });
  return coverage;
}

int common(const SensorSet& a, const SensorSet& b) {
  int out = 0;
  for (std::size_t w = 0; w < a.size(); ++w) out += std::popcount(a[w] & b[w]);
  return out;
}

std::vector<std::string> sensor_ids(const Coverage& coverage, const SensorSet& group) {
  std::vector<std::string> out;
  for (std::size_t i = 0; i < coverage.sensors(); ++i)
    if (has(group, i)) out.push_back(coverage.scene->sensors[i].id);
  return out;
}

SensorSet all_sensors(const Coverage& coverage) {
  SensorSet all = coverage.none();
  for (std::size_t i = 0; i < coverage.sensors(); ++i) put(all, i);
  return all;
}

std::vector<SensorSet> one_by_one(const Coverage& coverage, const SensorSet& group) {
  std::vector<SensorSet> out;
  for (std::size_t i = 0; i < coverage.sensors(); ++i)
    if (has(group, i)) put(out.emplace_back(coverage.none()), i);
  return out;
}

}  // namespace mr::planner
