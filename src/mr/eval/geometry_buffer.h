#pragma once

#include <map>
#include <memory>
#include <span>
#include <vector>

#include "mr/baseline/baseline.h"
#include "mr/eval/ssim.h"
#include "mr/render/renderer.h"

namespace mr::eval {

/// The G-buffer of deferred shading (Saito and Takahashi 1990): for every pixel of a viewpoint the
/// view and texture coordinate of its surface. It is rasterized once and shaded with many textures,
/// with the same mathematics as render::Renderer, on the CPU.
struct GeometryBuffer {
  int width = 0, height = 0;
  ImageMask covered;
  std::vector<View> views;       ///< of the geometry
  Image<std::uint16_t, 1> view;  ///< place in `views`, or kUntextured
  Image<float, 2> camera_pixel;  ///< texture coordinate: pixel of the view's camera
  static constexpr std::uint16_t kUntextured = 0xFFFF;
};

/// Rasterizes with back-face culling. The viewpoint must be a pinhole.
GeometryBuffer draw_geometry(const baseline::Geometry& geometry,
                             const render::Viewpoint& viewpoint);

/// The pixels that a layer's textured surface covers.
ImageMask pixels_of(const GeometryBuffer& buffer, Layer layer);

/// The luma of a texture's pictures, by stream: converted once, used for many viewpoints.
struct LumaTexture {
  std::vector<View> views;
  std::map<StreamId, ImageLuma> pictures;
};
LumaTexture luma_texture(const baseline::Texture& texture);

/// The luma of what render::Renderer draws of the geometry with this texture. A surface whose view
/// the texture lacks is drawn untextured.
ImageLuma shade(const GeometryBuffer& buffer, const LumaTexture& texture);

}  // namespace mr::eval
