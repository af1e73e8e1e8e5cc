#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "mr/merge/overlap/occlusion_rule.h"
#include "mr/merge/overlap/ray_grids.h"
#include "mr/merge/overlap/ray_votes.h"

namespace mr::merge {

/// Intersects a camera's rays with all triangles by rasterizing them into an A-buffer
/// (kit::LayeredRasterizer), and votes per pixel as if it were a ray. Reuses its memory between
/// cameras.
class RasterVoter {
 public:
  explicit RasterVoter(const TriangleTable& field);  ///< the field must outlive it
  ~RasterVoter();
  RasterVoter(const RasterVoter&) = delete;
  RasterVoter& operator=(const RasterVoter&) = delete;

  /// Adds the votes of one pinhole's rays on the triangles of `parts` (ascending). `verdicts`, if
  /// given, receives the votes of every ray. Parallel; the result does not depend on the threads.
  void cast(const RayGrid& grid, std::span<const std::uint32_t> parts, RayVotes& votes,
            RayVerdicts* verdicts = nullptr);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace mr::merge
