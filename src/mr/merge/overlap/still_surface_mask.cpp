#include "mr/merge/overlap/still_surface_mask.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "mr/core/parallel.h"
#include "mr/kit/raster.h"
#include "mr/merge/overlap/ray_grids.h"

namespace mr::merge {
namespace {

constexpr int kMostColumns = 320;   // of a view
constexpr double kBehind_m = 0.05;  // nearer to its own still surface, a moving one stands on it
constexpr double kSame_sigmas = 2;
constexpr double kFlattest = 0.3;  // cosine; flatter angles count as this one

/// The triangles that a sensor measured.
Mesh measured_by(const kit::Part& part, SensorId sensor) {
  if (part.sources.size() == 1) return part.mesh;
  std::vector<std::uint8_t> keep(part.mesh.triangles.size());
  for (const SensorRun& run : part.mesh.sensors)
    if (run.id == sensor) std::fill_n(keep.begin() + run.first, run.count, std::uint8_t{1});
  return select_triangles(part.mesh, keep);
}

/// Bilinear interpolation of inverse depth, in which planes are linear; the nearest pixel if one of
/// the four is invalid or a depth edge lies between them. The point must be inside the picture.
double depth_at(const ImageDepth& depth, double u, double v) {
  constexpr double kEdge = 0.1;  // change of depth from a pixel to the next
  const double nearest =
      *depth.at(static_cast<int>(std::lround(u)), static_cast<int>(std::lround(v)));
  const int x = static_cast<int>(std::floor(u)), y = static_cast<int>(std::floor(v));
  if (x < 0 || y < 0 || x + 1 >= depth.width || y + 1 >= depth.height) return nearest;
  const float *const top = depth.at(x, y), *const bottom = depth.at(x, y + 1);
  const auto [least, most] = std::minmax({top[0], top[1], bottom[0], bottom[1]});
  if (!(least > 0) || most > (1 + kEdge) * least) return nearest;
  const double a = u - x, b = v - y;
  return 1 /
         ((1 - b) * ((1 - a) / top[0] + a / top[1]) + b * ((1 - a) / bottom[0] + a / bottom[1]));
}

}  // namespace

StillSurfaceMask::StillSurfaceMask(const Mesh& merged, std::span<const kit::Part> parts,
                                   const OverlapConfig& config)
    : config_(config) {
  std::vector<const kit::Part*> part_of;
  for (const kit::Part& part : parts)
    for (const SourceInfo& source : part.sources) {
      if (source.depth_camera.model != CameraModel::pinhole) continue;
      const double factor = std::min(1.0, double{kMostColumns} / source.depth_camera.width);
      views_.push_back({source.sensor,
                        factor,
                        kit::scaled(source.depth_camera, factor),
                        source.T_world_depth.inverse(),
                        source.precision,
                        {},
                        {}});
      part_of.push_back(&part);
    }
  parallel_for(2 * views_.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      SensorView& view = views_[i / 2];
      const auto draw = [&](const Mesh& mesh) {
        return kit::rasterize_depth(mesh, view.camera, view.T_camera_world.inverse());
      };
      if (i % 2 == 0)
        view.merged = draw(merged);
      else
        view.own = draw(measured_by(*part_of[i / 2], view.sensor));
    }
  });
}

const StillSurfaceMask::SensorView* StillSurfaceMask::view_of(SensorId sensor) const {
  const auto at = std::ranges::find(views_, sensor, &SensorView::sensor);
  return at == views_.end() ? nullptr : &*at;
}

/// A triangle is covered if its corners and centroid are.
bool StillSurfaceMask::is_covered(const Mesh& mesh, std::size_t t, const SensorView& view) const {
  const double slack_m = config_.voxel_m / 2;
  const Vec3d normal =
      view.T_camera_world.rotation * normalized(vec_cast<double>(mesh.area_normal(t)));
  const auto covered = [&](Vec3f p_world) {
    const Vec3d p = view.T_camera_world * vec_cast<double>(p_world);
    if (p.z <= kit::kNearPlane_m) return false;
    const kit::ScreenPoint s = kit::to_screen(view.camera, p);
    if (!(std::abs(s.u) < 1e6 && std::abs(s.v) < 1e6)) return false;
    const int x = static_cast<int>(std::lround(s.u)), y = static_cast<int>(std::lround(s.v));
    if (!view.own.contains(x, y)) return false;
    const double own = depth_at(view.own, s.u, s.v), merged = depth_at(view.merged, s.u, s.v);
    // At grazing angles a small distance along the normal is a large one in depth.
    const double cosine = std::clamp(std::abs(dot(normal, p)) / p.z, kFlattest, 1.0);
    const double same_m = (kSame_sigmas * view.precision.sigma_m(p.z) + slack_m) / cosine;
    if (own > 0 && std::abs(own - p.z) <= same_m)  // perhaps another's is shown in its place
      return merged > 0 && std::abs(merged - own) <= kBehind_m;
    if (own > p.z && own <= p.z + kBehind_m) return false;
    return merged > 0 && std::abs(merged - p.z) <= same_m + 2 * config_.calibration_error_m;
  };
  return covered(mesh.centroid(t)) && covered(mesh.corner(t, 0)) && covered(mesh.corner(t, 1)) &&
         covered(mesh.corner(t, 2));
}

Mesh StillSurfaceMask::uncovered(const kit::Part& moving) const {
  const Mesh& mesh = moving.mesh;
  const std::vector<SensorId> sensors =
      moving.sources.size() == 1
          ? std::vector<SensorId>(mesh.triangles.size(), moving.sources.front().sensor)
          : triangle_sensors(mesh);
  std::vector<std::uint8_t> keep(mesh.triangles.size(), 1);
  parallel_for(keep.size(), 1024, [&](std::size_t begin, std::size_t end) {
    const SensorView* view = nullptr;
    std::optional<SensorId> of;
    for (std::size_t t = begin; t < end; ++t) {
      if (of != sensors[t]) of = sensors[t], view = view_of(sensors[t]);
      if (view && is_covered(mesh, t, *view)) keep[t] = 0;
    }
  });
  return select_triangles(mesh, keep);
}

}  // namespace mr::merge
