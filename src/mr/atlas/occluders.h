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

/// Depth maps of a surface from several views, against which other surface is tested for occlusion.
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

/// The six cube faces of a panorama.
std::array<kit::CubeFace, 6> panorama_faces(const Camera& camera);

}  // namespace mr::atlas
