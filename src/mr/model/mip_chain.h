#pragma once

#include <array>
#include <vector>

#include "mr/core/image.h"
#include "mr/model/gltf_model.h"

/// Textures for background.h and the writers; private to the module.
namespace mr::model {

/// A picture at full size, half, a quarter … down to a single pixel.
class MipChain {
 public:
  MipChain() = default;
  /// `picture`: not empty.
  explicit MipChain(ImageRgb picture);

  const ImageRgb& level(std::size_t i) const { return levels_[i]; }

  /// The linear colour around `uv` (v from the top): bilinear, from the level in which
  /// `extent_texels` texels of the full picture are about one.
  Vec3f sample(Vec2f uv, const std::array<Wrap, 2>& wrap, float extent_texels) const;

 private:
  std::vector<ImageRgb> levels_;  ///< sRGB
};

}  // namespace mr::model
