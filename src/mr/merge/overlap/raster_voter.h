#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "mr/merge/overlap/occlusion_rule.h"
#include "mr/merge/overlap/ray_grids.h"
#include "mr/merge/overlap/ray_votes.h"

namespace mr::merge {

/// Finds what a camera's rays meet by drawing all triangles into an A-buffer
/// (kit::LayeredRasterizer), and decides each pixel as a ray. It keeps its memory from camera to
/// camera.
class RasterVoter {
 public:
  explicit RasterVoter(const TriangleTable& field);  ///< the field must outlive it
  ~RasterVoter();
  RasterVoter(const RasterVoter&) = delete;
  RasterVoter& operator=(const RasterVoter&) = delete;

  /// Casts the rays of one pinhole at the triangles of `parts` (ascending) and adds their votes.
  /// With `verdicts`, also says what every ray decided. Parallel; the result does not depend on the
  /// threads.
  void cast(const RayGrid& grid, std::span<const std::uint32_t> parts, RayVotes& votes,
            RayVerdicts* verdicts = nullptr);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace mr::merge
