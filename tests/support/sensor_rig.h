#pragma once

#include <chrono>
#include <cstdint>
#include <string>
#include <vector>

#include "mr/core/frame.h"
#include "mr/core/mesh.h"
#include "mr/kit/topology.h"
#include "mr/scene/scene.h"
#include "support/depth_pictures.h"
#include "support/pictures.h"

/// Sensors with small pictures that see solids by formula: scenes and frames for single nodes.
namespace mr::test {

inline constexpr double kWall_m = 2.013;  ///< z of the wall's front; no multiple of a voxel

/// A wall across everything, square to z; seen from z = 0.
inline Solids wall() { return {{}, {Box3d{{-9, -9, kWall_m}, {9, 9, kWall_m + 1}}}, {}}; }

/// The wall, and before it a box of 30 cm.
inline Solids wall_with_box(Vec3d low) {
  Solids out = wall();
  out.boxes.push_back({low, low + Vec3d{0.3, 0.3, 0.3}});
  return out;
}

/// At `eye`, and looking along z: x to the right, y down.
inline Pose facing_the_wall(Vec3d eye = {}) {
  return look_at(eye, eye + Vec3d{0, 0, 1}, {0, -1, 0});
}

/// Sensors "cam-0" and so on at these places, all below the merger "root"; coarse, so that a frame
/// takes little, and without layers.
inline Scene scene_of_sensors(const std::vector<Pose>& places) {
  Scene scene;
  scene.id = "rig";
  scene.fps = 10;
  scene.voxel_m = 0.04;
  scene.fusion.truncation_m = 0.12, scene.fusion.chunk_m = 0.64;
  scene.simplify.ratio = 0.25;
  scene.still.layers = false;
  scene.mergers = {{.id = "root", .inputs = {}, .deadline_ms = 50}};
  for (const Pose& place : places) {
    SensorConfig sensor;
    sensor.id = "cam-" + std::to_string(scene.sensors.size());
    sensor.depth_camera = pinhole(80, 64, 70);
    sensor.color_camera = pinhole(96, 64, 80);
    sensor.T_color_depth.translation = {-0.03, 0, 0};
    sensor.T_world_depth = {place};
    scene.mergers.front().inputs.push_back(sensor.id);
    scene.sensors.push_back(sensor);
  }
  return scene;
}

inline constexpr std::chrono::milliseconds kExposure{8};

/// A sensor's exact frame; frames are a tenth of a second apart.
inline Frame frame_of(const Scene& scene, SensorId sensor, std::uint64_t index,
                      const Solids& solids) {
  const SensorConfig& config = scene.sensor(sensor);
  Frame frame;
  frame.sensor = sensor, frame.index = index;
  frame.exposure_start = TimePoint(std::chrono::hours(1)) + std::chrono::milliseconds(100) * index;
  frame.exposure_end = frame.exposure_start + kExposure;
  frame.T_world_depth = config.T_world_depth.front();
  frame.depth = depth_picture(solids, config.depth_camera, frame.T_world_depth);
  if (config.color_camera)
    frame.color = gradient(config.color_camera->width, config.color_camera->height);
  return frame;
}

/// The area of the wall between a sensor's outermost depth pixels.
inline double seen_wall_m2(const Camera& camera, double distance_m = kWall_m) {
  return (camera.width - 1) / camera.fx * (camera.height - 1) / camera.fy * distance_m * distance_m;
}

/// With layers: frames after which an exact room is known, labelled and handed over to the still
/// surface.
inline constexpr int kLearnt = 30;

/// All chunks' triangles.
inline Mesh all_of(const std::vector<std::shared_ptr<const Chunk>>& chunks) {
  Mesh out;
  for (const auto& chunk : chunks) append(out, chunk->mesh);
  return kit::weld(out);
}

inline std::vector<ChunkKey> keys_of(const std::vector<EncodedChunk>& chunks) {
  std::vector<ChunkKey> out;
  for (const EncodedChunk& chunk : chunks) out.push_back(chunk.key);
  return out;
}

/// The keys of one layer.
inline std::vector<ChunkKey> of_layer(const std::vector<ChunkKey>& keys, Layer layer) {
  std::vector<ChunkKey> out;
  for (const ChunkKey& key : keys)
    if (key.id.layer == layer) out.push_back(key);
  return out;
}

inline bool is_one_line(const std::string& message) {
  return !message.empty() && message.find('\n') == std::string::npos;
}

}  // namespace mr::test
