#include "mr/merge/holes/seen_through.h"

#include <algorithm>

namespace mr::merge {
namespace {

/// Whether a sensor says that it sees its still surface where `p` is in its depth picture.
bool is_confirmed(const SourceInfo& source, Vec3f p) {
  const TileMask& mask = source.confirmed_depth;
  if (mask.empty()) return false;
  const auto pixel =
      project(source.depth_camera, source.T_world_depth.inverse() * vec_cast<double>(p));
  const Camera& camera = source.depth_camera;
  if (!pixel ||
      !(pixel->x >= 0 && pixel->y >= 0 && pixel->x < camera.width && pixel->y < camera.height))
    return false;
  const int column = static_cast<int>(pixel->x) / mask.tile_px,
            row = static_cast<int>(pixel->y) / mask.tile_px;
  return column < mask.columns && row < mask.rows && mask.at(column, row);
}

kit::RayScene rays_of(std::span<const kit::Part> parts) {
  std::vector<const Mesh*> meshes;
  for (const kit::Part& part : parts) meshes.push_back(&part.mesh);
  return kit::RayScene(meshes);
}

}  // namespace

SeenThrough::SeenThrough(std::span<const kit::Part> parts, double margin_m, bool is_moving)
    : parts_(parts),
      margin_m_(static_cast<float>(margin_m)),
      is_moving_(is_moving),
      measured_by_(parts.size()),
      scene_(rays_of(parts)) {
  for (std::uint32_t i = 0; i < parts.size(); ++i) {
    for (const SourceInfo& source : parts[i].sources) sensors_.push_back({i, &source});
    if (parts[i].sources.size() > 1) measured_by_[i] = triangle_sensors(parts[i].mesh);
  }
}

bool SeenThrough::at(Vec3f p, Vec3f normal) const {
  std::vector<kit::RayHit> hits;
  return std::ranges::any_of(sensors_, [&](const Sensor& sensor) {
    const Vec3f eye = vec_cast<float>(sensor.source->T_world_depth.translation);
    return dot(normal, eye - p) > 0 &&
           ((is_moving_ && is_confirmed(*sensor.source, p)) || passed(sensor, p, hits));
  });
}

/// Whether the first surface that a sensor measured on its ray to `p` lies behind `p`.
bool SeenThrough::passed(const Sensor& sensor, Vec3f p, std::vector<kit::RayHit>& hits) const {
  constexpr float kFarthest_m = 100;
  const Vec3f eye = vec_cast<float>(sensor.source->T_world_depth.translation);
  const float distance = length(p - eye);
  const Vec3f ray = (p - eye) / distance;
  scene_.all_hits(eye, ray, 0, distance + kFarthest_m, hits);
  for (const kit::RayHit& hit : hits) {
    if (hit.mesh != sensor.part) continue;
    const auto& by = measured_by_[hit.mesh];
    if (!by.empty() && by[hit.triangle] != sensor.source->sensor) continue;
    if (dot(parts_[hit.mesh].mesh.area_normal(hit.triangle), ray) >= 0) continue;
    return hit.distance > distance + margin_m_;
  }
  return false;
}

}  // namespace mr::merge
