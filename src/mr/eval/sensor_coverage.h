#pragma once

#include <vector>

#include "mr/eval/geometry_error.h"
#include "mr/scene/scene.h"

/// What of a scene its sensors can capture.
namespace mr::eval {

/// The depth cameras of all sensors, as they stand in capture 0; with their true poses where the
/// scene's rig is known. The scene must be prepared.
std::vector<SensorFrustum> sensor_frustums(const Scene& scene);

/// What the scene file says is captured: its volume, and what is above its floor.
std::vector<HalfSpace> captured_half_spaces(const Scene& scene);

/// Sources that loop show an item again: which frame of a truth belongs to a capture.
int truth_frame(const Scene& scene, int capture);

}  // namespace mr::eval
