#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <vector>

#include "in_memory.h"
#include "mr/sensor/realsense/captures.h"
#include "mr/sensor/realsense/source.h"

/// Any bytes as a recording of a RealSense: an error or captures, never a crash; also after a seek.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace mr::sensor;
  const mr::fuzz::InMemoryFile file(data, size);
  auto recording = RealSenseRecording::open(file.path());
  if (!recording) {
    if (recording.error().message.find('\n') != std::string::npos) std::abort();
    return 0;
  }
  for (const std::string& note : recording->header().notes)
    if (note.find('\n') != std::string::npos) std::abort();
  const auto cameras = realsense_cameras(recording->header(), file.path());
  if (cameras && !cameras->depth.problems().empty()) std::abort();
  const std::vector<float> table(65536, 1.0f);
  RealSenseCaptures captures(*std::move(recording), true);
  for (int i = 0; i < 64; ++i) {
    const auto capture = captures.next();
    if (!capture || !*capture) break;
    static_cast<void>(decode_realsense_depth((*capture)->depth, table));
    if ((*capture)->color) static_cast<void>(decode_realsense_color(*(*capture)->color));
    if (i == 8) static_cast<void>(captures.seek((*capture)->depth.at));
  }
  return 0;
}
