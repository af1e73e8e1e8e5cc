#include "mr/merge/overlap/occlusion_rule.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>

#include "mr/core/assert.h"
#include "mr/core/parallel.h"
#include "mr/kit/a_buffer.h"
#include "mr/kit/raster.h"
#include "mr/kit/raycast.h"
#include "mr/merge/overlap/measured.h"
#include "mr/merge/overlap/raster_voter.h"
#include "mr/merge/overlap/ray_votes.h"

namespace mr::merge {
namespace {

/// The depth of a point in a source's camera.
double depth_m(const SourceInfo& source, Vec3f point) {
  const Vec3d ray = vec_cast<double>(point) - source.T_world_depth.translation;
  return source.depth_camera.model == CameraModel::pinhole
             ? std::max(dot(ray, source.T_world_depth.rotation.column(2)), 0.0)
             : length(ray);
}

/// Depth noise at a point: of the source that measured it or, if that is unknown, the largest.
float sigma_m(const kit::Part& part, SensorId sensor, Vec3f point) {
  double worst = 0;
  for (const SourceInfo& s : part.sources) {
    const double sigma = s.precision.sigma_m(depth_m(s, point));
    if (s.sensor == sensor) return static_cast<float>(sigma);
    worst = std::max(worst, sigma);
  }
  return static_cast<float>(worst);
}

/// Sum of the area normals (twice the area) of the triangles at every vertex; NaNs are left out.
std::vector<Vec3f> normals_around(const Mesh& mesh) {
  std::vector<Vec3f> out(mesh.positions.size());
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const Vec3f normal = mesh.area_normal(t);
    if (!is_finite(normal)) continue;
    for (const std::uint32_t v : mesh.triangles[t]) out[v] += normal;
  }
  return out;
}

/// Computes the attributes of a part's triangles.
void describe(const kit::Part& part, std::uint32_t number, const OverlapConfig& config,
              TriangleSurface* out) {
  constexpr std::size_t kGrain = 8192;
  const std::vector<SensorId> views = triangle_sensors(part.mesh);
  const std::vector<Vec3f> normals = normals_around(part.mesh);
  const float slack = slack_m(part, config);
  parallel_for(views.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t t = begin; t < end; ++t) {
      const Triangle& tri = part.mesh.triangles[t];
      out[t].normal = normalized(normals[tri[0]] + normals[tri[1]] + normals[tri[2]]);
      out[t].sigma_m = sigma_m(part, views[t], part.mesh.centroid(t));
      out[t].slack_m = slack, out[t].part = number;
    }
  });
}

/// An axis-aligned bounding box; world frame.
struct Bounds {
  Vec3f low, high;
};

Bounds bounds_of(const Mesh& mesh) {
  constexpr float kFar = std::numeric_limits<float>::max();
  Bounds out{{kFar, kFar, kFar}, {-kFar, -kFar, -kFar}};
  for (const Vec3f p : mesh.positions) {
    if (!is_finite(p)) continue;
    for (int i = 0; i < 3; ++i)
      out.low[i] = std::min(out.low[i], p[i]), out.high[i] = std::max(out.high[i], p[i]);
  }
  return out;
}

/// Frustum culling: false if all corners of a box lie outside of one plane of the frustum.
bool may_intersect(const RayGrid& grid, const Bounds& box) {
  if (box.low.x > box.high.x) return false;
  const Camera& c = grid.camera;
  const Mat3& axes = grid.T_world_camera.rotation;
  const Vec3d x = axes.column(0), y = axes.column(1), z = axes.column(2);
  const double left = (-1 - c.cx) / c.fx, right = (c.width - c.cx) / c.fx;
  const double top = (-1 - c.cy) / c.fy, bottom = (c.height - c.cy) / c.fy;
  const Vec3d inwards[] = {x - z * left, z * right - x, y - z * top, z * bottom - y, z};
  for (const Vec3d& n : inwards) {
    const Vec3d corner{n.x > 0 ? box.high.x : box.low.x, n.y > 0 ? box.high.y : box.low.y,
                       n.z > 0 ? box.high.z : box.low.z};
    if (dot(n, corner - grid.T_world_camera.translation) < 0) return false;
  }
  return true;
}

/// A camera's rays and the parts that they may meet.
struct RayBatch {
  RayGrid grid;
  std::vector<std::uint32_t> parts;  ///< ascending
};

std::vector<RayBatch> ray_batches(std::span<const kit::Part> parts, double voxel_m) {
  std::vector<Bounds> bounds(parts.size());
  parallel_for(parts.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) bounds[i] = bounds_of(parts[i].mesh);
  });
  std::vector<RayBatch> out;
  for (const kit::Part& part : parts)
    for (const SourceInfo& source : part.sources)
      for (const RayGrid& grid : camera_rays(source, voxel_m)) {
        RayBatch batch{grid, {}};
        for (std::uint32_t i = 0; i < parts.size(); ++i)
          if (!parts[i].mesh.empty() && may_intersect(grid, bounds[i])) batch.parts.push_back(i);
        if (batch.parts.size() > 1) out.push_back(std::move(batch));
      }
  return out;
}

// ------------------------------------------------------------ the reference: rays at the meshes

/// Casts rays with Embree.
class RayCaster {
 public:
  explicit RayCaster(const TriangleTable& field) : field_(field), scene_(meshes(field)) {}

