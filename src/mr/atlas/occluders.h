#pragma once

#include <array>
#include <map>
#include <span>
#include <vector>

#include "mr/core/camera.h"
#include "mr/core/image.h"
#include "mr/core/mesh.h"
#include "mr/core/view.h"
#include "mr/kit/raster.h"

namespace mr::atlas {

/// Depth maps of a surface from several views (depth_camera), against which other surface is tested
/// for occlusion.
class Occluders {
 public:
  Occluders() = default;
  Occluders(const Mesh& mesh, std::span<const View> views);

  /// The depth map of a pinhole view, or the six cube faces of a panorama; null for an unknown
  /// view.
  const std::vector<ImageDepth>* faces(const View& view) const;

 private:
  std::map<ViewId, std::vector<ImageDepth>> faces_;
};

/// How many pixels of a pinhole's picture a pixel of its depth map is wide: 1, 2 or 4, so that the
/// depth map has at least 300 pixels per radian: 1 cm at 3 m, which geometry is no better than.
int depth_divisor(const Camera& camera);
/// The camera of the depth map of a pinhole view.
Camera depth_camera(const Camera& camera);

/// The six cube faces of a panorama.
std::array<kit::CubeFace, 6> panorama_faces(const Camera& camera);

}  // namespace mr::atlas
