#pragma once

#include "mr/core/result.h"

namespace mr::render {

/// What the fragment shader does: projects into a view's picture, shows the normal, lights one
/// colour from the eye, fills with it, or takes the vertices' own colours.
enum class ShadingMode : int { pinhole, equirectangular, normals, headlight, flat, vertex_colors };
inline constexpr int kShadingModes = 6;

/// Compiles and links the program that paints triangles, or points, in this way (its uniforms:
/// gl_program.cpp), in the current context. One program each, as llvmpipe computes both sides of
/// every branch. unsupported with the driver's log when that fails.
Result<unsigned> make_scene_program(ShadingMode paint, bool points);

/// The program that puts six faces together as an equirectangular picture: panorama.h.
Result<unsigned> make_panorama_program();

}  // namespace mr::render
