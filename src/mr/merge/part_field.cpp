#include "mr/merge/part_field.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "mr/kit/topology.h"

namespace mr::merge {
namespace {

constexpr int kNormalRounds = 2;      // sensor noise must not decide who owns a spot
constexpr int kQualityRounds = 6;     // nor what decimation left of it
constexpr double kTaper_voxels = 4;   // width of the strip along borders
constexpr float kLeastTaper = 0.25f;  // at the border itself
constexpr double kLeastCosine = 0.1;

/// Sums of what surrounds each vertex, `rounds` times over: normals by area at first.
std::vector<Vec3f> smooth_normals(const Mesh& mesh, int rounds) {
  std::vector<Vec3f> normals(mesh.positions.size()), sums;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const Vec3f n = mesh.area_normal(t);
    for (const std::uint32_t v : mesh.triangles[t]) normals[v] += n;
  }
  for (int i = 0; i < rounds; ++i) {
    sums.assign(normals.size(), {});
    for (const auto& [a, b, c] : mesh.triangles) {
      const Vec3f n = normals[a] + normals[b] + normals[c];
      sums[a] += n, sums[b] += n, sums[c] += n;
    }
    normals.swap(sums);
  }
  for (Vec3f& n : normals) n = normalized(n);
  return normals;
}

/// Distance to the nearest border along edges, up to `most_m`.
std::vector<float> border_distances(const Mesh& mesh, float most_m) {
  std::vector<float> out(mesh.positions.size());
  const std::vector<std::uint8_t> border = kit::border_vertices(mesh);
  for (std::size_t v = 0; v < out.size(); ++v) out[v] = border[v] ? 0 : most_m;
  const auto relax = [&](const Triangle& t) {
    const float least = std::min({out[t[0]], out[t[1]], out[t[2]]});
    if (least >= most_m) return;
    for (int i = 0; i < 3; ++i) {
      float &a = out[t[i]], &b = out[t[(i + 1) % 3]];
      if (a == b) continue;
      const float edge = length(mesh.positions[t[i]] - mesh.positions[t[(i + 1) % 3]]);
      a = std::min(a, b + edge), b = std::min(b, a + edge);
    }
  };
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) relax(mesh.triangles[t]);
  for (std::size_t t = mesh.triangles.size(); t-- > 0;) relax(mesh.triangles[t]);
  return out;
}

/// Averages over the neighbours, `rounds` times.
void smooth(const Mesh& mesh, std::vector<float>& values, int rounds) {
  std::vector<float> count(values.size(), 1), sums;
  for (const Triangle& t : mesh.triangles)
    for (const std::uint32_t v : t) count[v] += 3;
  for (float& c : count) c = 1 / c;
  for (int i = 0; i < rounds; ++i) {
    sums = values;
    for (const auto& [a, b, c] : mesh.triangles) {
      const float sum = values[a] + values[b] + values[c];
      sums[a] += sum, sums[b] += sum, sums[c] += sum;
    }
    for (std::size_t v = 0; v < values.size(); ++v) values[v] = sums[v] * count[v];
  }
}

struct Measured {
  float sigma_m, quality;
};

/// A spot as measured by a source.
Measured measure(const SourceInfo& source, Vec3f spot, Vec3f normal) {
  const Vec3d ray = vec_cast<double>(spot) - source.T_world_depth.translation;
  const double depth = source.depth_camera.model == CameraModel::pinhole
                           ? std::max(dot(ray, source.T_world_depth.rotation.column(2)), 0.0)
                           : length(ray);
  const double cosine = std::max(-dot(normalized(ray), vec_cast<double>(normal)), kLeastCosine);
  const double sigma = std::max(source.precision.sigma_m(depth), 1e-6);
  return {static_cast<float>(sigma), static_cast<float>(cosine / sigma)};
}

/// The source that measured each triangle: the only one, or the one whose view textures it.
std::vector<std::uint32_t> triangle_sources(const Part& part) {
  std::vector<std::uint32_t> out(part.mesh.triangles.size(),
                                 part.sources.size() == 1 ? 0 : PartField::kNoSource);
  if (part.sources.size() == 1) return out;
  for (const ViewRun& run : part.mesh.runs)
    for (std::uint32_t s = 0; s < part.sources.size(); ++s)
      if (part.sources[s].sensor == run.view) std::fill_n(out.begin() + run.first, run.count, s);
  return out;
}

/// Who measured each vertex: the source of one of its triangles.
std::vector<std::uint32_t> vertex_sources(const Mesh& mesh,
                                          const std::vector<std::uint32_t>& of_triangle) {
  std::vector<std::uint32_t> out(mesh.positions.size(), PartField::kNoSource);
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    for (const std::uint32_t v : mesh.triangles[t]) out[v] = std::min(out[v], of_triangle[t]);
  return out;
}

/// A spot as measured by a source, or by the worst where that is not known.
Measured measure(const Part& part, std::uint32_t source, Vec3f spot, Vec3f normal) {
  if (source != PartField::kNoSource) return measure(part.sources[source], spot, normal);
  Measured worst{0, std::numeric_limits<float>::max()};
  for (const SourceInfo& s : part.sources) {
    const Measured m = measure(s, spot, normal);
    worst = {std::max(worst.sigma_m, m.sigma_m), std::min(worst.quality, m.quality)};
  }
  return worst;
}

}  // namespace

PartField part_field(const Part& part, const OverlapConfig& config) {
  const Mesh& mesh = part.mesh;
  PartField out;
  out.slack_m = static_cast<float>(config.calibration_error_m) +
                std::min(part.error_m, static_cast<float>(config.voxel_m));
  out.source = triangle_sources(part);
  const std::vector<std::uint32_t> measured_by = vertex_sources(mesh, out.source);
  const auto taper_m = static_cast<float>(kTaper_voxels * config.voxel_m);
  const std::vector<float> to_border = border_distances(mesh, taper_m);
  const std::vector<Vec3f> normals = smooth_normals(mesh, kNormalRounds);
  std::vector<float> quality(mesh.positions.size());
  out.vertices.resize(quality.size());
  for (std::size_t v = 0; v < quality.size(); ++v) {
    const Vec3f p = mesh.positions[v];
    const Measured m = measure(part, measured_by[v], p, normals[v]);
    out.vertices[v] = {p, 0, normals[v], m.sigma_m};
    quality[v] = m.quality;
    out.box.add(p);
  }
  smooth(mesh, quality, kQualityRounds);
  for (std::size_t v = 0; v < quality.size(); ++v)
    out.vertices[v].quality = quality[v] * std::max(to_border[v] / taper_m, kLeastTaper);
  return out;
}

}  // namespace mr::merge
