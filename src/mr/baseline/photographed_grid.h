#pragma once

#include <span>
#include <vector>

#include "mr/core/decoded_scene.h"
#include "mr/core/frame.h"
#include "mr/core/result.h"
#include "mr/scene/scene.h"

namespace mr::baseline {

/// What reconstructions that are not coded start from: one grid of all sensors at the scene's voxel
/// (fuse_all), and the colour cameras that look at it.
struct PhotographedGrid {
  Mesh mesh;
  std::vector<View> views;                ///< as color_views()
  std::vector<const ImageRgb*> pictures;  ///< [views] of the capture, which must outlive the grid
  TimePoint captured_at{};                ///< of the last frame

  /// `capture`: undistorted frames. empty: there is no surface, or no sensor has colour.
  static Result<PhotographedGrid> of(const Scene& scene, std::span<const Frame> capture);
  /// What a client shows of this chunk, at the capture's time; the mesh itself is not looked at.
  DecodedScene shown(Chunk chunk) const;
};

}  // namespace mr::baseline
