#include "mr/merge/islands.h"

#include "mr/kit/topology.h"

namespace mr::merge {

Mesh remove_islands(const Mesh& mesh, double min_area_m2) {
  const kit::Components parts = kit::components(mesh);
  std::vector<std::uint8_t> keep(mesh.triangles.size());
  for (std::size_t t = 0; t < keep.size(); ++t)
    keep[t] = parts.area_m2[parts.of_triangle[t]] >= min_area_m2;
  return select_triangles(mesh, keep);
}

double island_area_m2(double voxel_m) { return 5 * (2 * voxel_m) * (2 * voxel_m); }

}  // namespace mr::merge
