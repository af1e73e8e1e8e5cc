#include "mr/merge/overlap/ray_grids.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include "mr/core/image.h"
#include "mr/kit/raster.h"

namespace mr::merge {
namespace {

constexpr double kMostPerRad = 1000;  // all around: 24 million rays

/// What a camera that sees all around covers.
struct Altitudes {
  double low_rad = -std::numbers::pi / 2, high_rad = std::numbers::pi / 2;

  bool contain(Vec3d ray_camera) const {
    const double altitude = std::atan2(-ray_camera.y, std::hypot(ray_camera.x, ray_camera.z));
    return altitude >= low_rad && altitude <= high_rad;
  }
};

Altitudes altitudes_of(const Camera& camera) {
  if (camera.model != CameraModel::lidar || camera.beam_altitude_rad.empty()) return {};
  const auto [low, high] =
      std::minmax_element(camera.beam_altitude_rad.begin(), camera.beam_altitude_rad.end());
  const double half_row = 0.5 / kit::pixels_per_rad(camera).y;
  return {*low - half_row, *high + half_row};
}

/// The smallest rectangle that holds all pixels of a face within some altitudes.
Rect covered(const kit::CubeFace& face, const Altitudes& altitudes) {
  int left = face.camera.width, top = face.camera.height, right = 0, bottom = 0;
  for (int y = 0; y < face.camera.height; ++y)
    for (int x = 0; x < face.camera.width; ++x) {
      const Vec3d ray = unproject(face.camera, {static_cast<double>(x), static_cast<double>(y)});
      if (!altitudes.contain(face.R_camera_face * ray)) continue;
      left = std::min(left, x), right = std::max(right, x + 1);
      top = std::min(top, y), bottom = std::max(bottom, y + 1);
    }
  return left < right ? Rect{left, top, right - left, bottom - top} : Rect{};
}

/// The same rays, only those through a rectangle of the picture.
Camera cropped(const Camera& camera, const Rect& rect) {
  Camera out = camera;
  out.width = rect.width, out.height = rect.height;
  out.cx -= rect.x, out.cy -= rect.y;
  return out;
}

/// The faces of a cube around a camera, cut to what it covers, with `focal_px` pixels per radian in
/// their middles.
void add_faces(const SourceInfo& source, double focal_px, std::vector<RayGrid>& grids) {
  const Altitudes altitudes = altitudes_of(source.depth_camera);
  for (const kit::CubeFace& face : kit::cube_faces(focal_px, 0)) {
    const Rect rect = covered(face, altitudes);
    if (rect.empty()) continue;
    grids.push_back(
        {cropped(face.camera, rect), source.T_world_depth * Pose{face.R_camera_face, {}}});
  }
}

/// Columns or rows of a camera that sees all around per radian, but no more than a voxel needs.
double face_pixels_per_rad(const Camera& camera, double voxel_m) {
  const Vec2d density = kit::pixels_per_rad(camera);
  return std::min(std::max(density.x, density.y), std::min(12 / voxel_m, kMostPerRad));
}

}  // namespace

std::vector<RayGrid> camera_rays(const SourceInfo& source, double voxel_m) {
  if (source.depth_camera.model == CameraModel::pinhole)
    return {{source.depth_camera, source.T_world_depth}};
  std::vector<RayGrid> out;
  add_faces(source, face_pixels_per_rad(source.depth_camera, voxel_m), out);
  return out;
}

}  // namespace mr::merge
