#include "mr/planner/grid_estimate.h"

#include "mr/fusion/voxel_block.h"
#include "mr/planner/region_tree.h"

namespace mr::planner {
namespace {

constexpr double kTriangleM2 = 0.0012;  // area per triangle, sensors not sampled: 10,000 on 12 m²

}  // namespace

GridEstimate estimate_grid(const Coverage& coverage, std::span<const SensorSample> samples,
                           const PlannedMerger& central) {
  GridEstimate out;
  double area_m2 = 0;
  bool known = true;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    area_m2 += samples[i].area_m2 > 0 ? samples[i].area_m2 : coverage.triangles[i] * kTriangleM2;
    out.reconstruct_ms += samples[i].reconstruct_ms;
    known = known && samples[i].reconstruct_ms > 0;
  }
  if (!known) out.reconstruct_ms = 0;
  if (central.triangles_in > 0)
    area_m2 *= central.triangles_out / central.triangles_in;  // overlapping surface counts once
  const double voxel_m = coverage.scene->voxel_m, side_m = voxel_m * fusion::VoxelBlock::kSide;
  // A plane in any direction crosses 1.5 cubes per side², and its band those beside it.
  const double per_m2 =
      (1.5 + 2 * coverage.scene->fusion.truncation_m / side_m) / (side_m * side_m);
  out.blocks = area_m2 * per_m2;
  out.memory_mb =
      1e-6 * out.blocks * (sizeof(fusion::VoxelBlock) + sizeof(fusion::VoxelBlock::Weights));
  constexpr double kDenseBytes = 8;  // distance, weight, colour
  const Vec3d size = vec_cast<double>(space_of(coverage).high - space_of(coverage).low) *
                     (coverage.scene->fusion.chunk_m / voxel_m);
  out.dense_memory_mb = 1e-6 * size.x * size.y * size.z * kDenseBytes;
  return out;
}

}  // namespace mr::planner
