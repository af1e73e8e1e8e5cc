#pragma once

#include <optional>
#include <vector>

#include "mr/core/coding_plan.h"
#include "mr/core/decoded_scene.h"
#include "mr/core/mesh.h"
#include "mr/core/result.h"
#include "mr/node/root_atlas.h"
#include "mr/scene/scene.h"

namespace mr::eval {

/// What the root draws the pictures of a burst from, noted while a pipeline runs, so that they can
/// be drawn and encoded again by other plans.
struct RootInputs {
  struct Capture {
    node::CaptureSet captures;
    std::vector<View> views;
    std::vector<SourceInfo> sources;
    Mesh moving;
    std::optional<Mesh> still;
    float error_m = 0;
  };
  std::vector<Capture> burst;
  node::RootAtlas::Memory memory;  ///< at the burst's first capture

  /// Adds a capture to the burst.
  void note(const node::RootAtlas::Drawing& drawing);
  /// The pictures will also hold what these chunks' moving surface uses.
  void add_moving(const std::vector<std::shared_ptr<const Chunk>>& chunks);
  /// Draws the burst. The scene must be the noted one, with any texture settings.
  Result<std::vector<node::RootAtlas::Drawn>> draw(const Scene& scene,
                                                   const CodingPlan& plan) const;
};

}  // namespace mr::eval
