#include "mr/kit/raster.h"

#include <vector>

#include "mr/core/assert.h"
#include "mr/core/parallel.h"

namespace mr::kit {

ScreenPolygon clip_to_screen(const Camera& camera, const std::array<Vec3d, 3>& corners) {
  ScreenPolygon out;
  for (int i = 0; i < 3; ++i) {
    const Vec3d a = corners[i], b = corners[(i + 1) % 3];
    if (a.z >= kNearPlane_m) out.points[out.count++] = to_screen(camera, a);
    if ((a.z >= kNearPlane_m) != (b.z >= kNearPlane_m))
      out.points[out.count++] =
          to_screen(camera, a + (b - a) * ((kNearPlane_m - a.z) / (b.z - a.z)));
  }
  return out;
}

Raster rasterize(const Mesh& mesh, const Camera& camera, const Pose& T_world_camera) {
  MR_ASSERT(camera.model == CameraModel::pinhole && camera.distortion == DistortionModel::none);
  struct Drawn {
    ScreenPolygon polygon;
    double top = 0, bottom = -1;  // rows
  };
  const Pose T_camera_world = T_world_camera.inverse();
  std::vector<Drawn> drawn(mesh.triangles.size());
  parallel_for(drawn.size(), 2048, [&](std::size_t begin, std::size_t end) {
    for (std::size_t t = begin; t < end; ++t) {
      const auto corner = [&](int i) {
        return T_camera_world * vec_cast<double>(mesh.corner(t, i));
      };
      const ScreenPolygon p = clip_to_screen(camera, {corner(0), corner(1), corner(2)});
      if (p.count == 0) continue;
      const auto rows = std::minmax_element(p.points.begin(), p.points.begin() + p.count,
                                            [](const auto& a, const auto& b) { return a.v < b.v; });
      drawn[t] = {p, rows.first->v, rows.second->v};
    }
  });

  Raster out{ImageDepth(camera.width, camera.height),
             ImageId(camera.width, camera.height, kNoTriangle)};
  constexpr std::size_t kBand = 64;
  parallel_for((camera.height + kBand - 1) / kBand, 1, [&](std::size_t begin, std::size_t end) {
    const int first = static_cast<int>(begin * kBand);
    const int last = std::min(static_cast<int>(end * kBand), camera.height);
    for (std::uint32_t t = 0; t < drawn.size(); ++t) {
      if (drawn[t].bottom < first || drawn[t].top >= last) continue;
      scan_polygon(drawn[t].polygon, camera.width, first, last, [&](int x, int y, double z) {
        float& depth = *out.depth.at(x, y);
        const auto candidate = static_cast<float>(z);
        if (depth != 0 && depth <= candidate) return;
        depth = candidate;
        *out.triangle.at(x, y) = t;
      });
    }
  });
  return out;
}

}  // namespace mr::kit
