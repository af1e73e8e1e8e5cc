#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <numeric>
#include <random>
#include <set>
#include <span>
#include <utility>
#include <vector>

#include "mr/core/mesh.h"
#include "mr/kit/raycast.h"
#include "mr/kit/topology.h"
#include "support/meshes.h"

/// Surfaces to decimate, and what to ask of what is left.
namespace mr::test {

/// Height of gentle hills.
inline float hills_m(float x, float y) {
  return 0.2f * std::sin(2 * x) * std::cos(1.5f * y) + 0.05f * std::sin(5 * x + 3 * y);
}

/// Hills over [0, nx cell_m] x [0, ny cell_m], with noise along z.
inline Mesh hills(int nx, int ny, float cell_m, float noise_m, unsigned seed = 1) {
  const Vec3f x{cell_m * static_cast<float>(nx), 0, 0}, y{0, cell_m * static_cast<float>(ny), 0};
  Mesh mesh = grid({}, x, y, nx, ny, noise_m, seed);
  for (Vec3f& p : mesh.positions) p.z += hills_m(p.x, p.y);
  return mesh;
}

/// Heights over [0, 4] x [0, 3] m as a depth camera sees a room: boxes on a floor, noise.
inline Mesh room_seen_from_above() {
  Mesh mesh = grid({}, {4, 0, 0}, {0, 3, 0}, 160, 120, 0.004f, 3);
  for (Vec3f& p : mesh.positions) {
    if (p.x > 0.5f && p.x < 1.6f && p.y > 0.7f && p.y < 2.1f) p.z += 0.45f;
    if (p.x > 2.4f && p.y > 1.0f && p.y < 1.8f) p.z += 0.25f;
    p.z += 0.05f * std::sin(3 * p.x) * std::cos(2 * p.y);
  }
  return mesh;
}

/// The same mesh with its vertices numbered at random.
inline Mesh with_shuffled_vertices(const Mesh& mesh, unsigned seed) {
  std::vector<std::uint32_t> number(mesh.positions.size());
  std::iota(number.begin(), number.end(), 0u);
  std::shuffle(number.begin(), number.end(), std::mt19937(seed));
  Mesh out = mesh;
  for (std::size_t v = 0; v < number.size(); ++v) out.positions[number[v]] = mesh.positions[v];
  for (Triangle& t : out.triangles)
    for (std::uint32_t& v : t) v = number[v];
  return out;
}

inline double rms(const std::vector<double>& values) {
  double sum = 0;
  for (const double v : values) sum += v * v;
  return values.empty() ? 0 : std::sqrt(sum / static_cast<double>(values.size()));
}

/// [n] How far each point lies from the mesh, in metres.
inline std::vector<double> distances_m(std::span<const Vec3f> points, const Mesh& mesh) {
  const Mesh* meshes[] = {&mesh};
  const kit::RayScene scene(meshes);
  std::vector<double> out;
  for (const Vec3f p : points) out.push_back(scene.nearest(p)->distance_m);
  return out;
}

/// Points of the surface: all vertices and centroids.
inline std::vector<Vec3f> samples(const Mesh& mesh) {
  std::vector<Vec3f> out = mesh.positions;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) out.push_back(mesh.centroid(t));
  return out;
}

/// RMS distance both ways.
inline double two_sided_rms_m(const Mesh& a, const Mesh& b) {
  return std::max(rms(distances_m(samples(a), b)), rms(distances_m(samples(b), a)));
}

/// 1 of an equilateral triangle, 0 of a degenerate one.
inline float quality(const Mesh& mesh, std::size_t t) {
  const Vec3f a = mesh.corner(t, 0), b = mesh.corner(t, 1), c = mesh.corner(t, 2);
  const float edges = dot(b - a, b - a) + dot(c - b, c - b) + dot(a - c, a - c);
  return edges > 0 ? 2 * std::sqrt(3.0f) * length(mesh.area_normal(t)) / edges : 0;
}
inline float worst_quality(const Mesh& mesh) {
  float worst = 1;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) worst = std::min(worst, quality(mesh, t));
  return worst;
}

