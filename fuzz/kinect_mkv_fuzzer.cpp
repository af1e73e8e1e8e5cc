#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <vector>

#include "in_memory.h"
#include "mr/sensor/azure_kinect/captures.h"
#include "mr/sensor/azure_kinect/source.h"

/// Any bytes as a recording of an Azure Kinect: an error or captures, never a crash; also after a
/// seek.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace mr::sensor;
  const mr::fuzz::InMemoryFile file(data, size);
  auto recording = KinectRecording::open(file.path());
  if (!recording) {
    if (recording.error().message.find('\n') != std::string::npos) std::abort();
    return 0;
  }
  const auto cameras = kinect_cameras(recording->header(), file.path(), {});
  if (cameras && cameras->depth.width < 1) std::abort();
  const std::vector<float> table(65536, 1.0f);
  KinectCaptures captures(*std::move(recording));
  for (int i = 0; i < 64; ++i) {
    const auto capture = captures.next();
    if (!capture || !*capture) break;
    const KinectHeader& header = captures.header();
    if ((*capture)->depth && header.depth)
      static_cast<void>(decode_counts((*capture)->depth->bytes, *header.depth, table));
    if ((*capture)->color && header.color)
      static_cast<void>(decode_kinect_color((*capture)->color->bytes, *header.color));
    if (i == 8) static_cast<void>(captures.seek((*capture)->at()));
  }
  return 0;
}
