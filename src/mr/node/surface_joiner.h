#pragma once

#include <functional>
#include <utility>
#include <vector>

#include "mr/core/mesh.h"
#include "mr/core/result.h"
#include "mr/core/scene.h"
#include "mr/core/trace.h"
#include "mr/kit/part.h"
#include "mr/merge/overlap/overlap.h"
#include "mr/merge/overlap/quality_grid.h"
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

  /// The scene, the merger and the trace must outlive this.
  SurfaceJoiner(const Scene& scene, const MergerConfig& merger, bool is_root, Trace& trace)
      : scene_(&scene), merger_(&merger), is_root_(is_root), trace_(&trace) {}

  /// Without overlap, seams closed, without islands. `all`: of the whole scene, not of a piece.
  /// `halfway`, where there is one, is called when the stages that use every core are over.
  Mesh join(const Parts& parts, bool all, const std::function<void()>& halfway = {});

  /// On the lattice. Only the root decimates, and only where the scene asks for it; `error_m` grows
  /// by what that costs.
  Result<Mesh> decimated(const Mesh& mesh, float& error_m);

  /// Whether some gaps were left open for merger.budget_ms since this was last asked.
  bool take_hurried() { return std::exchange(hurried_, false); }

 private:
  const Scene* scene_;
  const MergerConfig* merger_;
  bool is_root_;
  Trace* trace_;
  merge::QualityMemory quality_;
  simplify::Simplifier simplifier_;
  double triangles_ = 0;  ///< that the children spent on what is left, when all was joined last
  double zipper_ms_ = 0;  ///< what closing all gaps took last
  bool hurried_ = false;
};

}  // namespace mr::node
