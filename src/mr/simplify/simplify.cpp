#include "mr/simplify/simplify.h"

#include <meshoptimizer.h>

#include <vector>

#include "mr/core/assert.h"

namespace mr::simplify {

Simplified simplify(const Mesh& mesh, double ratio) {
  MR_ASSERT(ratio > 0 && ratio <= 1);
  Simplified out;
  out.mesh = mesh;
  out.mesh.runs.clear();
  if (ratio == 1 || mesh.empty()) return out;

  const auto* indices = reinterpret_cast<const unsigned int*>(mesh.triangles.data());
  const std::size_t index_count = mesh.triangles.size() * 3;
  const std::size_t target = static_cast<std::size_t>(static_cast<double>(mesh.triangles.size()) * ratio) * 3;
  const float* positions = &mesh.positions.data()->x;
  std::vector<unsigned int> result(index_count);
  float relative_error = 0;
  constexpr float kNoErrorLimit = 1.0f;  // the ratio decides
  const std::size_t count = meshopt_simplify(result.data(), indices, index_count, positions,
                                             mesh.positions.size(), sizeof(Vec3f), target,
                                             kNoErrorLimit, 0, &relative_error);
  out.error_m = relative_error * meshopt_simplifyScale(positions, mesh.positions.size(), sizeof(Vec3f));
  out.mesh.triangles.resize(count / 3);
  for (std::size_t i = 0; i < count; ++i) out.mesh.triangles[i / 3][i % 3] = result[i];
  out.mesh = select_triangles(out.mesh, std::vector<std::uint8_t>(count / 3, 1));
  return out;
}

}  // namespace mr::simplify
