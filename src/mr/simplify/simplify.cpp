#include "mr/simplify/simplify.h"

#include <cmath>

#include "mr/core/assert.h"
#include "mr/simplify/collapser.h"

namespace mr::simplify {

Simplified simplify_by_ratio(const Mesh& mesh, double ratio) {
  MR_ASSERT(ratio > 0 && ratio <= 1);
  return simplify(mesh, static_cast<std::size_t>(
                            std::ceil(static_cast<double>(mesh.triangles.size()) * ratio)));
}

Simplified simplify(const Mesh& mesh, std::size_t target_triangles) {
  if (target_triangles >= mesh.triangles.size()) return {{mesh.positions, mesh.triangles, {}}, 0};
  Collapser collapser(mesh);
  collapser.reduce_to(target_triangles);
  collapser.relax();
  return {collapser.mesh(), collapser.error_m()};
}

}  // namespace mr::simplify
