#pragma once

#include <functional>
#include <utility>
#include <vector>

#include "mr/core/coding_plan.h"
#include "mr/core/mesh.h"
#include "mr/core/result.h"
#include "mr/core/trace.h"
#include "mr/kit/part.h"
#include "mr/merge/overlap/overlap.h"
#include "mr/merge/overlap/quality_grid.h"
#include "mr/node/node_clock.h"
#include "mr/scene/scene.h"
#include "mr/simplify/simplify.h"

namespace mr::node {

/// What a scene asks of the removal of overlap.
merge::OverlapConfig overlap_config(const Scene& scene);

/// A mesh on the scene's lattice, without edges of more than two triangles.
Result<Mesh> on_lattice(const Mesh& mesh, const Scene& scene);

/// Makes one surface of all that a merger's inputs have (paper 3.2), and remembers what the next
/// time can use. One for each layer; not thread-safe.
class SurfaceJoiner {
 public:
  using Parts = std::vector<kit::Part>;

  /// The scene, the merger and the trace must outlive this. `clock`: of merger.budget_ms; without
  /// one there is no hurry, so that the same input gives the same bytes.
  SurfaceJoiner(const Scene& scene, const MergerConfig& merger, Clock clock, Trace& trace)
      : scene_(&scene), merger_(&merger), clock_(std::move(clock)), trace_(&trace) {}

  /// Without overlap, seams closed, without islands. `all`: of the whole scene, not of a piece.
  /// `halfway`, where there is one, is called when the stages that use every core are over.
  Mesh join(const Parts& parts, bool all, const std::function<void()>& halfway = {});

  /// On the lattice. A ratio counts from the triangles that the inputs spent on what is left of
  /// `parts`: cuts along overlaps do not count. `error_m` grows by what decimation costs.
  Result<Mesh> decimated(const Mesh& mesh, const Parts& parts, const Decimation& decimation,
                         float& error_m);

  /// Whether some gaps were left open for merger.budget_ms since this was last asked.
  bool take_hurried() { return std::exchange(hurried_, false); }

 private:
  const Scene* scene_;
  const MergerConfig* merger_;
  Clock clock_;
  Trace* trace_;
  merge::QualityMemory quality_;
  simplify::Simplifier simplifier_;
  double zipper_ms_ = 0;  ///< what closing all gaps took last
  bool hurried_ = false;
};

}  // namespace mr::node
