#pragma once

#include <memory>
#include <vector>

#include "mr/core/frame_source.h"
#include "mr/core/mesh.h"
#include "mr/core/scene.h"

namespace mr::synth {

/// A furnished, textured room made from a seed: the noiseless truth of a rig.
struct Room {
  Mesh mesh;                      ///< world metres, z up, floor at 0, centred on the origin
  std::vector<Vec3f> albedo;      ///< [T] base colour per triangle, linear 0..1
  std::vector<std::uint16_t> material;  ///< [T] which pattern is painted on it
};

Room make_room(const RigConfig& rig);

/// The rig's cameras as sensors of a scene: placed around the room, looking inwards, colour camera
/// beside the depth camera as on an Azure Kinect. Source type `synthetic`.
std::vector<SensorConfig> rig_sensors(const RigConfig& rig);

/// Renders the frames of one of those sensors by ray casting. `room` is shared by all cameras of
/// a rig. Same seed and frame: same bytes.
std::unique_ptr<FrameSource> open_synthetic(std::shared_ptr<const Room> room, const RigConfig& rig,
                                            const SensorConfig& sensor, std::uint32_t sensor_index,
                                            double fps);

}  // namespace mr::synth
