#include "mr/node/chunk_grid.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>

namespace mr::node {

Vec3i cube_of(Vec3d p, double chunk_m) {
  const auto cell = [&](double v) { return static_cast<std::int32_t>(std::floor(v / chunk_m)); };
  return {cell(p.x), cell(p.y), cell(p.z)};
}

std::map<Vec3i, Mesh> split_by_cube(const Mesh& mesh, double chunk_m) {
  std::map<Vec3i, std::vector<std::uint32_t>> cubes;  // their triangles
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t)
    cubes[cube_of(vec_cast<double>(mesh.centroid(t)), chunk_m)].push_back(t);
  const std::vector<SensorId> sensors = triangle_sensors(mesh);
  const std::vector<ViewId> views = triangle_views(mesh);
  std::vector<std::uint32_t> index(mesh.positions.size());
  std::vector<const Mesh*> index_in(mesh.positions.size(), nullptr);  // the piece that it is for
  std::map<Vec3i, Mesh> out;
  for (const auto& [cube, triangles] : cubes) {
    Mesh& piece = out[cube];
    std::vector<SensorId> piece_sensors;
    std::vector<ViewId> piece_views;
    for (const std::uint32_t t : triangles) {
      Triangle& triangle = piece.triangles.emplace_back(mesh.triangles[t]);
      for (std::uint32_t& v : triangle) {
        if (index_in[v] != &piece) {
          index_in[v] = &piece, index[v] = static_cast<std::uint32_t>(piece.positions.size());
          piece.positions.push_back(mesh.positions[v]);
        }
        v = index[v];
      }
      piece_sensors.push_back(sensors[t]), piece_views.push_back(views[t]);
    }
    if (!mesh.sensors.empty()) set_triangle_sensors(piece, piece_sensors);
    if (!mesh.views.empty()) set_triangle_views(piece, piece_views);
  }
  return out;
}

void CubeErrors::raise(Vec3i cube, float error_m) {
  float& known = errors_m_.try_emplace(cube, 0.0f).first->second;
  known = std::max(known, error_m);
  most_m_ = std::max(most_m_, error_m);
}

void CubeErrors::raise(const CubeErrors& others) {
  for (const auto& [cube, error_m] : others.errors_m_) raise(cube, error_m);
}

void CubeErrors::raise(const Mesh& mesh, const std::vector<float>& of_vertices_m, double chunk_m) {
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const auto& [a, b, c] = mesh.triangles[t];
    raise(cube_of(vec_cast<double>(mesh.centroid(t)), chunk_m),
          std::max({of_vertices_m[a], of_vertices_m[b], of_vertices_m[c]}));
  }
}

float CubeErrors::at(Vec3i cube) const {
  const auto known = errors_m_.find(cube);
  return known == errors_m_.end() ? around(cube) : known->second;
}

float CubeErrors::around(Vec3i cube) const {
  std::optional<float> most;
  for (int x = -1; x <= 1; ++x)
    for (int y = -1; y <= 1; ++y)
      for (int z = -1; z <= 1; ++z)
        if (const auto known = errors_m_.find(cube + Vec3i{x, y, z}); known != errors_m_.end())
          most = std::max(most.value_or(0), known->second);
  return most.value_or(most_m_);
}

CubeErrors decimated(const CubeErrors& before, const CubeErrors& by_decimation) {
  CubeErrors out;
  for (const auto& [cube, error_m] : by_decimation.errors_m_)
    out.raise(cube, before.around(cube) + error_m);
  return out;
}

}  // namespace mr::node
