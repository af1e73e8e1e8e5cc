#include "mr/merge/measured.h"

#include <algorithm>
#include <limits>

#include "mr/kit/topology.h"

namespace mr::merge {
namespace {

constexpr double kLeastCosine = 0.1;

double depth_at(const SourceInfo& source, Vec3d ray) {
  return source.depth_camera.model == CameraModel::pinhole
             ? std::max(dot(ray, source.T_world_depth.rotation.column(2)), 0.0)
             : length(ray);
}

float sigma_at(const SourceInfo& source, Vec3f spot) {
  const Vec3d ray = vec_cast<double>(spot) - source.T_world_depth.translation;
  return static_cast<float>(std::max(source.precision.sigma_m(depth_at(source, ray)), 1e-6));
}

float quality_at(const SourceInfo& source, Vec3f spot, Vec3f unit_normal) {
  const Vec3d ray = vec_cast<double>(spot) - source.T_world_depth.translation;
  const double cosine = -dot(normalized(ray), vec_cast<double>(unit_normal));
  return static_cast<float>(std::max(cosine, kLeastCosine)) / sigma_at(source, spot);
}

/// The source that measured each triangle: the only one, or the one whose view textures it.
std::vector<std::uint32_t> triangle_sources(const Part& part) {
  std::vector<std::uint32_t> out(part.mesh.triangles.size(),
                                 part.sources.size() == 1 ? 0 : Measured::kNoSource);
  if (part.sources.size() == 1) return out;
  for (const ViewRun& run : part.mesh.runs)
    for (std::uint32_t s = 0; s < part.sources.size(); ++s)
      if (part.sources[s].sensor == run.view) std::fill_n(out.begin() + run.first, run.count, s);
  return out;
}

/// Who measured each vertex: the source of one of its triangles.
std::vector<std::uint32_t> vertex_sources(const Mesh& mesh,
                                          const std::vector<std::uint32_t>& of_triangle) {
  std::vector<std::uint32_t> out(mesh.positions.size(), Measured::kNoSource);
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    for (const std::uint32_t v : mesh.triangles[t]) out[v] = std::min(out[v], of_triangle[t]);
  return out;
}

/// Calls visit(source) for the source that measured something, or for all where that is not known.
template <typename Visit>
void for_each_source(const Part& part, std::uint32_t source, Visit&& visit) {
  if (source != Measured::kNoSource) return visit(part.sources[source]);
  for (const SourceInfo& s : part.sources) visit(s);
}

}  // namespace

Measured measured(const Part& part, const OverlapConfig& config) {
  const Mesh& mesh = part.mesh;
  Measured out;
  out.slack_m = static_cast<float>(config.calibration_error_m) +
                std::min(part.error_m, static_cast<float>(config.voxel_m));
  out.source = triangle_sources(part);
  const std::vector<std::uint32_t> of_vertex = vertex_sources(mesh, out.source);
  const std::vector<Vec3f> normals = kit::vertex_normals(mesh);
  out.vertices.resize(mesh.positions.size());
  for (std::size_t v = 0; v < normals.size(); ++v) {
    out.vertices[v] = {mesh.positions[v], normals[v], 0};
    for_each_source(part, of_vertex[v], [&](const SourceInfo& s) {
      out.vertices[v].sigma_m = std::max(out.vertices[v].sigma_m, sigma_at(s, mesh.positions[v]));
    });
  }
  out.quality.assign(mesh.triangles.size(), std::numeric_limits<float>::max());
  for (std::size_t t = 0; t < out.quality.size(); ++t)
    for_each_source(part, out.source[t], [&](const SourceInfo& s) {
      const Vec3f normal = normalized(mesh.area_normal(t));
      out.quality[t] = std::min(out.quality[t], quality_at(s, mesh.centroid(t), normal));
    });
  return out;
}

}  // namespace mr::merge