using Edge = std::pair<std::uint32_t, std::uint32_t>;

/// Each edge, lower vertex first, and how many triangles it has.
inline std::map<Edge, int> edges_of(const Mesh& mesh) {
  std::map<Edge, int> out;
  for (const Triangle& t : mesh.triangles)
    for (int i = 0; i < 3; ++i) ++out[std::minmax(t[i], t[(i + 1) % 3])];
  return out;
}

/// Vertices in use, less edges, plus triangles.
inline std::ptrdiff_t euler_characteristic(const Mesh& mesh) {
  std::set<std::uint32_t> used;
  for (const Triangle& t : mesh.triangles) used.insert(t.begin(), t.end());
  return std::ssize(used) - std::ssize(edges_of(mesh)) + std::ssize(mesh.triangles);
}

/// Closed lines of edges with one triangle: the outer border and each hole.
inline std::size_t count_border_loops(const Mesh& mesh) {
  std::map<std::uint32_t, std::uint32_t> parent;
  const auto root = [&](std::uint32_t v) {
    parent.try_emplace(v, v);
    while (parent[v] != v) v = parent[v];
    return v;
  };
  for (const auto& [edge, uses] : edges_of(mesh))
    if (uses == 1) {
      const std::uint32_t a = root(edge.first), b = root(edge.second);
      parent[a] = b;
    }
  std::size_t loops = 0;
  for (const auto& [v, up] : parent) loops += v == up;
  return loops;
}

/// Area by sensor.
inline std::map<SensorId, double> sensor_areas_m2(const Mesh& mesh) {
  std::map<SensorId, double> out;
  const std::vector<SensorId> sensors = triangle_sensors(mesh);
  for (std::size_t t = 0; t < sensors.size(); ++t)
    out[sensors[t]] += length(mesh.area_normal(t)) / 2;
  return out;
}

/// Whether the runs are sorted by sensor and cover the triangles.
inline bool are_runs_good(const Mesh& mesh) {
  std::size_t covered = 0;
  for (std::size_t r = 0; r < mesh.sensors.size(); ++r) {
    if (mesh.sensors[r].first != covered || mesh.sensors[r].count == 0) return false;
    if (r > 0 && mesh.sensors[r - 1].id >= mesh.sensors[r].id) return false;
    covered += mesh.sensors[r].count;
  }
  return mesh.sensors.empty() || covered == mesh.triangles.size();
}

/// Every position finite, every triangle with three vertices that there are.
inline bool is_sound(const Mesh& mesh) {
  const auto is_vertex = [&](std::uint32_t v) { return v < mesh.positions.size(); };
  return std::all_of(mesh.positions.begin(), mesh.positions.end(), is_finite<float>) &&
         std::all_of(mesh.triangles.begin(), mesh.triangles.end(), [&](const Triangle& t) {
           return t[0] != t[1] && t[1] != t[2] && t[2] != t[0] &&
                  std::all_of(t.begin(), t.end(), is_vertex);
         });
}

/// [T] A number for the cube of side edge_m in which each triangle's centroid lies.
inline std::vector<std::uint32_t> chunks_by_cube(const Mesh& mesh, float edge_m) {
  std::map<Vec3i, std::uint32_t> known;
  std::vector<std::uint32_t> out;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const Vec3f c = mesh.centroid(t) / edge_m;
    const Vec3i cube =
        vec_cast<std::int32_t>(Vec3f{std::floor(c.x), std::floor(c.y), std::floor(c.z)});
    // The cube alone decides, so that two versions of a scene number it alike.
    out.push_back(
        static_cast<std::uint32_t>(((cube.z + 512) * 1024 + cube.y + 512) * 1024 + cube.x + 512));
  }
  return out;
}

}  // namespace mr::test
