#include "mr/eval/geometry_error.h"

#include <algorithm>
#include <cmath>

#include "mr/core/assert.h"
#include "mr/core/parallel.h"
#include "mr/kit/raycast.h"
#include "mr/kit/topology.h"

namespace mr::eval {
namespace {

constexpr double kAlike = 0.5;  // cosine: normals within 60 degrees

kit::RayScene rays_of(const Mesh& mesh) {
  const Mesh* meshes[] = {&mesh};
  return kit::RayScene(meshes);
}

/// Metres from each sample to the nearest point of a surface that is not empty.
std::vector<double> distances_m(std::span<const SurfaceSample> samples, const kit::RayScene& to) {
  std::vector<double> out(samples.size());
  parallel_for(samples.size(), 256, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const auto nearest = to.nearest(samples[i].position);
      MR_ASSERT(nearest);
      out[i] = nearest->distance_m;
    }
  });
  return out;
}

SurfaceDistance summary(std::vector<double> distances) {
  if (distances.empty()) return {};
  double sum = 0, squares = 0;
  for (const double d : distances) sum += d, squares += d * d;
  const auto count = static_cast<double>(distances.size());
  std::ranges::sort(distances);
  const auto p95 = static_cast<std::size_t>(std::ceil(0.95 * count)) - 1;
  return {sum / count * 1000, std::sqrt(squares / count) * 1000, distances[p95] * 1000,
          distances.back() * 1000};
}

double share(std::span<const std::uint8_t> flags) {
  const auto set =
      static_cast<double>(flags.size()) - static_cast<double>(std::ranges::count(flags, 0));
  return flags.empty() ? 0 : set / static_cast<double>(flags.size());
}

bool facing_alike(const Mesh& mesh, std::uint32_t triangle, Vec3f normal) {
  const Vec3d other = normalized(vec_cast<double>(mesh.area_normal(triangle)));
  return dot(other, vec_cast<double>(normal)) >= kAlike;
}

/// Whether two triangles have a corner in one place. `place`: same_place().
bool touch(const Mesh& mesh, const std::vector<std::uint32_t>& place, std::uint32_t a,
           std::uint32_t b) {
  for (const std::uint32_t v : mesh.triangles[a])
    for (const std::uint32_t w : mesh.triangles[b])
      if (place[v] == place[w]) return true;
  return false;
}

double duplicate_share(const Mesh& mesh, const kit::RayScene& rays,
                       std::span<const SurfaceSample> samples, double voxel_m) {
  const std::vector<std::uint32_t> place = kit::same_place(mesh.positions);
  const auto range = static_cast<float>(3 * voxel_m);
  std::vector<std::uint8_t> doubled(samples.size(), 0);
  parallel_for(samples.size(), 256, [&](std::size_t begin, std::size_t end) {
    std::vector<kit::RayHit> hits;
    for (std::size_t i = begin; i < end; ++i) {
      const SurfaceSample& sample = samples[i];
      rays.all_hits(sample.position, sample.normal, -range, range, hits);
      doubled[i] = std::ranges::any_of(hits, [&](const kit::RayHit& hit) {
        return !touch(mesh, place, sample.triangle, hit.triangle) &&
               facing_alike(mesh, hit.triangle, sample.normal);
      });
    }
  });
  return share(doubled);
}

Status check(const Mesh& mesh, const char* which) {
  constexpr float kFarthest_m = 1e4f;
  for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
    const Vec3f p = mesh.positions[v];
    if (!is_finite(p) || length(p) > kFarthest_m)
      return Error{Error::Cause::invalid, std::string(which) + ": vertex " + std::to_string(v) +
                                              " is not at a finite place within 10 km"};
  }
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    for (const std::uint32_t v : mesh.triangles[t])
      if (v >= mesh.positions.size())
        return Error{Error::Cause::invalid, std::string(which) + ": triangle " + std::to_string(t) +
                                                " names vertex " + std::to_string(v) + " of " +
                                                std::to_string(mesh.positions.size())};
  return {};
}

Error no_area(const char* which) {
  return {Error::Cause::empty, std::string(which) + " has no surface"};
}

bool in_all(std::span<const HalfSpace> spaces, Vec3d p) {
  return std::ranges::all_of(
      spaces, [&](const HalfSpace& space) { return dot(space.normal, p) >= space.least_m; });
}

/// Samples of what could have been captured of the reference.
std::vector<SurfaceSample> wanted_samples(const Mesh& reference, std::vector<SurfaceSample> samples,
                                          std::span<const SensorFrustum> frustums,
                                          const GeometryConfig& config) {
  std::erase_if(samples, [&](const SurfaceSample& sample) {
    return !in_all(config.captured, vec_cast<double>(sample.position));
  });
  if (frustums.empty()) return samples;
  const auto seen = seen_samples(reference, samples, frustums, config.voxel_m);
  std::vector<SurfaceSample> out;
  for (std::size_t i = 0; i < samples.size(); ++i)
    if (seen[i]) out.push_back(samples[i]);
  return out;
}

/// Tells whether a point of a mesh lies on its border.
class Border {
 public:
  explicit Border(const Mesh& mesh) : mesh_(mesh), uses_(kit::edge_table(mesh).uses) {
    at_vertex_.resize(mesh.positions.size(), 0);
    for (std::uint32_t h = 0; h < uses_.size(); ++h)
      if (uses_[h] == 1)
        at_vertex_[kit::edge_from(mesh, h)] = at_vertex_[kit::edge_to(mesh, h)] = 1;
  }

