#include "mr/node/surface_joiner.h"

#include <chrono>
#include <cmath>
#include <cstddef>
#include <span>
#include <string_view>

#include "mr/codec/mesh_codec.h"
#include "mr/kit/topology.h"
#include "mr/merge/merge_surfaces.h"
#include "mr/node/input_synchronizer.h"

namespace mr::node {
namespace {

/// Number of triangles of the merged surface at the inputs' triangle density. Decimation starts
/// from it, as cutting along overlaps adds many small triangles.
double triangles_sent(const std::vector<kit::Part>& parts, const Mesh& left) {
  double triangles = 0, area_m2 = 0;
  for (const kit::Part& part : parts)
    triangles += static_cast<double>(part.mesh.triangles.size()),
        area_m2 += surface_area_m2(part.mesh);
  return area_m2 > 0 ? triangles * surface_area_m2(left) / area_m2 : 0;
}

}  // namespace

merge::OverlapConfig overlap_config(const Scene& scene) {
  return {.owner = scene.merge.owner,
          .overlap = scene.merge.overlap,
          .voxel_m = scene.voxel_m,
          .calibration_error_m = scene.merge.calibration_error_m};
}

Mesh SurfaceJoiner::join(const Parts& parts, bool all, const std::function<void()>& on_cores_free) {
  const MergeConfig& config = scene_->merge;
  const bool has_budget = clock_ && merger_->budget_ms > 0;
  const auto now = [&] { return has_budget ? clock_() : TimePoint{}; };
  const TimePoint started = now();
  const auto spent_ms = [&] {
    return std::chrono::duration<double, std::milli>(now() - started).count();
  };
  merge::SurfacesConfig surfaces = merge::surfaces_config(overlap_config(*scene_));
  surfaces.overlap.is_piece = !all;
  if (config.gap_m > 0) surfaces.zipper.max_gap_m = config.gap_m;
  if (config.island_area_m2 > 0) surfaces.island_area_m2 = config.island_area_m2;
  double before_zipper_ms = 0, zipper_ms = 0;
  bool hurry = false;
  merge::MergeHooks hooks;
  hooks.step = [&](const char* step, const std::function<void()>& work) {
    trace_->time(step, work);
    if (step == std::string_view("zipper")) zipper_ms = spent_ms() - before_zipper_ms;
  };
  hooks.after_overlap = [&](std::span<const Mesh>, merge::ZipperConfig& zipper) {
    if (on_cores_free) on_cores_free();
    before_zipper_ms = spent_ms();
    hurry = has_budget && before_zipper_ms + zipper_ms_ > merger_->budget_ms;
    if (hurry) zipper.max_gap_m = 0;
  };
  const Mesh whole = merge::merge_surfaces(parts, surfaces, &quality_, hooks);
  hurried_ |= hurry;
  if (!hurry) zipper_ms_ = zipper_ms;
  return merger_->region ? inside(whole, *merger_->region, scene_->fusion.chunk_m) : whole;
}

Result<SurfaceJoiner::Surface> SurfaceJoiner::decimated(Mesh mesh, const Parts& parts,
                                                        const CubeErrors& errors,
                                                        const Decimation& decimation) {
  return trace_->time("simplify", [&]() -> Result<Surface> {
    Surface out{std::move(mesh), errors};
    if (!decimation.does_nothing()) {
      const double target = decimation.ratio * triangles_sent(parts, out.mesh);
      simplify::SimplifyOptions limits{.triangles = static_cast<std::size_t>(std::ceil(target))};
      if (decimation.error_m > 0) limits.error_m = static_cast<float>(decimation.error_m);
      auto small = simplifier_.run(out.mesh, limits);
      if (!small) return small.error();
      CubeErrors own;
      own.raise(small->mesh, small->errors_m, scene_->fusion.chunk_m);
      out = {std::move(small->mesh), node::decimated(errors, own)};
    }
    auto snapped = codec::snap_to_lattice(out.mesh, scene_->lattice);
    if (!snapped) return snapped.error();
    out.mesh = kit::without_nonmanifold_edges(*snapped);
    return out;
  });
}

void SurfaceJoiner::close_holes(const Parts& parts, Layer layer, Surface& surface) const {
  constexpr double kTolerance_steps = 2;
  trace_->time("holes", [&] {
    const merge::HolesConfig config{scene_->merge.fill_m, scene_->voxel_m, scene_->lattice,
                                    layer == Layer::moving};
    surface.guessed = merge::GuessedSurface(merge::close_holes(surface.mesh, parts, config),
                                            kTolerance_steps * scene_->lattice.step_m());
  });
}

}  // namespace mr::node