  void cast(const RayGrid& grid, RayVotes& votes, RayVerdicts* verdicts) const {
    const Camera& camera = grid.camera;
    std::vector<std::vector<std::vector<RayVerdict>>> rows(verdicts ? camera.height : 0);
    parallel_for(camera.height, 4, [&](std::size_t begin, std::size_t end) {
      for (std::size_t y = begin; y < end; ++y) {
        if (verdicts) rows[y].resize(camera.width);
        cast_row(grid, static_cast<int>(y), votes, verdicts ? rows[y].data() : nullptr);
      }
    });
    if (!verdicts) return;
    *verdicts = {camera.width, camera.height, {0}, {}};
    for (const auto& row : rows)
      for (const auto& pixel : row) {
        verdicts->verdicts.insert(verdicts->verdicts.end(), pixel.begin(), pixel.end());
        verdicts->first.push_back(static_cast<std::uint32_t>(verdicts->verdicts.size()));
      }
  }

 private:
  static std::vector<const Mesh*> meshes(const TriangleTable& field) {
    std::vector<const Mesh*> out;
    for (const kit::Part& part : field.parts) out.push_back(&part.mesh);
    return out;
  }

  /// The intersections of a ray with front faces, nearest first.
  void meet(Vec3f origin, Vec3f ray, std::vector<kit::RayHit>& hits,
            std::vector<RayIntersection>& out) const {
    constexpr float kFar_m = 1e6f;
    scene_.all_hits(origin, ray, static_cast<float>(kit::kNearPlane_m), kFar_m, hits);
    out.clear();
    for (const kit::RayHit& hit : hits)
      if (dot(field_.parts[hit.mesh].mesh.area_normal(hit.triangle), ray) < 0)
        out.push_back({hit.distance, field_.first[hit.mesh] + hit.triangle});
    std::ranges::sort(out, {}, [](const RayIntersection& m) {
      return std::pair(-kit::comparable(1 / m.depth_m), m.triangle);
    });
  }

  void cast_row(const RayGrid& grid, int y, RayVotes& votes,
                std::vector<RayVerdict>* verdicts) const {
    const RayPencil rays(grid);
    std::vector<kit::RayHit> hits;
    std::vector<RayIntersection> on_ray;
    for (int x = 0; x < grid.camera.width; ++x) {
      meet(rays.origin, rays.at(x, y), hits, on_ray);
      decide(on_ray, field_, rays.at(x, y));
      for (const RayIntersection& m : on_ray) {
        std::atomic_ref(votes.hits[m.triangle]).fetch_add(1, std::memory_order_relaxed);
        if (m.lost) std::atomic_ref(votes.lost[m.triangle]).fetch_add(1, std::memory_order_relaxed);
        if (verdicts) verdicts[x].push_back({m.triangle, m.lost});
      }
      if (verdicts)
        std::sort(verdicts[x].begin(), verdicts[x].end(),
                  [](const RayVerdict& a, const RayVerdict& b) { return a.triangle < b.triangle; });
    }
  }

  const TriangleTable& field_;
  kit::RayScene scene_;
};

/// Casts all rays. `verdicts`, if given, receives the votes of each.
RayVotes cast_all(const TriangleTable& field, const OverlapConfig& config,
                  std::vector<RayVerdicts>* verdicts) {
  const std::vector<RayBatch> batches = ray_batches(field.parts, config.voxel_m);
  RayVotes votes{std::vector<std::uint32_t>(field.facing.size()),
                 std::vector<std::uint32_t>(field.facing.size())};
  if (verdicts) verdicts->resize(batches.size());
  const auto verdicts_of = [&](std::size_t i) { return verdicts ? &(*verdicts)[i] : nullptr; };
  if (batches.empty()) return votes;
  if (config.overlap == MergeConfig::Overlap::raster) {
    RasterVoter voter(field);
    for (std::size_t i = 0; i < batches.size(); ++i)
      voter.cast(batches[i].grid, batches[i].parts, votes, verdicts_of(i));
  } else {
    const RayCaster caster(field);
    for (std::size_t i = 0; i < batches.size(); ++i)
      caster.cast(batches[i].grid, votes, verdicts_of(i));
  }
  return votes;
}

}  // namespace

TriangleTable triangle_table(std::span<const kit::Part> parts, const OverlapConfig& config) {
  TriangleTable out{parts, {0}, {}, 0};
  for (const kit::Part& part : parts) {
    MR_ASSERT(!part.sources.empty());
    out.first.push_back(out.first.back() + static_cast<std::uint32_t>(part.mesh.triangles.size()));
  }
  out.facing.resize(out.first.back());
  parallel_for(parts.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      describe(parts[i], static_cast<std::uint32_t>(i), config, out.facing.data() + out.first[i]);
  });
  float sigma = 0, slack = 0;
  for (const TriangleSurface& f : out.facing)
    sigma = std::max(sigma, f.sigma_m), slack = std::max(slack, f.slack_m);
  out.reach_m = 4.001f * (2 * sigma + 2 * slack);  // rounding included
  return out;
}

std::vector<std::vector<std::uint8_t>> farther_triangles(std::span<const kit::Part> parts,
                                                         const OverlapConfig& config) {
  const TriangleTable field = triangle_table(parts, config);
  const RayVotes votes = cast_all(field, config, nullptr);
  std::vector<std::vector<std::uint8_t>> out(parts.size());
  for (std::size_t i = 0; i < parts.size(); ++i)
    for (std::uint32_t t = field.first[i]; t < field.first[i + 1]; ++t)
      out[i].push_back(2 * std::uint64_t{votes.lost[t]} > votes.hits[t]);
  return out;
}

std::vector<RayVerdicts> ray_verdicts(std::span<const kit::Part> parts,
                                      const OverlapConfig& config) {
  const TriangleTable field = triangle_table(parts, config);
  std::vector<RayVerdicts> out;
  cast_all(field, config, &out);
  return out;
}

}  // namespace mr::merge
