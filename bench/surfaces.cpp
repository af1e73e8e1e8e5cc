#include "surfaces.h"

#include <cmath>

#include "bytes.h"
#include "mr/kit/topology.h"

namespace mr::bench {
namespace {

constexpr int kSamples = 200'000;
constexpr std::uint64_t kSeed = 1;

}  // namespace

Message to_message(const Mesh& mesh) {
  return {{"positions", binary(mesh.positions)}, {"triangles", binary(mesh.triangles)}};
}

Mesh mesh_from(const Message& message) {
  Mesh mesh;
  mesh.positions = array_from<Vec3f>(message.at("positions"));
  mesh.triangles = array_from<Triangle>(message.at("triangles"));
  return mesh;
}

Message surface_figures(const Mesh& mesh) {
  return {{"triangles", mesh.triangles.size()},
          {"vertices", mesh.positions.size()},
          {"area_m2", std::round(surface_area_m2(mesh) * 1e4) / 1e4},
          {"nonmanifold_edges", kit::count_nonmanifold_edges(mesh)}};
}

eval::SurfaceDistance distance(const Mesh& from, const Mesh& to) {
  return eval::surface_distance(from, to, kSamples, kSeed);
}

}  // namespace mr::bench
