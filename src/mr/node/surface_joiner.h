#pragma once

#include <functional>
#include <utility>
#include <vector>

#include "mr/core/coding_plan.h"
#include "mr/core/layer.h"
#include "mr/core/mesh.h"
#include "mr/core/result.h"
#include "mr/core/trace.h"
#include "mr/kit/part.h"
#include "mr/merge/holes/guessed_surface.h"
#include "mr/merge/overlap/overlap.h"
#include "mr/merge/overlap/quality_grid.h"
#include "mr/node/chunk_grid.h"
#include "mr/node/node_clock.h"
#include "mr/scene/scene.h"
#include "mr/simplify/simplify.h"

namespace mr::node {

/// The scene's configuration of overlap removal.
merge::OverlapConfig overlap_config(const Scene& scene);

/// Merges the surfaces of a merger's inputs into one (paper 3.2), and keeps state that speeds up
/// the next call. One object per layer; not thread-safe.
class SurfaceJoiner {
 public:
  using Parts = std::vector<kit::Part>;

  /// The scene, the merger and the trace must outlive this. `clock`: for merger.budget_ms; empty:
  /// the budget is ignored, so that the same input gives the same bytes.
  SurfaceJoiner(const Scene& scene, const MergerConfig& merger, Clock clock, Trace& trace)
      : scene_(&scene), merger_(&merger), clock_(std::move(clock)), trace_(&trace) {}

  /// Removes overlap, closes the seams (zipper) and removes islands. `all`: the parts cover the
  /// whole scene, not a piece of it. `on_cores_free`, if set, is called after overlap removal, the
  /// last stage that uses every core.
  Mesh join(const Parts& parts, bool all, const std::function<void()>& on_cores_free = {});

  struct Surface {
    Mesh mesh;  ///< on the lattice
    CubeErrors errors;
    merge::GuessedSurface guessed{};  ///< of the mesh
  };
  /// Decimates a merged mesh, then snaps it to the lattice and removes edges of more than two
  /// triangles: nothing moves its vertices any more. A ratio refers to the triangle density of
  /// `parts`, so triangles added by cuts along overlaps do not count. `errors`: of the parts.
  Result<Surface> decimated(Mesh mesh, const Parts& parts, const CubeErrors& errors,
                            const Decimation& decimation);

  /// Closes small holes of what decimated() gave (merge.fill_m). At the root alone: below it,
  /// another merger's sensors may have seen what is missing.
  void close_holes(const Parts& parts, Layer layer, Surface& surface) const;

  /// Whether gaps were left open because of merger.budget_ms since the last call.
  bool take_hurried() { return std::exchange(hurried_, false); }

 private:
  const Scene* scene_;
  const MergerConfig* merger_;
  Clock clock_;
  Trace* trace_;
  merge::QualityMemory quality_;
  simplify::Simplifier simplifier_;
  double zipper_ms_ = 0;  ///< duration of the last complete zipper stage
  bool hurried_ = false;
};

}  // namespace mr::node
