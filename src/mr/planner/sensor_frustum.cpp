#include "mr/planner/sensor_frustum.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>

namespace mr::planner {
namespace {

constexpr std::size_t kMostPoses = 16;  // of a sensor that moves

}  // namespace

SensorFrustum::SensorFrustum(const SensorConfig& sensor, const SensorSample& sample)
    : camera_(undistorted_whole(sensor.depth_camera)),
      depth_(&sample.depth),
      near_m_(sensor.depth_near_m),
      far_m_(sensor.depth_far_m) {
  const auto& all = sensor.T_world_depth;
  const std::size_t count = std::min(all.size(), kMostPoses);
  for (std::size_t i = 0; i < count; ++i) T_world_depth_.push_back(all[i * all.size() / count]);
  const auto end = T_world_depth_.end();
  if (sample.T_world_depth) seen_from_ = {sample.T_world_depth->inverse()};
  if (seen_from_.empty())
    std::transform(T_world_depth_.begin(), end, std::back_inserter(seen_from_),
                   [](const Pose& T) { return T.inverse(); });
  for (const Vec2d pixel : border()) {
    const Vec3d ray = unproject(camera_, pixel);
    rays_.add(is_flat() ? ray : Vec3d{});
    farthest_m_ = std::max(farthest_m_, far_m_ * length(ray));
  }
}

bool SensorFrustum::sees(Vec3d point) const {
  return std::any_of(seen_from_.begin(), seen_from_.end(), [&](const Pose& T_depth_world) {
    const Vec3d p = T_depth_world * point;
    if (dot(p, p) > farthest_m_ * farthest_m_) return false;
    const double depth = is_flat() ? p.z : length(p);
    if (depth < near_m_ || depth > far_m_) return false;
    const auto pixel = project(camera_, p);
    if (!pixel) return false;
    const double u = std::round(pixel->x), v = std::round(pixel->y);
    return u >= 0 && v >= 0 && u < camera_.width && v < camera_.height &&
           (depth_->empty() || has_surface(static_cast<int>(u), static_cast<int>(v), depth));
  });
}

std::vector<Vec3d> SensorFrustum::points(int count) const {
  std::vector<Vec3d> out;
  const auto part = [](int i, double step) { return std::fmod(0.5 + i * step, 1.0); };
  for (int i = 0; i < count; ++i) {  // Roberts' R3 sequence
    const Vec2d pixel{part(i, 0.8191725134) * camera_.width - 0.5,
                      part(i, 0.6710436067) * camera_.height - 0.5};
    const double near3 = near_m_ * near_m_ * near_m_, far3 = far_m_ * far_m_ * far_m_;
    const double depth = std::cbrt(near3 + part(i, 0.5497004779) * (far3 - near3));
    out.push_back(T_world_depth_[i % T_world_depth_.size()] * (unproject(camera_, pixel) * depth));
  }
  return out;
}

Box3d SensorFrustum::reach() const {
  Box3d out;
  for (const Pose& T : T_world_depth_) {
    out.add(T.translation);
    const Vec3d far{far_m_, far_m_, far_m_};
    if (!is_flat()) out.add(T.translation - far), out.add(T.translation + far);
    if (is_flat())
      for (const Vec2d pixel : border()) out.add(T * (unproject(camera_, pixel) * far_m_));
  }
  return out;
}

bool SensorFrustum::may_see(const Box3d& box) const {
  return std::any_of(T_world_depth_.begin(), T_world_depth_.end(), [&](const Pose& T) {
    const Vec3d nearest = max(box.low, min(box.high, T.translation));
    if (length(nearest - T.translation) > farthest_m_) return false;
    return !is_flat() || !is_beside(box, T.inverse());
  });
}

std::array<Vec2d, 8> SensorFrustum::border() const {
  const double left = -0.5, right = camera_.width - 0.5, top = -0.5, low = camera_.height - 0.5;
  const double x = (left + right) / 2, y = (top + low) / 2;
  return {{{left, top},
           {x, top},
           {right, top},
           {left, y},
           {right, y},
           {left, low},
           {x, low},
           {right, low}}};
}

bool SensorFrustum::has_surface(int u, int v, double depth_m) const {
  constexpr double kApart = 0.1;  // metres; more is another surface
  for (int y = std::max(v - 1, 0); y <= std::min(v + 1, depth_->height - 1); ++y)
    for (int x = std::max(u - 1, 0); x <= std::min(u + 1, depth_->width - 1); ++x)
      if (*depth_->at(x, y) > 0 && std::abs(*depth_->at(x, y) - depth_m) <= kApart) return true;
  return false;
}

/// Whether all of a box lies beyond one of the six sides of a pinhole's frustum.
bool SensorFrustum::is_beside(const Box3d& box, const Pose& T_depth_world) const {
  std::array<bool, 6> all;
  all.fill(true);
  for (int corner = 0; corner < 8; ++corner) {
    const Vec3d p = T_depth_world * Vec3d{corner & 1 ? box.high.x : box.low.x,
                                          corner & 2 ? box.high.y : box.low.y,
                                          corner & 4 ? box.high.z : box.low.z};
    const std::array<bool, 6> beyond = {p.z<near_m_, p.z> far_m_,
                                        p.x<rays_.low.x * p.z, p.x> rays_.high.x * p.z,
                                        p.y<rays_.low.y * p.z, p.y> rays_.high.y * p.z};
    for (std::size_t side = 0; side < 6; ++side) all[side] = all[side] && beyond[side];
  }
  return std::any_of(all.begin(), all.end(), [](bool outside) { return outside; });
}

}  // namespace mr::planner
