#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "mr/merge/paper_rule.h"
#include "mr/merge/ray_grids.h"
#include "mr/merge/ray_votes.h"

namespace mr::merge {

/// Finds what a camera's rays meet by drawing all triangles that face it, hidden ones too, into a
/// multi-layer depth image, and decides while each tile is at hand: no image of the whole picture
/// is kept. It keeps its memory from camera to camera.
///
/// Corners are rounded to 1/2048 pixel, where lines between them are exact: a ray through an edge
/// that two triangles share meets one of them. Rays begin at kit::kNearPlane_m depth.
class LayerCaster {
 public:
  explicit LayerCaster(const PaperField& field);  ///< the field must outlive it
  ~LayerCaster();
  LayerCaster(const LayerCaster&) = delete;
  LayerCaster& operator=(const LayerCaster&) = delete;

  /// Casts the rays of one pinhole at the triangles of `parts` (ascending) and adds their votes.
  /// With `told`, also says what every ray decided. Parallel over blocks of triangles, then over
  /// tiles; the result does not depend on the threads.
  void cast(const RayGrid& grid, std::span<const std::uint32_t> parts, RayVotes& votes,
            RayVerdicts* told = nullptr);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace mr::merge
