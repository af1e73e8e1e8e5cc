#pragma once

#include <functional>
#include <span>
#include <vector>

#include "mr/core/mesh.h"
#include "mr/kit/part.h"
#include "mr/merge/overlap/overlap.h"
#include "mr/merge/overlap/second_layers.h"
#include "mr/merge/seam/zipper.h"

namespace mr::merge {

struct SurfacesConfig {
  OverlapConfig overlap;
  SecondLayersConfig second_layers;
  ZipperConfig zipper;
  double island_area_m2 = 0.002;  ///< smaller components are removed
};

/// The distance of second layers, the zipper's gap and the area of islands that suit the voxel
/// size.
SurfacesConfig surfaces_config(const OverlapConfig& overlap);

/// Hooks for callers that time the steps or intervene between them.
struct MergeHooks {
  /// Runs a step: "overlap", "zipper", then "islands". Must call work() once.
  std::function<void(const char* step, const std::function<void()>& work)> step;
  /// Receives the remaining part meshes after overlap removal; may change the zipper's config.
  std::function<void(std::span<const Mesh> owned, ZipperConfig& zipper)> after_overlap;
};

/// Merges the surfaces of several sensors or mergers into one (paper 3.2): overlap removal, closing
/// of the seams, removal of islands. `memory` as in remove_overlap(). Parallel; deterministic.
Mesh merge_surfaces(std::span<const kit::Part> parts, const SurfacesConfig& config,
                    QualityMemory* memory = nullptr, const MergeHooks& hooks = {});

}  // namespace mr::merge
