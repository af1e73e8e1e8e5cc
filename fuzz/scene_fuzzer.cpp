#include "mr/scene/scene.h"

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <string>
#include <string_view>
#include <vector>

#include "in_memory.h"

/// Any bytes as a scene file, after a first line "--set KEY=VALUE" with that option: problems or a
/// scene, never a crash, a hang or an exception.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  constexpr std::string_view kSet = "--set ";
  std::string_view text(reinterpret_cast<const char*>(data), size);
  std::vector<std::string> set;
  if (text.starts_with(kSet)) {
    const std::string_view line = text.substr(0, text.find('\n'));
    set.emplace_back(line.substr(kSet.size()));
    text.remove_prefix(line.size());
  }
  const mr::fuzz::InMemoryFile file(reinterpret_cast<const std::uint8_t*>(text.data()),
                                    text.size());
  const mr::SceneResult result = mr::load_scene(file.path(), set);
  // What passes the checks holds what the pipeline relies on.
  if (result.problems.empty()) {
    if (result.scene.mergers.empty()) std::abort();
    if (result.scene.sensors.empty() == !result.scene.rig) std::abort();
    for (const mr::SensorConfig& sensor : result.scene.sensors)
      if (sensor.T_world_depth.empty() || !sensor.depth_camera.problems().empty()) std::abort();
  }
  return 0;
}
