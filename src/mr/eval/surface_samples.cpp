#include <algorithm>
#include <cmath>

#include "mr/core/assert.h"
#include "mr/core/parallel.h"
#include "mr/eval/geometry_error.h"
#include "mr/kit/raycast.h"
#include "mr/synth/hash.h"

namespace mr::eval {
namespace {

using synth::mix;

/// [0, 1) with all the bits of a double.
double fraction(std::uint64_t hash) { return static_cast<double>(hash >> 11) * 0x1p-53; }

Vec3d corner(const Mesh& mesh, std::size_t triangle, int i) {
  return vec_cast<double>(mesh.corner(triangle, i));
}

/// Area up to and including each triangle.
std::vector<double> cumulative_area(const Mesh& mesh) {
  std::vector<double> sums(mesh.triangles.size());
  double sum = 0;
  for (std::size_t t = 0; t < sums.size(); ++t) {
    const Vec3d a = corner(mesh, t, 0);
    sum += 0.5 * length(cross(corner(mesh, t, 1) - a, corner(mesh, t, 2) - a));
    sums[t] = sum;
  }
  return sums;
}

/// The point of a triangle at (u, v) of the unit square, whose upper half is folded onto the lower.
SurfaceSample sample_at(const Mesh& mesh, std::uint32_t t, double u, double v) {
  if (u + v > 1) u = 1 - u, v = 1 - v;
  const Vec3d a = corner(mesh, t, 0), b = corner(mesh, t, 1) - a, c = corner(mesh, t, 2) - a;
  return {vec_cast<float>(a + b * u + c * v), vec_cast<float>(normalized(cross(b, c))), t};
}

/// Whether a direction lies between a LiDAR's beams, or half a row beyond; project() takes the
/// nearest beam, however far.
bool in_field(const Camera& lidar, Vec3d p) {
  const auto [low, high] =
      std::minmax_element(lidar.beam_altitude_rad.begin(), lidar.beam_altitude_rad.end());
  const double half_row = 0.5 * (*high - *low) / std::max(1, lidar.height - 1);
  const double altitude = std::atan2(-p.y, std::hypot(p.x, p.z));
  return altitude >= *low - half_row && altitude <= *high + half_row;
}

/// Whether a camera could measure a point of a surface if nothing stood between them.
bool could_see(const SensorFrustum& frustum, const Pose& T_depth_world,
               const SurfaceSample& sample) {
  constexpr double kLeastCosine = 0.1;
  const Vec3d p_world = vec_cast<double>(sample.position), p = T_depth_world * p_world;
  const double depth = frustum.depth_camera.model == CameraModel::pinhole ? p.z : length(p);
  if (depth < frustum.near_m || depth > frustum.far_m) return false;
  const Vec3d towards = normalized(frustum.T_world_depth.translation - p_world);
  if (dot(vec_cast<double>(sample.normal), towards) <= kLeastCosine) return false;
  if (frustum.depth_camera.model == CameraModel::lidar && !in_field(frustum.depth_camera, p))
    return false;
  const auto pixel = project(frustum.depth_camera, p);
  return pixel && pixel->x >= -0.5 && pixel->y >= -0.5 &&
         pixel->x < frustum.depth_camera.width - 0.5 &&
         pixel->y < frustum.depth_camera.height - 0.5;
}

/// Whether the way from an eye to a point is free, but for the last `tolerance_m`.
bool is_unoccluded(const kit::RayScene& rays, Vec3f eye, Vec3f point, double tolerance_m) {
  const double distance = length(vec_cast<double>(point) - vec_cast<double>(eye));
  if (distance <= tolerance_m) return true;
  return !rays.first_hit(eye, point - eye, 0, static_cast<float>(1 - tolerance_m / distance));
}

}  // namespace

std::vector<SurfaceSample> sample_surface(const Mesh& mesh, int samples, std::uint64_t seed) {
  const std::vector<double> area = cumulative_area(mesh);
  if (samples <= 0 || area.empty() || !(area.back() > 0)) return {};
  // Inside triangles samples follow Roberts' R2 sequence: neighbours in number keep apart.
  constexpr double kGolden = 1.32471795724474602596;
  const double u0 = fraction(mix(seed, 1)), v0 = fraction(mix(seed, 2));
  const auto count = static_cast<std::size_t>(samples);
  std::vector<SurfaceSample> out(count);
  parallel_for(count, 1024, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const double place = (static_cast<double>(i) + fraction(mix(mix(seed, 3), i))) /
                           static_cast<double>(count) * area.back();
      // The first triangle that ends beyond the place: one without area never is.
      const auto at = std::upper_bound(area.begin(), area.end() - 1, place) - area.begin();
      const double u = u0 + static_cast<double>(i) / kGolden;
      const double v = v0 + static_cast<double>(i) / (kGolden * kGolden);
      out[i] =
          sample_at(mesh, static_cast<std::uint32_t>(at), u - std::floor(u), v - std::floor(v));
    }
  });
  return out;
}

std::vector<std::uint8_t> seen_samples(const Mesh& surface, std::span<const SurfaceSample> samples,
                                       std::span<const SensorFrustum> frustums,
                                       double tolerance_m) {
  const Mesh* meshes[] = {&surface};
  const kit::RayScene rays(meshes);
  std::vector<Pose> T_depth_world;
  for (const SensorFrustum& frustum : frustums)
    T_depth_world.push_back(frustum.T_world_depth.inverse());
  std::vector<std::uint8_t> seen(samples.size(), 0);
  parallel_for(samples.size(), 256, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      for (std::size_t e = 0; e < frustums.size() && !seen[i]; ++e)
        seen[i] = could_see(frustums[e], T_depth_world[e], samples[i]) &&
                  is_unoccluded(rays, vec_cast<float>(frustums[e].T_world_depth.translation),
                                samples[i].position, tolerance_m);
  });
  return seen;
}

}  // namespace mr::eval
