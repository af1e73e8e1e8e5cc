#include "mr/calib/correspondences.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "mr/kit/boxes.h"

namespace mr::calib {
namespace {

constexpr std::size_t kPartsForAll = 6;    // up to so many neighbours, every sample is used
constexpr std::size_t kLeastSamples = 64;  // of a part that another one tests
constexpr double kAlike = 0.87;            // cosine: normals within 30 degrees
constexpr double kFacing = 0.25;           // cosine towards a camera: not grazing

/// A sample projected into a depth view.
struct Projected {
  std::optional<DepthPlane> plane;  // the same surface
  double distance_m = 0;            // before it
  bool through = false;
};

Projected project_into(const DepthView& view, Vec3d p, Vec3d normal,
                       const RegistrationConfig& config) {
  const double bend_m = 2 * config.voxel_m;
  Projected out;
  if (dot(normal, p) > -kFacing * length(p)) return out;
  std::optional<DepthPlane> plane = plane_at(view, p, bend_m);
  if (!plane) return out;
  out.distance_m = plane->distance_m(p);
  if (std::abs(out.distance_m) <= config.reach_m) {
    plane = plane_at(view, p - plane->normal() * out.distance_m, bend_m);  // nearer to its foot
    if (!plane || dot(plane->normal(), normal) < kAlike) return out;
    out.distance_m = plane->distance_m(p);
    if (std::abs(out.distance_m) <= config.reach_m) out.plane = plane;
  } else if (out.distance_m > 0) {
    out.through = 1 > dot(plane->per_depth, p + p * (config.reach_m / p.z));
  }
  return out;
}

/// Adds what `at` shows of `from`'s samples. `sign`: 1 when from is the pair's a.
void add_correspondences(const SampledSurface& from, const Pose& T_from, const SampledSurface& at,
                         const Pose& T_at, std::size_t stride, double sign,
                         const RegistrationConfig& config, Correspondences& out) {
  std::vector<Pose> T_camera_from;
  const Pose T_at_from = T_at.inverse() * T_from;
  for (const DepthView& view : at.views) T_camera_from.push_back(view.T_camera_world * T_at_from);
  const double area_m2 = from.sample_m2 * static_cast<double>(stride);
  for (std::size_t i = 0; i < from.samples.size(); i += stride) {
    const SurfaceSample& sample = from.samples[i];
    Projected best;
    std::size_t seen_by = 0;
    bool through = false;
    for (std::size_t v = 0; v < at.views.size(); ++v) {
      const Pose& T = T_camera_from[v];
      const Projected found =
          project_into(at.views[v], T * sample.position, T.rotation * sample.normal, config);
      through |= found.through;
      const bool nearer = !best.plane || std::abs(found.distance_m) < std::abs(best.distance_m);
      if (found.plane && nearer) best = found, seen_by = v;
    }
    if (best.plane) {
      const Mat3 R_world_camera =
          T_at.rotation * transposed(at.views[seen_by].T_camera_world.rotation);
      out.matches.push_back({T_from * sample.position, R_world_camera * best.plane->normal(),
                             sign * best.distance_m, area_m2});
    } else if (through) {
      out.through_m2 += area_m2;
    }
  }
}

}  // namespace

std::vector<PartPair> pairs_that_meet(const std::vector<SampledSurface>& surfaces,
                                      const RegistrationConfig& config) {
  std::vector<PartPair> out;
  std::vector<std::size_t> neighbours(surfaces.size());
  for (std::uint32_t a = 0; a < surfaces.size(); ++a)
    for (std::uint32_t b = a + 1; b < surfaces.size(); ++b)
      if (kit::meet(surfaces[a].box, surfaces[b].box, static_cast<float>(config.reach_m)))
        out.push_back({a, b, 1, 1}), ++neighbours[a], ++neighbours[b];
  const auto stride = [&](std::uint32_t part) {
    return std::clamp<std::size_t>(neighbours[part] / kPartsForAll, 1, kSamples / kLeastSamples);
  };
  for (PartPair& p : out) p.stride_a = stride(p.a), p.stride_b = stride(p.b);
  return out;
}

// `apart_m` is along normals that point out of either surface, so for b's samples its sign is
// turned.
Correspondences find_correspondences(const std::vector<SampledSurface>& surfaces,
                                     std::span<const Pose> poses, const PartPair& pair,
                                     const RegistrationConfig& config) {
  const auto [a, b, stride_a, stride_b] = pair;
  Correspondences out;
  add_correspondences(surfaces[a], poses[a], surfaces[b], poses[b], stride_a, 1, config, out);
  add_correspondences(surfaces[b], poses[b], surfaces[a], poses[a], stride_b, -1, config, out);
  return out;
}

double trim_limit_m(const Correspondences& found, const RegistrationConfig& config) {
  if (found.matches.empty()) return 0;
  std::vector<double> apart;
  for (const Correspondence& m : found.matches) apart.push_back(std::abs(m.apart_m));
  const auto middle = apart.begin() + static_cast<std::ptrdiff_t>(apart.size() / 2);
  std::nth_element(apart.begin(), middle, apart.end());
  return std::clamp(4.5 * *middle, 1.5 * config.voxel_m, config.reach_m);
}

}  // namespace mr::calib
