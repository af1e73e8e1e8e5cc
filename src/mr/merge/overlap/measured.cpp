#include "mr/merge/overlap/measured.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "mr/core/parallel.h"
#include "mr/kit/topology.h"

namespace mr::merge {
namespace {

constexpr double kLeastCosine = 0.1;

double depth_at(const SourceInfo& source, Vec3d ray) {
  return source.depth_camera.model == CameraModel::pinhole
             ? std::max(dot(ray, source.T_world_depth.rotation.column(2)), 0.0)
             : length(ray);
}

float sigma_at(const SourceInfo& source, Vec3f point) {
  const Vec3d ray = vec_cast<double>(point) - source.T_world_depth.translation;
  return static_cast<float>(std::max(source.precision.sigma_m(depth_at(source, ray)), 1e-6));
}

float quality_at(const SourceInfo& source, Vec3f point, Vec3f unit_normal) {
  const Vec3d ray = vec_cast<double>(point) - source.T_world_depth.translation;
  const double cosine = -dot(normalized(ray), vec_cast<double>(unit_normal));
  return static_cast<float>(std::max(cosine, kLeastCosine)) / sigma_at(source, point);
}

/// The source of each triangle's view, or the only source.
std::vector<std::uint32_t> triangle_labels(const kit::Part& part) {
  std::vector<std::uint32_t> out(part.mesh.triangles.size(),
                                 part.sources.size() == 1 ? 0 : Measured::kNoSource);
  if (part.sources.size() == 1) return out;
  for (const SensorRun& run : part.mesh.sensors)
    for (std::uint32_t s = 0; s < part.sources.size(); ++s)
      if (part.sources[s].sensor == run.id) std::fill_n(out.begin() + run.first, run.count, s);
  return out;
}

/// Finds the source that measured a triangle, and its quality.
void measure(const kit::Part& part, std::size_t t, Measured& out) {
  const Vec3f normal = normalized(part.mesh.area_normal(t)), middle = part.mesh.centroid(t);
  const bool known = out.label[t] != Measured::kNoSource;
  const std::uint32_t first = known ? out.label[t] : 0,
                      end = known ? first + 1 : static_cast<std::uint32_t>(part.sources.size());
  out.quality[t] = std::numeric_limits<float>::max();
  for (std::uint32_t s = first; s < end; ++s)
    if (const float q = quality_at(part.sources[s], middle, normal); q < out.quality[t])
      out.quality[t] = q, out.source[t] = s;
}

/// Upper bound of a source's depth noise on a mesh, as noise grows with distance.
float largest_sigma(const SourceInfo& source, const Mesh& mesh) {
  const auto eye = vec_cast<float>(source.T_world_depth.translation);
  float farthest = 0;  // squared
  for (const Vec3f p : mesh.positions) farthest = std::max(farthest, dot(p - eye, p - eye));
  return static_cast<float>(source.precision.sigma_m(std::sqrt(farthest)));
}

}  // namespace

float slack_m(const kit::Part& part, const OverlapConfig& config) {
  return static_cast<float>(config.calibration_error_m) +
         std::min(part.error_m, static_cast<float>(config.voxel_m)) / 2;
}

Measured measured(const kit::Part& part, const OverlapConfig& config) {
  const Mesh& mesh = part.mesh;
  Measured out;
  out.slack_m = slack_m(part, config);
  out.label = triangle_labels(part);
  out.source.resize(mesh.triangles.size());
  out.quality.resize(mesh.triangles.size());
  out.plane.resize(mesh.triangles.size());
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) measure(part, t, out);
  const std::vector<Vec3f> normals = kit::vertex_normals(mesh);
  out.vertices.resize(mesh.positions.size());
  for (std::size_t t = mesh.triangles.size(); t-- > 0;)  // the first triangle decides
    for (const std::uint32_t v : mesh.triangles[t]) out.vertices[v].source = out.source[t];
  for (std::size_t v = 0; v < normals.size(); ++v) {
    const std::uint32_t source = out.vertices[v].source;
    const float sigma_m = sigma_at(part.sources[source], mesh.positions[v]);
    out.vertices[v] = {mesh.positions[v], normals[v], sigma_m, source};
  }
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const auto& [a, b, c] = mesh.triangles[t];
    const Vec3f normal = normalized(normals[a] + normals[b] + normals[c]);
    out.plane[t] = {normal, dot(normal, mesh.centroid(t))};
  }
  return out;
}

double farthest_alike_m(std::span<const kit::Part> parts, const OverlapConfig& config) {
  std::vector<float> sigma_m(parts.size(), 0.0f);
  parallel_for(parts.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      for (const SourceInfo& source : parts[i].sources)
        sigma_m[i] = std::max(sigma_m[i], largest_sigma(source, parts[i].mesh));
  });
  float sigma = 0, slack = 0;
  for (std::size_t i = 0; i < parts.size(); ++i)
    sigma = std::max(sigma, sigma_m[i]), slack = std::max(slack, slack_m(parts[i], config));
  return 2.0 * (sigma + slack);
}

}  // namespace mr::merge
