#pragma once

#include <vector>

#include "mr/eval/geometry_error.h"
#include "mr/scene/scene.h"

/// Which part of a scene its sensors can capture.
namespace mr::eval {

/// The view frustums of all depth cameras at capture 0, from their true poses where the scene's rig
/// is known, else from the stated ones. The scene must be prepared.
std::vector<SensorFrustum> sensor_frustums(const Scene& scene);

/// The scene file's capture volume and floor as half-spaces, whose intersection is captured.
std::vector<HalfSpace> captured_half_spaces(const Scene& scene);

/// The frame of the ground truth that a capture shows, as sources that loop repeat their frames.
int truth_frame(const Scene& scene, int capture);

}  // namespace mr::eval
