#pragma once

#include <map>
#include <memory>
#include <span>
#include <vector>

#include "mr/baseline/baseline.h"
#include "mr/eval/ssim.h"
#include "mr/render/renderer.h"

namespace mr::eval {

/// The G-buffer of deferred shading: what a viewpoint shows of a surface before its pictures are
/// known, in one raster pass that is shaded again for every texture. The mathematics is that of
/// render::Renderer, on the CPU.
struct GeometryBuffer {
  int width = 0, height = 0;
  ImageMask covered;
  std::vector<View> views;       ///< of the geometry
  Image<std::uint16_t, 1> view;  ///< place in `views`, or kUntextured
  Image<float, 2> camera_pixel;  ///< where in the view's camera picture
  static constexpr std::uint16_t kUntextured = 0xFFFF;
};

/// Back faces are left out. Pinhole viewpoints.
GeometryBuffer draw_geometry(const baseline::Geometry& geometry,
                             const render::Viewpoint& viewpoint);

/// The luma of a texture's pictures, by stream; to be shaded with many times.
struct LumaTexture {
  std::vector<View> views;
  std::map<StreamId, ImageLuma> pictures;
};
LumaTexture luma_texture(const baseline::Texture& texture);

/// As the Renderer draws the geometry with this texture, in luma. Views that the texture lacks are
/// drawn as if untextured.
ImageLuma shade(const GeometryBuffer& buffer, const LumaTexture& texture);

}  // namespace mr::eval
