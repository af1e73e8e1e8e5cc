#pragma once

#include <cstdint>
#include <vector>

#include "mr/core/image.h"
#include "mr/core/result.h"

namespace mr::render {

/// The longest side of a picture that the current context can draw.
int largest_picture_side();

/// A picture that is drawn into and read back. The context must be current and frees it.
class PictureTarget {
 public:
  /// Makes it this large and draws into it from now on. too_large, unsupported.
  Status use(int width, int height);

  /// What was drawn, first row first.
  Result<ImageRgb> read_back();
  /// Where the picture that was read back last shows a surface.
  ImageMask covered() const;
  /// The depth buffer as it is: 0..1, 1 where nothing was drawn.
  Result<ImageDepth> read_depth();

 private:
  unsigned framebuffer_ = 0, color_ = 0, depth_ = 0;
  int width_ = 0, height_ = 0;
  std::vector<std::uint8_t> rgba_;
};

/// Six square pictures that are drawn into and then sampled, as a texture array.
class FacesTarget {
 public:
  static constexpr int kFaces = 6;

  /// Makes the faces this large. too_large, unsupported.
  Status resize(int side);

  /// Draws into one face from now on.
  void use(int face);

  /// Lets a shader sample them.
  void bind() const;

 private:
  unsigned framebuffer_ = 0, colors_ = 0, depth_ = 0;
  int side_ = 0;
};

}  // namespace mr::render
