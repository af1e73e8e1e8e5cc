#pragma once

#include "mr/core/mesh.h"
#include "mr/core/view.h"
#include "support/meshes.h"

namespace mr::test {

/// A small pinhole camera.
inline View view(ViewId id, Vec3d eye, Vec3d target) {
  View v;
  v.id = id, v.width = 320, v.height = 240, v.fx = v.fy = 260, v.cx = 159.5, v.cy = 119.5;
  v.T_world_camera = look_at(eye, target, {0, -1, 0});
  v.image_rect = v.atlas_rect = {0, 0, 320, 240};
  return v;
}

/// Facing -z at z = 2.
inline Mesh wall(float half, int n) {
  return grid({-half, half, 2}, {2 * half, 0, 0}, {0, -2 * half, 0}, n, n);
}

/// The area of the triangles that a view textures, in m².
inline double labelled_area(const Mesh& mesh, ViewId id) {
  double twice = 0;
  const auto views = triangle_views(mesh);
  for (std::size_t t = 0; t < views.size(); ++t)
    if (views[t] == id) twice += length(mesh.area_normal(t));
  return twice / 2;
}

}  // namespace mr::test
