#pragma once

#include <array>

#include "mr/core/camera.h"
#include "mr/core/pose.h"
#include "mr/render/targets.h"

namespace mr::render {

/// One of six pinhole pictures that together see every direction, in the order of the panorama
/// program: right, left, down, up, front, back.
struct PanoramaFaces {
  Camera camera;  ///< square, 90 degrees and a margin of a few pixels
  std::array<Mat3, FacesTarget::kFaces> R_camera_face;
};

/// The faces to draw for an equirectangular picture. Its triangles cannot be drawn at once: those
/// that lie across the seam or around a pole would cover it from side to side.
PanoramaFaces panorama_faces(const Camera& equirectangular);

/// Resamples the faces into the target in use with panorama program `program`.
void draw_panorama(unsigned program, const Camera& equirectangular, const PanoramaFaces& faces,
                   const FacesTarget& drawn);

}  // namespace mr::render
