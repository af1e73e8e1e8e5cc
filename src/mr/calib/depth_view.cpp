#include "mr/calib/depth_view.h"

#include <algorithm>
#include <cmath>

#include "mr/kit/raster.h"

namespace mr::calib {
namespace {

constexpr double kPixelsPerRad = 180, kPixelsPerRadAround = 125;  // of the inverse depth maps
constexpr double kWindowRad = 0.008;                              // planes are fitted over twice it

/// A vertex in the picture.
struct DepthCorner {
  float u, v, inverse_z;  // inverse_z 0: before the near plane
};

std::vector<DepthCorner> corners_of(const Mesh& mesh, const Camera& camera,
                                    const Pose& T_camera_world) {
  const Vec3f eye = vec_cast<float>(T_camera_world.inverse().translation);
  const auto row = [&](int i) { return vec_cast<float>(T_camera_world.rotation.row(i)); };
  const Vec3f x = row(0) * static_cast<float>(camera.fx),
              y = row(1) * static_cast<float>(camera.fy);
  const Vec3f z = row(2);
  const auto cx = static_cast<float>(camera.cx), cy = static_cast<float>(camera.cy);
  std::vector<DepthCorner> out;
  out.reserve(mesh.positions.size());
  for (const Vec3f position : mesh.positions) {
    const Vec3f p = position - eye;
    const float depth = dot(z, p);
    const float inverse = depth > static_cast<float>(kit::kNearPlane_m) ? 1 / depth : 0;
    out.push_back({dot(x, p) * inverse + cx, dot(y, p) * inverse + cy, inverse});
  }
  return out;
}

/// Keeps the nearest in every pixel of a triangle that faces the camera.
void draw(const DepthCorner& a, const DepthCorner& b, const DepthCorner& c, ImageDepth& picture) {
  const float area = (c.u - a.u) * (b.v - a.v) - (b.u - a.u) * (c.v - a.v);
  if (!(area > 0 && a.inverse_z > 0 && b.inverse_z > 0 && c.inverse_z > 0)) return;
  const auto from = [](float x) {
    const int whole = static_cast<int>(std::clamp(x, 0.f, 1e6f));
    return whole + (static_cast<float>(whole) < x);
  };
  const auto to = [](float x, int size) {
    return static_cast<int>(std::clamp(x + 1, 0.f, static_cast<float>(size))) - 1;
  };
  const int left = from(std::min({a.u, b.u, c.u})), top = from(std::min({a.v, b.v, c.v}));
  const int right = to(std::max({a.u, b.u, c.u}), picture.width);
  const int bottom = to(std::max({a.v, b.v, c.v}), picture.height);
  if (left > right || top > bottom) return;
  // Barycentric coordinates of the corners b and c in a pixel: what they grow by to the right and
  // downwards.
  const float b_right = (a.v - c.v) / area, b_down = (c.u - a.u) / area;
  const float c_right = (b.v - a.v) / area, c_down = (a.u - b.u) / area;
  const float to_b = b.inverse_z - a.inverse_z, to_c = c.inverse_z - a.inverse_z;
  for (int y = top; y <= bottom; ++y) {
    const float down = static_cast<float>(y) - a.v;
    float* const row = picture.row(y);
    for (int x = left; x <= right; ++x) {
      const float across = static_cast<float>(x) - a.u;
      const float at_b = b_right * across + b_down * down, at_c = c_right * across + c_down * down;
      constexpr float kOnEdge = -1e-4f;
      if (at_b < kOnEdge || at_c < kOnEdge || 1 - at_b - at_c < kOnEdge) continue;
      row[x] = std::max(row[x], a.inverse_z + at_b * to_b + at_c * to_c);
    }
  }
}

DepthView view_of(const Mesh& mesh, const Camera& camera, const Pose& T_world_camera) {
  const int window_px = std::max(1, static_cast<int>(std::lround(kWindowRad * camera.fx)));
  DepthView out{camera, T_world_camera.inverse(), window_px,
                ImageDepth(camera.width, camera.height)};
  const std::vector<DepthCorner> corners = corners_of(mesh, camera, out.T_camera_world);
  for (const auto& [i, j, k] : mesh.triangles)
    draw(corners[i], corners[j], corners[k], out.inverse_depth);
  return out;
}

std::optional<DepthPlane> plane_at_pixel(const DepthView& view, double u, double v,
                                         double most_bend_m) {
  const int w = view.window_px;
  if (!(u > w && v > w && u < view.camera.width - 1 - w && v < view.camera.height - 1 - w))
    return {};
  const int x = static_cast<int>(u + 0.5), y = static_cast<int>(v + 0.5);
  const double at = *view.inverse_depth.at(x, y);
  const double l = *view.inverse_depth.at(x - w, y), r = *view.inverse_depth.at(x + w, y);
  const double t = *view.inverse_depth.at(x, y - w), b = *view.inverse_depth.at(x, y + w);
  if (!(at > 0 && l > 0 && r > 0 && t > 0 && b > 0)) return {};
  const double most_bend = most_bend_m * at * at;
  if (std::abs(l + r - 2 * at) > most_bend || std::abs(t + b - 2 * at) > most_bend) return {};
  DepthPlane plane;
  plane.per_depth.x = (r - l) / (2 * w) * view.camera.fx;
  plane.per_depth.y = (b - t) / (2 * w) * view.camera.fy;
  plane.per_depth.z = at - plane.per_depth.x * ((x - view.camera.cx) / view.camera.fx) -
                      plane.per_depth.y * ((y - view.camera.cy) / view.camera.fy);
  plane.per_m = length(plane.per_depth);
  return plane;
}

}  // namespace

void add_depth_views(const Mesh& mesh, const SourceInfo& source, std::vector<DepthView>& views) {
  if (source.depth_camera.model == CameraModel::pinhole) {
    const double factor = std::min(1.0, kPixelsPerRad / source.depth_camera.fx);
    views.push_back(view_of(mesh, kit::scaled(source.depth_camera, factor), source.T_world_depth));
    return;
  }
  for (const kit::CubeFace& face : kit::cube_faces(kPixelsPerRadAround, 1))
    views.push_back(
        view_of(mesh, face.camera, source.T_world_depth * Pose{face.R_camera_face, {}}));
}

std::optional<DepthPlane> plane_at(const DepthView& view, Vec3d p_camera, double most_bend_m) {
  if (p_camera.z < kit::kNearPlane_m) return {};
  const kit::ScreenPoint s = kit::to_screen(view.camera, p_camera);
  return plane_at_pixel(view, s.u, s.v, most_bend_m);
}

}  // namespace mr::calib
