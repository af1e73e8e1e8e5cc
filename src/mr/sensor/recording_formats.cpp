#include "mr/sensor/recording_formats.h"

#include <array>

namespace mr::sensor {
namespace {

constexpr std::array<RecordingFormat, 0> kFormats{};

}  // namespace

std::span<const RecordingFormat> recording_formats() { return kFormats; }

const RecordingFormat* recognize(const std::filesystem::path& path) {
  for (const RecordingFormat& format : recording_formats())
    if (format.recognizes(path)) return &format;
  return nullptr;
}

}  // namespace mr::sensor
