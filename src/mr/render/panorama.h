#pragma once

#include <array>

#include "mr/core/camera.h"
#include "mr/core/pose.h"
#include "mr/render/targets.h"

namespace mr::render {

/// The cube map of a panorama: six pinhole pictures that together see every direction, in the order
/// right, left, down, up, front, back.
struct PanoramaFaces {
  Camera camera;  ///< square, 90 degrees and a margin of a few pixels
  std::array<Mat3, FacesTarget::kFaces> R_camera_face;
};

/// The cube faces to draw for an equirectangular picture, which cannot be rasterized directly:
/// triangles across its seam or around a pole would span it from side to side.
PanoramaFaces panorama_faces(const Camera& equirectangular);

/// Resamples the faces into the current render target with the panorama program.
void draw_panorama(unsigned program, const Camera& equirectangular, const PanoramaFaces& faces,
                   const FacesTarget& drawn);

}  // namespace mr::render
