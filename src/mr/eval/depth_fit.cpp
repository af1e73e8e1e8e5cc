#include "mr/eval/depth_fit.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "mr/core/parallel.h"
#include "mr/eval/sensor_coverage.h"
#include "mr/kit/raycast.h"

namespace mr::eval {
namespace {

constexpr double kFar_voxels = 3;
constexpr int kStride = 2;  // pixels

struct Counts {
  std::uint64_t pixels = 0, holes = 0, agree = 0, beyond_1 = 0, beyond_3 = 0;

  void add(const Counts& other) {
    pixels += other.pixels, holes += other.holes, agree += other.agree;
    beyond_1 += other.beyond_1, beyond_3 += other.beyond_3;
  }
};

/// A shown surface, as rays and points meet it.
class Shown {
 public:
  explicit Shown(const Mesh& mesh, double voxel_m)
      : mesh_(mesh), voxel_m_(voxel_m), rays_(std::vector<const Mesh*>{&mesh}) {}

  /// `direction`: unit length.
  void count(Vec3d eye, Vec3d direction, double range_m, Counts& out) const {
    ++out.pixels;
    const double far_m = kFar_voxels * voxel_m_;
    const auto shown_m = front(eye, direction, range_m + far_m);
    if (!shown_m) ++out.holes;
    if (shown_m && *shown_m >= range_m - far_m) ++out.agree;
    const auto nearest =
        rays_.nearest(vec_cast<float>(eye + direction * range_m), static_cast<float>(far_m));
    if (!nearest) ++out.beyond_3;
    if (!nearest || nearest->distance_m > voxel_m_) ++out.beyond_1;
  }

 private:
  /// Where a ray meets the first triangle that faces its start, up to `far_m`.
  std::optional<double> front(Vec3d eye, Vec3d direction, double far_m) const {
    constexpr float kOn = 1e-5f;  // m: past a triangle that faces away
    const Vec3f from = vec_cast<float>(eye), along = vec_cast<float>(direction);
    for (float near = 0; near < static_cast<float>(far_m);) {
      const auto hit = rays_.first_hit(from, along, near, static_cast<float>(far_m));
      if (!hit) return std::nullopt;
      if (dot(mesh_.area_normal(hit->triangle), along) < 0) return hit->distance;
      near = std::max(hit->distance + kOn,
                      std::nextafter(hit->distance, std::numeric_limits<float>::max()));
    }
    return std::nullopt;
  }

  const Mesh& mesh_;
  double voxel_m_;
  kit::RayScene rays_;
};

Counts counts_of(const Shown& shown, const Frame& frame, const SensorConfig& sensor,
                 std::span<const HalfSpace> captured) {
  const Camera camera = undistorted(sensor.depth_camera);
  const Pose& T = frame.T_world_depth;
  const int rows = (frame.depth.height + kStride - 1) / kStride;
  std::vector<Counts> of_row(rows);
  parallel_for(rows, 8, [&](std::size_t begin, std::size_t end) {
    for (std::size_t r = begin; r < end; ++r)
      for (int x = 0, y = static_cast<int>(r) * kStride; x < frame.depth.width; x += kStride) {
        const float depth = *frame.depth.at(x, y);
        if (!(depth >= sensor.depth_near_m && depth <= sensor.depth_far_m)) continue;
        const Vec3d ray = T.rotation * unproject(camera, {double(x), double(y)});
        const Vec3d point = T.translation + ray * double{depth};
        if (std::ranges::any_of(captured, [&](const HalfSpace& space) {
              return dot(space.normal, point) < space.least_m;
            }))
          continue;
        shown.count(T.translation, normalized(ray), length(ray) * depth, of_row[r]);
      }
  });
  Counts out;
  for (const Counts& row : of_row) out.add(row);
  return out;
}

}  // namespace

DepthFit depth_fit(const Mesh& mesh, const Scene& scene, std::span<const Frame> capture,
                   double voxel_m) {
  const Shown shown(mesh, voxel_m);
  const std::vector<HalfSpace> captured = captured_half_spaces(scene);
  Counts all;
  for (const Frame& frame : capture)
    all.add(counts_of(shown, frame, scene.sensor(frame.sensor), captured));
  if (all.pixels == 0) return {};
  const auto share = [&](std::uint64_t n) {
    return static_cast<double>(n) / static_cast<double>(all.pixels);
  };
  return {all.pixels, share(all.holes), share(all.agree), share(all.beyond_1), share(all.beyond_3)};
}

}  // namespace mr::eval
