#include "mr/calib/sampled_surface.h"

#include <cmath>
#include <cstdint>
#include <optional>

#include "mr/core/parallel.h"

namespace mr::calib {
namespace {

/// In [0, 1), the same for the same number.
double random_at(std::uint64_t number) {
  const std::uint64_t h = hash_cell({static_cast<std::int32_t>(number), 0, 0});
  return static_cast<double>(h >> 11) * 0x1p-53;
}

/// The sample with its normal over the window, if a sensor of the part sees it there.
std::optional<SurfaceSample> smoothed(const std::vector<DepthView>& views, const SurfaceSample& raw,
                                      double voxel_m) {
  for (const DepthView& view : views) {
    const Vec3d p = view.T_camera_world * raw.position;
    const auto plane = plane_at(view, p, 2 * voxel_m);
    if (!plane || std::abs(plane->distance_m(p)) > 2 * voxel_m) continue;
    const Vec3d normal = transposed(view.T_camera_world.rotation) * plane->normal();
    if (dot(normal, raw.normal) > 0) return SurfaceSample{raw.position, normal};
  }
  return {};
}

/// One sample in each of kSamples equal shares of the area.
void add_samples(const Mesh& mesh, double voxel_m, SampledSurface& out) {
  std::vector<double> up_to(mesh.triangles.size());
  double area = 0;
  for (std::size_t t = 0; t < up_to.size(); ++t)
    up_to[t] = area += 0.5 * static_cast<double>(length(mesh.area_normal(t)));
  if (!(area > 0)) return;
  out.sample_m2 = area / kSamples;
  std::size_t t = 0;
  for (std::size_t i = 0; i < kSamples; ++i) {
    const double place = (static_cast<double>(i) + random_at(3 * i)) * out.sample_m2;
    while (t + 1 < up_to.size() && up_to[t] <= place) ++t;
    double s = random_at(3 * i + 1), r = random_at(3 * i + 2);
    if (s + r > 1) s = 1 - s, r = 1 - r;
    const auto corner = [&](int c) { return vec_cast<double>(mesh.corner(t, c)); };
    const SurfaceSample raw{corner(0) + (corner(1) - corner(0)) * s + (corner(2) - corner(0)) * r,
                            normalized(vec_cast<double>(mesh.area_normal(t)))};
    if (const auto sample = smoothed(out.views, raw, voxel_m)) out.samples.push_back(*sample);
  }
}

SampledSurface sampled_surface(const kit::Part& part, double voxel_m) {
  SampledSurface out;
  for (const SourceInfo& source : part.sources)
    out.eye += source.T_world_depth.translation / static_cast<double>(part.sources.size());
  if (part.mesh.empty()) return out;
  for (const Vec3f p : part.mesh.positions) out.box.add(p);
  for (const SourceInfo& source : part.sources) add_depth_views(part.mesh, source, out.views);
  add_samples(part.mesh, voxel_m, out);
  return out;
}

}  // namespace

std::vector<SampledSurface> sampled_surfaces(std::span<const kit::Part> parts, double voxel_m) {
  std::vector<SampledSurface> out(parts.size());
  parallel_for(parts.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) out[i] = sampled_surface(parts[i], voxel_m);
  });
  return out;
}

}  // namespace mr::calib
