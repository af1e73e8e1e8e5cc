#include "mr/sensor/recording_formats.h"

#include "mr/sensor/azure_kinect/source.h"
#include "mr/sensor/folders/folder_formats.h"
#include "mr/sensor/ouster/source.h"
#include "mr/sensor/realsense/source.h"

namespace mr::sensor {
namespace {

using std::filesystem::path;

using OpenFolder = Result<PictureFolder>(const path&);

template <OpenFolder open>
Result<RecordingInfo> describe_folder(const path& folder) {
  const auto opened = open(folder);
  if (!opened) return opened.error();
  return describe(*opened);
}

template <OpenFolder open>
Result<ImportedScene> import_folder(const path& folder) {
  const auto opened = open(folder);
  if (!opened) return opened.error();
  return imported(*opened);
}

template <OpenFolder open>
constexpr RecordingFormat folder_format(std::string_view name, bool (*recognizes)(const path&)) {
  return {name, recognizes, describe_folder<open>, import_folder<open>};
}

constexpr RecordingFormat kFormats[] = {
    {"Azure Kinect recording (.mkv)", is_kinect_mkv, describe_kinect_mkv, import_kinect_mkv},
    {"RealSense recording (.bag)", is_realsense_bag, describe_realsense_bag, import_realsense_bag},
    {"Ouster recording (.pcap)", is_ouster_pcap, describe_ouster_pcap, import_ouster_pcap},
    folder_format<open_tum_recording>("TUM RGB-D folder", is_tum),
    folder_format<open_seven_scenes>("7-Scenes or 3DMatch folder", is_seven_scenes),
    folder_format<open_scannet>("ScanNet export", is_scannet),
    folder_format<open_replica>("Replica folder", is_replica),
    folder_format<open_redwood>("Redwood or Open3D folder", is_redwood),
    folder_format<open_depth_views>("folder of still depth views", is_depth_views),
    {"cwipc recording", is_cwipc, describe_cwipc, import_cwipc},
    {"ScanNet .sens file", is_sens, describe_sens, nullptr},
    {"Azure Kinect calibration (.json)", is_kinect_calibration, describe_kinect_calibration,
     nullptr},
    {"Ouster metadata (.json)", is_ouster_metadata, describe_ouster_metadata, nullptr},
    {"equirectangular picture", is_equirectangular, describe_equirectangular, nullptr},
};

}  // namespace

std::span<const RecordingFormat> recording_formats() { return kFormats; }

const RecordingFormat* recognize(const path& path) {
  for (const RecordingFormat& format : recording_formats())
    if (format.recognizes(path)) return &format;
  return nullptr;
}

}  // namespace mr::sensor
