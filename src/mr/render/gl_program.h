#pragma once

#include "mr/core/result.h"

namespace mr::render {

/// What the fragment shader computes: projective texture mapping from a view's pinhole picture, the
/// same where its alpha is over a half, from its equirectangular picture, the normal as a colour,
/// one colour lit from the camera, one flat colour, or interpolated vertex colours.
enum class ShadingMode : int {
  pinhole,
  pinhole_alpha,
  equirectangular,
  normals,
  headlight,
  flat,
  vertex_colors
};
inline constexpr int kShadingModes = 7;

/// Compiles and links the shader program of a mode, for triangles or points, in the current context
/// (uniforms: gl_program.cpp). There is one program per mode because llvmpipe evaluates both sides
/// of every branch. unsupported, with the driver's log, when that fails.
Result<unsigned> make_scene_program(ShadingMode paint, bool points);

/// The program that resamples six cube faces into an equirectangular picture (panorama.h).
Result<unsigned> make_panorama_program();

}  // namespace mr::render
