// A second opinion on decimation.
#include <gtest/gtest.h>
#include <meshoptimizer.h>

#include <cmath>

#include "mr/kit/raycast.h"
#include "mr/simplify/simplify.h"
#include "support/decimation.h"

namespace mr {
namespace {

Mesh by_meshoptimizer(const Mesh& mesh, std::size_t target) {
  std::vector<unsigned int> corners(mesh.triangles.size() * 3);
  corners.resize(meshopt_simplify(corners.data(), mesh.triangles.data()->data(), corners.size(),
                                  &mesh.positions.data()->x, mesh.positions.size(), sizeof(Vec3f),
                                  target * 3, 1, 0, nullptr));
  Mesh out{mesh.positions, {}, {}, {}};
  for (std::size_t i = 0; i < corners.size(); i += 3)
    out.triangles.push_back({corners[i], corners[i + 1], corners[i + 2]});
  return out;
}

/// Heights of `of` against those of `mesh`, at the vertices of `of`.
double rms_height_error_m(const Mesh& mesh, const Mesh& of) {
  const Mesh* meshes[] = {&mesh};
  const kit::RayScene rays(meshes);
  double sum = 0;
  int hits = 0;
  for (const Vec3f p : of.positions)
    if (const auto hit = rays.first_hit({p.x, p.y, 5}, {0, 0, -1}, 0, 10)) {
      const double error = 5 - hit->distance - p.z;
      sum += error * error, ++hits;
    }
  EXPECT_GT(hits, 0.95 * static_cast<double>(of.positions.size()));
  return std::sqrt(sum / hits);
}

TEST(Simplify, ErrsNoMoreThanMeshoptimizer) {
  const Mesh mesh = test::room_seen_from_above();
  for (const double ratio : {0.3, 0.1, 0.03}) {
    const auto small = simplify::simplify(mesh, {.triangles = simplify::triangles_at(mesh, ratio)});
    ASSERT_TRUE(small.ok());
    const Mesh reference = by_meshoptimizer(mesh, small->mesh.triangles.size());
    EXPECT_LE(rms_height_error_m(small->mesh, mesh), rms_height_error_m(reference, mesh)) << ratio;
  }
}

}  // namespace
}  // namespace mr
