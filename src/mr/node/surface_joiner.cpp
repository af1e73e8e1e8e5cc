#include "mr/node/surface_joiner.h"

#include <chrono>
#include <cmath>
#include <cstddef>

#include "mr/codec/mesh_codec.h"
#include "mr/kit/topology.h"
#include "mr/merge/islands.h"
#include "mr/merge/zipper.h"
#include "mr/node/gatherer.h"

namespace mr::node {
namespace {

/// How many triangles the children spent on the surface that stays. Cutting along overlaps adds
/// many small ones; decimation counts from here.
double triangles_sent(const std::vector<kit::Part>& parts, const std::vector<Mesh>& owned) {
  double sum = 0;
  for (std::size_t i = 0; i < parts.size(); ++i)
    if (!parts[i].mesh.empty())
      sum += static_cast<double>(parts[i].mesh.triangles.size()) * surface_area_m2(owned[i]) /
             surface_area_m2(parts[i].mesh);
  return sum;
}

}  // namespace

merge::OverlapConfig overlap_config(const Scene& scene) {
  return {.owner = scene.merge.owner,
          .overlap = scene.merge.overlap,
          .voxel_m = scene.voxel_m,
          .calibration_error_m = scene.merge.calibration_error_m};
}

Result<Mesh> on_lattice(const Mesh& mesh, const Scene& scene) {
  auto snapped = codec::snap_to_lattice(mesh, scene.lattice);
  if (!snapped) return snapped.error();
  return kit::without_nonmanifold_edges(*snapped);
}

Mesh SurfaceJoiner::join(const Parts& parts, bool all, const std::function<void()>& halfway) {
  const double voxel_m = scene_->voxel_m;
  const MergeConfig& config = scene_->merge;
  const auto started = std::chrono::steady_clock::now();
  const auto spent_ms = [&] {
    return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - started)
        .count();
  };
  quality_.freeze(!all);
  const std::vector<Mesh> owned = trace_->time(
      "overlap", [&] { return merge::remove_overlap(parts, overlap_config(*scene_), &quality_); });
  if (all) triangles_ = triangles_sent(parts, owned);
  if (halfway) halfway();
  const Mesh zipped = trace_->time("zipper", [&] {
    merge::ZipperConfig zipper = merge::zipper_config(voxel_m);
    if (config.gap_m > 0) zipper.max_gap_m = config.gap_m;
    const double before_ms = spent_ms();
    const bool hurry = merger_->budget_ms > 0 && before_ms + zipper_ms_ > merger_->budget_ms;
    hurried_ |= hurry;
    if (hurry) zipper.max_gap_m = 0;
    Mesh out = merge::zip(owned, zipper);
    if (!hurry) zipper_ms_ = spent_ms() - before_ms;
    return out;
  });
  const Mesh whole = trace_->time("islands", [&] {
    return merge::remove_islands(
        zipped, config.island_area_m2 > 0 ? config.island_area_m2 : merge::island_area_m2(voxel_m));
  });
  return merger_->region ? inside(whole, *merger_->region, scene_->fusion.chunk_m) : whole;
}

Result<Mesh> SurfaceJoiner::decimated(const Mesh& mesh, float& error_m) {
  return trace_->time("simplify", [&]() -> Result<Mesh> {
    auto snapped = codec::snap_to_lattice(mesh, scene_->lattice);
    if (!snapped || !is_root_ || scene_->merge.simplify.ratio >= 1) return snapped;
    const double target = scene_->merge.simplify.ratio * triangles_;
    const auto small =
        simplifier_.run(*snapped, {.triangles = static_cast<std::size_t>(std::ceil(target))});
    if (!small) return small.error();
    error_m += small->error_m;
    return codec::snap_to_lattice(small->mesh, scene_->lattice);
  });
}

}  // namespace mr::node
