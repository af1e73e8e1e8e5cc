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

/// Surface that may hide another from some views: how far away each of them sees it.
class Occluders {
 public:
  Occluders() = default;
  Occluders(const Mesh& mesh, std::span<const View> views);

  /// A pinhole's picture, or the six of a panorama; null for a view that is not known.
  const std::vector<ImageDepth>* faces(const View& view) const;

 private:
  std::map<ViewId, std::vector<ImageDepth>> faces_;
};

/// The six pictures that a panorama is made of.
std::array<kit::CubeFace, 6> panorama_faces(const Camera& camera);

}  // namespace mr::atlas
