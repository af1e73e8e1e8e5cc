#pragma once

#include <array>
#include <vector>

#include "mr/codec/gltf_model.h"
#include "mr/core/image.h"

/// Textures and linear colours for background.h and the writers; private to the module.
namespace mr::codec {

/// sRGB's curve: linear 0..1 of each byte, and back to the nearest one.
float to_linear(std::uint8_t srgb);
std::array<std::uint8_t, 3> to_srgb(Vec3f linear);

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

}  // namespace mr::codec
