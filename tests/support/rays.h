#pragma once

#include "mr/core/camera.h"
#include "mr/core/image.h"
#include "mr/core/packet.h"
#include "mr/core/pose.h"
#include "mr/kit/raycast.h"

namespace mr::test {

/// A Kinect-like pinhole of 160 x 144.
inline Camera small_camera() {
  Camera c;
  c.width = 160, c.height = 144, c.fx = c.fy = 126, c.cx = 79.5, c.cy = 71.5;
  return c;
}

/// Exact depth of a mesh seen by a camera.
inline ImageDepth render_depth(const Mesh& mesh, const Camera& camera, const Pose& T_world_camera) {
  const Mesh* meshes[] = {&mesh};
  const kit::RayScene rays(meshes);
  ImageDepth depth(camera.width, camera.height);
  for (int y = 0; y < camera.height; ++y)
    for (int x = 0; x < camera.width; ++x) {
      const Vec3d d = T_world_camera.rotation * unproject(camera, {double(x), double(y)});
      const auto hit = rays.first_hit(vec_cast<float>(T_world_camera.translation),
                                      vec_cast<float>(d), 0.01f, 100);
      *depth.at(x, y) = hit ? hit->distance : 0;
    }
  return depth;
}

inline SourceInfo source(std::uint32_t number, const Pose& T_world_depth) {
  return {SensorId{number}, {}, small_camera(), T_world_depth, {0.001, 0.0002}};
}

/// Share of a grid of parallel rays on which a second surface facing the viewer lies within `range`
/// behind the first.
inline double doubled_share(const Mesh& mesh, Vec3f origin, Vec3f u, Vec3f v, Vec3f direction,
                            float range, int n = 128) {
  const Mesh* meshes[] = {&mesh};
  const kit::RayScene rays(meshes);
  std::vector<kit::RayHit> hits;
  int doubled = 0;
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < n; ++i) {
      const Vec3f from = origin + u * ((i + 0.37f) / n) + v * ((j + 0.41f) / n);
      rays.all_hits(from, direction, 0, 100, hits);
      std::erase_if(hits, [&](const kit::RayHit& h) {
        return dot(mesh.area_normal(h.triangle), direction) >= 0;
      });
      bool second = false;
      for (std::size_t k = 1; k < hits.size(); ++k) {
        const float apart = hits[k].distance - hits[k - 1].distance;
        second |= apart > 1e-5f && apart <= range;
      }
      doubled += second;
    }
  return static_cast<double>(doubled) / (n * n);
}

}  // namespace mr::test
