#include "mr/simplify/simplify.h"

#include <meshoptimizer.h>

#include <cmath>
#include <vector>

#include "mr/core/assert.h"

namespace mr::simplify {

Simplified simplify_by_ratio(const Mesh& mesh, double ratio) {
  MR_ASSERT(ratio > 0 && ratio <= 1);
  return simplify(mesh, static_cast<std::size_t>(
                            std::ceil(static_cast<double>(mesh.triangles.size()) * ratio)));
}

Simplified simplify(const Mesh& mesh, std::size_t target_triangles) {
  Simplified out;
  out.mesh = mesh;
  out.mesh.runs.clear();
  if (target_triangles >= mesh.triangles.size()) return out;

  const auto* indices = reinterpret_cast<const unsigned int*>(mesh.triangles.data());
  const std::size_t index_count = mesh.triangles.size() * 3;
  const float* positions = &mesh.positions.data()->x;
  std::vector<unsigned int> result(index_count);
  float relative_error = 0;
  constexpr float kNoErrorLimit = 1.0f;  // the target decides
  const std::size_t count =
      meshopt_simplify(result.data(), indices, index_count, positions, mesh.positions.size(),
                       sizeof(Vec3f), target_triangles * 3, kNoErrorLimit, 0, &relative_error);
  out.error_m =
      relative_error * meshopt_simplifyScale(positions, mesh.positions.size(), sizeof(Vec3f));
  out.mesh.triangles.resize(count / 3);
  for (std::size_t i = 0; i < count; ++i) out.mesh.triangles[i / 3][i % 3] = result[i];
  out.mesh = select_triangles(out.mesh, std::vector<std::uint8_t>(count / 3, 1));
  return out;
}

}  // namespace mr::simplify
