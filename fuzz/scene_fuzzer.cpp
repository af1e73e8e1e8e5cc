#include "mr/core/scene.h"

#include <cstddef>
#include <cstdint>
#include <cstdlib>

#include "in_memory.h"

/// Any bytes as a scene file: problems or a scene, never a crash, a hang or an exception.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const mr::fuzz::InMemoryFile file(data, size);
  const mr::SceneResult result = mr::load_scene(file.path());
  // What passes the checks holds what the pipeline relies on.
  if (result.problems.empty()) {
    if (result.scene.mergers.empty()) std::abort();
    if (result.scene.sensors.empty() == !result.scene.rig) std::abort();
    for (const mr::SensorConfig& sensor : result.scene.sensors)
      if (sensor.T_world_depth.empty() || !sensor.depth_camera.problems().empty()) std::abort();
  }
  return 0;
}
