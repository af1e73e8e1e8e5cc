#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "mr/core/frame_source.h"
#include "mr/core/mesh.h"
#include "mr/core/scene.h"
#include "mr/synth/texture.h"

namespace mr::kit {
class RayScene;
}

namespace mr::synth {

/// A furnished, textured room made from a seed: the noiseless truth of a rig. It is turned by 11
/// degrees about z and 3 about x, so that walls do not lie on voxel planes.
struct Room {
  Mesh mesh;                  ///< world metres, z up, floor through 0, centred on the origin
  std::vector<Vec3f> albedo;  ///< [T] base colour per triangle, linear 0..1
  std::vector<std::uint16_t> material;  ///< [T] index into materials
  std::vector<std::uint32_t> surface;   ///< [T] triangles of one number make one smooth sheet
  std::vector<Vec2f> surface_m;  ///< [V] place on that sheet: right and up, seen from outside
  std::vector<Vec3f> light;      ///< [V] diffuse light that arrives, shadows included
  std::vector<Material> materials;
  double detail = 0.5;                        ///< contrast of the 1/f noise
  Pose T_world_room;                          ///< room frame: walls along the axes, floor at z = 0
  std::shared_ptr<const kit::RayScene> rays;  ///< the mesh, ready for casting
};

/// Takes a few tenths of a second; runs in the caller's arena, the same on any number of threads.
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
