// The baselines' receivers on any bytes, sealed so that the check sum does not stop them: refused
// or drawn.
#include <cstdlib>

#include "mr/baseline/baseline.h"
#include "mr/baseline/wire.h"
#include "patched.h"

namespace {

using mr::baseline::Message;

/// Two sensors with small pictures; one scene per pipeline.
mr::Scene scene_of(const char* pipeline) {
  mr::Scene scene;
  scene.id = "fuzz", scene.pipeline = pipeline;
  for (const char* id : {"a", "b"}) {
    mr::SensorConfig sensor;
    sensor.id = id;
    sensor.depth_camera.width = 32, sensor.depth_camera.height = 24;
    sensor.depth_camera.fx = sensor.depth_camera.fy = 30;
    sensor.depth_camera.cx = 16, sensor.depth_camera.cy = 12;
    sensor.color_camera = sensor.depth_camera;
    sensor.T_world_depth = {mr::Pose{}};
    scene.sensors.push_back(sensor);
  }
  return scene;
}

void receive(const char* pipeline, Message geometry, Message texture,
             const mr::baseline::Bytes& body) {
  const mr::Scene scene = scene_of(pipeline);
  const auto baseline = mr::baseline::make_baseline(scene);
  if (!baseline) std::abort();
  if (const auto decoded = (*baseline)->decode_geometry(mr::baseline::seal(geometry, body)))
    for (const auto& chunk : decoded->chunks)
      for (const mr::Triangle& triangle : chunk->mesh.triangles)
        for (const std::uint32_t vertex : triangle)
          if (vertex >= chunk->mesh.positions.size()) std::abort();
  static_cast<void>((*baseline)->decode_texture(mr::baseline::seal(texture, body)).ok());
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const auto bytes = mr::fuzz::as_bytes(data + 1, size - 1);
  const mr::baseline::Bytes body(bytes.begin(), bytes.end());
  switch (data[0] % 4) {
    case 0:
      receive("holoportation", Message::holoportation_geometry, Message::holoportation_texture,
              body);
      break;
    case 1:
      receive("holoportation++", Message::plus_geometry, Message::video_texture, body);
      break;
    case 2:
      receive("points", Message::points_draco, Message::points_draco, body);
      break;
    default:
      receive("rgbd", Message::depth_video, Message::video_texture, body);
  }
  return 0;
}
