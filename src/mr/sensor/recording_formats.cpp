#include "mr/sensor/recording_formats.h"

#include "mr/sensor/azure_kinect/source.h"
#include "mr/sensor/ouster/source.h"

namespace mr::sensor {
namespace {

constexpr RecordingFormat kFormats[] = {
    {"azure-kinect-mkv", is_kinect_mkv, describe_kinect_mkv, import_kinect_mkv},
    {"ouster-pcap", is_ouster_pcap, describe_ouster_pcap, import_ouster_pcap},
};

}  // namespace

std::span<const RecordingFormat> recording_formats() { return kFormats; }

const RecordingFormat* recognize(const std::filesystem::path& path) {
  for (const RecordingFormat& format : recording_formats())
    if (format.recognizes(path)) return &format;
  return nullptr;
}

}  // namespace mr::sensor
