#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "mr/core/frame_source.h"
#include "mr/core/mesh.h"
#include "mr/core/sensor_config.h"
#include "mr/synth/rig_config.h"
#include "mr/synth/texture.h"

namespace mr::kit {
class RayScene;
}

namespace mr::synth {

/// The oriented bounding box of something in the room; in the object's frame, metres.
struct Block {
  Pose T_room_object;
  Vec3d low, high;
};

/// Light probes (ambient cubes) on a grid through the room, for the irradiance of moving objects.
struct LightProbes {
  Vec3d low, step;                          ///< room frame, metres
  Vec3i count;                              ///< 0: none were baked
  std::vector<std::array<Vec3f, 6>> light;  ///< [x fastest] on faces towards +x -x +y -y +z -z
};

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
  std::vector<Block> blocks;                  ///< obstacles for people and cameras
  LightProbes probes;                         ///< baked where the rig has people or events
  double detail = 0.5;                        ///< contrast of the 1/f noise
  Pose T_world_room;                          ///< room frame: walls along the axes, floor at z = 0
  std::shared_ptr<const kit::RayScene> rays;  ///< the mesh, for ray casting
};

/// Takes a few tenths of a second; runs in the caller's arena, the same on any number of threads.
Room make_room(const RigConfig& rig);

/// The room's surfaces without light and rays; takes some hundredths of a second.
Room build_room(const RigConfig& rig);

/// One sensor of the rig; which one follows from its place in the rig: the Kinects come first, then
/// the LiDARs. No key of a scene file: its `rig` makes the sensors, and open_rig() opens them all.
struct SyntheticSource {
  static constexpr std::string_view kType = "synthetic";

  std::uint32_t camera = 0;

  SourceContent content() const { return {}; }  // RigConfig has it
  friend bool operator==(const SyntheticSource&, const SyntheticSource&) = default;
};

/// The rig's cameras as sensors of a scene, source type `synthetic`. Kinects: up to 16 stand
/// around the room and look inwards; more hang from a grid below the ceiling, each looking at a
/// free place 2 to 3 m away; in a corridor they always hang along it. LiDARs hang from the ceiling.
/// None is inside furniture. Their poses are what calibration says: with injected errors they are
/// off from those that the pictures are rendered from.
std::vector<SensorConfig> rig_sensors(const RigConfig& rig);

/// A hash of everything that a rig's pictures depend on, including the version of this module.
std::uint64_t rig_key(const RigConfig& rig, double fps);

/// The cache of a rig's rendered pictures.
struct RigCache {
  std::filesystem::path folder;  ///< of all rigs; empty: nothing is kept
  /// When set, open_rig() renders what the cache lacks before it returns and reports progress;
  /// else frames are kept as they are read.
  std::function<void(int done, int of)> progress;
};

/// ${XDG_CACHE_HOME:-~/.cache}/meshreduce/rigs; empty where the environment names neither.
std::filesystem::path default_rig_cache();

/// The sources of some of a rig's sensors, in the order of `wanted` (places in `sensors`, which are
/// those of rig_sensors(), perhaps with fewer cameras). They share the room, its people and the
/// cache. Frame i is captured at i / fps after the epoch plus the sensor's `clock_offset_ms`; an
/// injected clock offset moves the moment that the picture shows, not the time that it states. Same
/// rig, same bytes, whether rendered or from the cache. Sources may be read from several threads,
/// each by one.
std::vector<std::unique_ptr<FrameSource>> open_rig(const RigConfig& rig,
                                                   std::span<const SensorConfig> sensors,
                                                   std::span<const SensorId> wanted, double fps,
                                                   const RigCache& cache);

}  // namespace mr::synth
