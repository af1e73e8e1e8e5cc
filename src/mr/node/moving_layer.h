#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "mr/atlas/color_sampler.h"
#include "mr/atlas/label_history.h"
#include "mr/atlas/occluders.h"
#include "mr/core/coding_plan.h"
#include "mr/core/decoded_scene.h"
#include "mr/core/mesh.h"
#include "mr/core/result.h"
#include "mr/core/trace.h"
#include "mr/kit/part.h"
#include "mr/node/layers.h"
#include "mr/node/surface_joiner.h"
#include "mr/scene/scene.h"

namespace mr::node {

/// The moving surface of a merger: merged anew when an input's is another, kept otherwise.
class MovingLayer {
 public:
  /// All must outlive this.
  MovingLayer(const Scene& scene, const MergerConfig& merger, bool is_root, Clock clock,
              Trace& trace)
      : scene_(&scene),
        is_root_(is_root),
        trace_(&trace),
        joiner_(scene, merger, std::move(clock), trace) {}

  /// Whether a surface was merged so far.
  bool exists() const { return merged_.has_value(); }
  /// Whether `scenes`, the moving layer of the inputs, is another than what was merged last.
  bool is_outdated(const std::vector<DecodedScene>& scenes, const Decimation& decimation) const;

  struct Tick {
    Decimation decimation;
    const CorrectedPoses& poses;
    const atlas::Occluders* still;      ///< hides what moves; null: nothing does
    const atlas::ColorSampler* colors;  ///< of the live pictures; null: there are none
    const AlphaByStream& alpha;         ///< of the live pictures
    const std::function<void()>& on_cores_free;
  };
  /// Merges `parts`, made of `scenes`: poses corrected, without what the still surface shows. After
  /// an Error the surface is what it was.
  Status update(std::vector<DecodedScene> scenes, const std::vector<kit::Part>& parts,
                const Tick& tick);

  /// On the lattice; labelled, at the root with views. There is one.
  const Mesh& mesh() const { return merged_->mesh; }
  const CubeErrors& errors() const { return merged_->errors; }
  const merge::GuessedSurface& guessed() const { return merged_->guessed; }

 private:
  struct Merged {
    std::vector<DecodedScene> scenes;
    Decimation decimation;
    Mesh mesh;
    CubeErrors errors;
    merge::GuessedSurface guessed;
  };

  const Scene* scene_;
  bool is_root_;
  Trace* trace_;
  SurfaceJoiner joiner_;
  std::optional<Merged> merged_;
  atlas::LabelHistory history_;  ///< views of the last surface, so that people keep theirs
};

}  // namespace mr::node