  bool has(const kit::NearestPoint& nearest) const {
    constexpr double kSame_m = 1e-7;
    for (std::uint32_t h = 3 * nearest.triangle; h < 3 * nearest.triangle + 3; ++h) {
      const std::uint32_t from = kit::edge_from(mesh_, h);
      const Vec3d a = vec_cast<double>(mesh_.positions[from]);
      const Vec3d b = vec_cast<double>(mesh_.positions[kit::edge_to(mesh_, h)]);
      if (at_vertex_[from] && length(nearest.point - a) < kSame_m) return true;
      if (uses_[h] != 1) continue;
      if (length(kit::nearest_on_segment(nearest.point, a, b) - nearest.point) < kSame_m)
        return true;
    }
    return false;
  }

 private:
  const Mesh& mesh_;
  std::vector<std::uint8_t> uses_, at_vertex_;
};

/// What samples of one surface have in common with another.
struct Shared {
  double area_m2 = 0, squares = 0;  ///< squares: of distances in metres, times area
  double share = 0;
};

Shared shared_with(const Mesh& from, const Mesh& to, const GeometryConfig& config) {
  const auto samples = sample_surface(from, config.samples, config.seed);
  const kit::RayScene rays = rays_of(to);
  const Border border(to);
  const auto within = static_cast<float>(5 * config.voxel_m);
  std::vector<double> distance(samples.size(), -1);
  parallel_for(samples.size(), 256, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const auto nearest = rays.nearest(samples[i].position, within);
      if (nearest && facing_alike(to, nearest->triangle, samples[i].normal) &&
          !border.has(*nearest))
        distance[i] = nearest->distance_m;
    }
  });
  Shared out;
  if (samples.empty()) return out;
  const double each = surface_area_m2(from) / static_cast<double>(samples.size());
  for (const double d : distance)
    if (d >= 0) out.area_m2 += each, out.squares += each * d * d;
  out.share = out.area_m2 / surface_area_m2(from);
  return out;
}

}  // namespace

SurfaceDistance surface_distance(const Mesh& from, const Mesh& to, int samples,
                                 std::uint64_t seed) {
  const auto points = sample_surface(from, samples, seed);
  if (!(surface_area_m2(to) > 0)) return {};
  return summary(distances_m(points, rays_of(to)));
}

SurfaceDistance distance_to_marked(const Mesh& from, const Mesh& to,
                                   std::span<const std::uint8_t> marked, int samples,
                                   std::uint64_t seed) {
  MR_ASSERT(marked.size() == to.triangles.size());
  const auto points = sample_surface(from, samples, seed);
  if (!(surface_area_m2(to) > 0)) return {};
  const kit::RayScene rays = rays_of(to);
  std::vector<double> out(points.size(), -1);
  parallel_for(points.size(), 256, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      if (const auto nearest = rays.nearest(points[i].position); marked[nearest->triangle])
        out[i] = nearest->distance_m;
  });
  std::erase_if(out, [](double distance_m) { return distance_m < 0; });
  return summary(std::move(out));
}

double duplicate_ratio(const Mesh& mesh, const GeometryConfig& config) {
  return duplicate_share(mesh, rays_of(mesh), sample_surface(mesh, config.samples, config.seed),
                         config.voxel_m);
}

Result<GeometryError> geometry_error(const Mesh& mesh, const Mesh& reference,
                                     std::span<const SensorFrustum> frustums,
                                     const GeometryConfig& config) {
  MR_ASSERT(config.voxel_m > 0 && config.samples > 0);
  if (const Status sound = check(mesh, "the mesh"); !sound) return sound.error();
  if (const Status sound = check(reference, "the reference"); !sound) return sound.error();
  const Mesh welded = kit::weld(mesh);
  const auto samples = sample_surface(welded, config.samples, config.seed);
  if (samples.empty()) return no_area("the mesh");
  auto wanted = sample_surface(reference, config.samples, config.seed + 1);
  if (wanted.empty()) return no_area("the reference");
  wanted = wanted_samples(reference, std::move(wanted), frustums, config);
  if (wanted.empty()) return Error{Error::Cause::empty, "no sensor sees any of the reference"};

  const kit::RayScene rays = rays_of(welded);
  const std::vector<double> from_reference = distances_m(wanted, rays);
  GeometryError error;
  error.to_reference = summary(distances_m(samples, rays_of(reference)));
  error.from_reference = summary(from_reference);
  error.seen_ratio = static_cast<double>(wanted.size()) / config.samples;
  error.duplicate_ratio = duplicate_share(welded, rays, samples, config.voxel_m);
  const auto missing =
      std::ranges::count_if(from_reference, [&](double d) { return d > config.voxel_m; });
  error.missing_ratio = static_cast<double>(missing) / static_cast<double>(wanted.size());
  error.nonmanifold_edges = kit::count_nonmanifold_edges(welded);
  error.components = kit::components(welded).area_m2.size();
  error.seam_gap_p95_mm = seam_gap_p95_mm(welded, config.voxel_m);
  error.boundary_m = boundary_length_m(welded);
  return error;
}

double residual_mm(const Mesh& a, const Mesh& b, const GeometryConfig& config) {
  const Mesh mesh_a = kit::weld(a), mesh_b = kit::weld(b);
  const double area_a = surface_area_m2(mesh_a), area_b = surface_area_m2(mesh_b);
  if (!(area_a > 0 && area_b > 0)) return -1;
  const Shared of_a = shared_with(mesh_a, mesh_b, config);
  const Shared of_b = shared_with(mesh_b, mesh_a, config);
  if ((area_a <= area_b ? of_a : of_b).share < 0.01) return -1;
  return std::sqrt((of_a.squares + of_b.squares) / (of_a.area_m2 + of_b.area_m2)) * 1000;
}

}  // namespace mr::eval
