#include "mr/atlas/occluders.h"

#include <algorithm>
#include <utility>

#include "mr/core/parallel.h"

namespace mr::atlas {

int depth_divisor(const Camera& camera) {
  constexpr double kEnoughPerRad = 300;
  const double most = std::min(camera.fx, camera.fy) / kEnoughPerRad;
  return most >= 4 ? 4 : most >= 2 ? 2 : 1;
}

Camera depth_camera(const Camera& camera) {
  return kit::scaled(camera, 1.0 / depth_divisor(camera));
}

std::array<kit::CubeFace, 6> panorama_faces(const Camera& camera) {
  constexpr int kRing_px = 24;
  constexpr double kEnoughPerRad = 512;  // pixels per radian that suffice for occlusion
  const Vec2d density = kit::pixels_per_rad(camera);
  return kit::cube_faces(std::min(std::max(density.x, density.y), kEnoughPerRad), kRing_px);
}

Occluders::Occluders(const Mesh& mesh, std::span<const View> views) {
  std::vector<std::vector<ImageDepth>> faces(views.size());
  parallel_for(views.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t v = begin; v < end; ++v) {
      const View& view = views[v];
      const auto draw = [&](const Camera& camera, const Mat3& R_camera_face) {
        const Pose T_world_face = view.T_world_camera * Pose{R_camera_face, {}};
        faces[v].push_back(kit::rasterize_depth(mesh, camera, T_world_face));
      };
      if (view.kind == View::Kind::pinhole)
        draw(depth_camera(view.camera()), Pose{}.rotation);
      else
        for (const kit::CubeFace& face : panorama_faces(view.camera()))
          draw(face.camera, face.R_camera_face);
    }
  });
  for (std::size_t v = 0; v < views.size(); ++v) faces_[views[v].id] = std::move(faces[v]);
}

const std::vector<ImageDepth>* Occluders::faces(const View& view) const {
  const auto found = faces_.find(view.id);
  return found == faces_.end() ? nullptr : &found->second;
}

}  // namespace mr::atlas
