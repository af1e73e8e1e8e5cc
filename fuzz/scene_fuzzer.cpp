#include <sys/mman.h>
#include <unistd.h>

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <string>

#include "mr/core/scene.h"

/// Any bytes as a scene file: problems or a scene, never a crash, a hang or an exception.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const int file = ::memfd_create("scene", MFD_CLOEXEC);
  if (file < 0) std::abort();
  for (std::size_t written = 0; written < size;) {
    const ::ssize_t n = ::write(file, data + written, size - written);
    if (n <= 0) std::abort();
    written += static_cast<std::size_t>(n);
  }
  const mr::SceneResult result = mr::load_scene("/proc/self/fd/" + std::to_string(file));
  ::close(file);
  // What passes the checks holds what the pipeline relies on.
  if (result.problems.empty()) {
    if (result.scene.mergers.empty()) std::abort();
    if (result.scene.sensors.empty() == !result.scene.rig) std::abort();
    for (const mr::SensorConfig& sensor : result.scene.sensors)
      if (sensor.T_world_depth.empty() || !sensor.depth_camera.problems().empty()) std::abort();
  }
  return 0;
}
