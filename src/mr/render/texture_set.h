#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <vector>

#include "mr/core/decoded_scene.h"
#include "mr/core/result.h"
#include "mr/render/scene_geometry.h"

namespace mr::render {

/// The pictures of texture streams on the graphics card. Its context must be current and frees what
/// is there.
class TextureSet {
 public:
  /// Uploads the pictures that the ranges need and that changed; forgets those of streams that
  /// ended. invalid when a range names a view, or a view a tile, that the scene does not have.
  Status keep(const DecodedScene& scene, const std::vector<ViewRange>& ranges);

  /// Lets a shader sample the picture of a stream; its size.
  Vec2i bind(StreamId stream) const;

 private:
  struct Texture {
    unsigned name = 0;
    int width = 0, height = 0;
    std::weak_ptr<const ImageRgb> image;  ///< what was uploaded; pictures never change
    std::weak_ptr<const Alpha> alpha;     ///< in its fourth channel; nor do planes
  };

  void upload(Texture& texture, const ImageRgb& image, const Alpha* alpha);

  std::map<StreamId, Texture> textures_;  ///< by stream
  std::vector<std::uint8_t> rgba_;        ///< on the way to the card
};

}  // namespace mr::render
