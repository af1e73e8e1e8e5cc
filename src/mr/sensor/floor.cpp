#include "mr/sensor/floor.h"

#include "mr/core/parallel.h"

namespace mr::sensor {

void remove_floor(ImageDepth& depth, const Camera& camera, const Pose& T_world_camera,
                  const FloorConfig& floor, Vec3d up) {
  const double lowest = floor.height_m + floor.margin_m;
  const Vec3d up_camera = transposed(T_world_camera.rotation) * up;
  const double eye = dot(up, T_world_camera.translation);
  parallel_for(depth.height, 16, [&](std::size_t begin, std::size_t end) {
    for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y)
      for (int x = 0; x < depth.width; ++x) {
        float& d = *depth.at(x, y);
        if (d <= 0) continue;
        const Vec3d ray = unproject(camera, {static_cast<double>(x), static_cast<double>(y)});
        if (eye + dot(up_camera, ray) * d < lowest) d = 0;
      }
  });
}

}  // namespace mr::sensor
