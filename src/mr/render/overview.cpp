#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include "mr/render/renderer.h"

namespace mr::render {
namespace {

struct Size {
  int width = 0, height = 0;
};

constexpr double kFieldOfView_rad = std::numbers::pi / 3;  // across the picture's width

Camera pinhole(Size size, double fx, double fy) {
  Camera c;
  c.width = size.width, c.height = size.height;
  c.fx = fx, c.fy = fy;
  c.cx = 0.5 * (size.width - 1), c.cy = 0.5 * (size.height - 1);
  return c;
}

Camera usual_camera(Size size) {
  const double f = 0.5 * size.width / std::tan(0.5 * kFieldOfView_rad);
  return pinhole(size, f, f);
}

/// The view's whole picture, scaled to fit and centred; a 90 degree camera for a panorama.
Camera camera_of(const View& view, Size size) {
  if (view.kind != View::Kind::pinhole) return pinhole(size, 0.5 * size.width, 0.5 * size.width);
  const double s = std::min(static_cast<double>(size.width) / view.width,
                            static_cast<double>(size.height) / view.height);
  Camera c = pinhole(size, view.fx * s, view.fy * s);
  c.cx = (view.cx + 0.5) * s - 0.5 + 0.5 * (size.width - view.width * s);
  c.cy = (view.cy + 0.5) * s - 0.5 + 0.5 * (size.height - view.height * s);
  return c;
}

Box3d box_of(const DecodedScene& scene) {
  Box3d box;
  for (const auto& chunk : scene.chunks) {
    for (const Triangle& triangle : chunk->mesh.triangles)
      for (const std::uint32_t vertex : triangle)
        box.add(vec_cast<double>(chunk->mesh.positions[vertex]));
    if (chunk->point_m > 0)
      for (const Vec3f point : chunk->mesh.positions) box.add(vec_cast<double>(point));
  }
  return box;
}

/// A horizontal direction, given which way is up.
Vec3d any_horizontal(Vec3d up) {
  const Vec3d off = std::abs(up.x) < 0.9 ? Vec3d{1, 0, 0} : Vec3d{0, 1, 0};
  return normalized(off - up * dot(off, up));
}

/// A camera on the far end of `towards` (unit length), as near as the whole box lets it be.
Pose see_all(const Box3d& box, const Camera& camera, Vec3d towards, Vec3d up) {
  constexpr double kMargin = 0.95;  // of the picture
  const Vec3d middle = (box.low + box.high) * 0.5;
  Pose pose = look_at(middle + towards, middle, up);
  double away = 0.2;
  for (int i = 0; i < 8; ++i) {
    const Vec3d corner{i & 1 ? box.high.x : box.low.x, i & 2 ? box.high.y : box.low.y,
                       i & 4 ? box.high.z : box.low.z};
    const Vec3d p = transposed(pose.rotation) * (corner - middle);
    away = std::max({away, std::abs(p.x) * camera.fx / (0.5 * kMargin * camera.width) - p.z,
                     std::abs(p.y) * camera.fy / (0.5 * kMargin * camera.height) - p.z});
  }
  pose.translation = middle + towards * away;
  return pose;
}

void add_from_outside(std::vector<Viewpoint>& out, const Box3d& box, Vec3d up, Size size) {
  const Camera camera = usual_camera(size);
  const Vec3d ahead = any_horizontal(up), side = cross(up, ahead);
  for (int i = 0; i < 4; ++i) {
    const double turn = std::numbers::pi * (0.25 + 0.5 * i);
    const Vec3d towards = normalized(ahead * std::cos(turn) + side * std::sin(turn) + up * 0.7);
    out.push_back({"outside_" + std::to_string(i), camera, see_all(box, camera, towards, up)});
  }
  out.push_back({"above", camera, see_all(box, camera, up, ahead)});
}

/// The middle of the sensors, looking their mean way (the first one's where they cancel out).
std::optional<Pose> middle_of_sensors(const DecodedScene& scene, Vec3d up) {
  std::vector<Pose> poses;
  for (const SourceInfo& source : scene.sources) poses.push_back(source.T_world_depth);
  if (poses.empty())
    for (const View& view : scene.views) poses.push_back(view.T_world_camera);
  if (poses.empty()) return std::nullopt;
  Vec3d eye, ahead;
  for (const Pose& pose : poses) eye += pose.translation, ahead += pose.rotation.column(2);
  const double count = static_cast<double>(poses.size());
  eye = eye / count;
  if (length(ahead) < 0.1 * count) ahead = poses.front().rotation.column(2);
  ahead = normalized(ahead);
  const bool vertical = length(cross(ahead, up)) < 1e-3;
  return look_at(eye, eye + ahead, vertical ? any_horizontal(up) : up);
}

}  // namespace

std::vector<Viewpoint> overview(const DecodedScene& scene, Vec3d up, int width, int height) {
  const Size size{width, height};
  std::vector<Viewpoint> out;
  for (std::size_t i = 0; i < scene.views.size(); ++i) {
    const View& view = scene.views[i];
    if (i > 0 && view.id == scene.views[i - 1].id) continue;  // its plate
    out.push_back(
        {"view_" + std::to_string(number_of(view.id)), camera_of(view, size), view.T_world_camera});
  }
  if (const Box3d box = box_of(scene); !box.empty()) add_from_outside(out, box, up, size);
  if (const auto pose = middle_of_sensors(scene, up))
    out.push_back({"middle", usual_camera(size), *pose});
  return out;
}

}  // namespace mr::render
