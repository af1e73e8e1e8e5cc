#include "mr/sensor/source_registry.h"

#include <algorithm>

#include "mr/sensor/azure_kinect/source.h"
#include "mr/sensor/folders/tum.h"
#include "mr/sensor/k4a/k4a_config.h"
#include "mr/sensor/k4a/k4a_source.h"
#include "mr/sensor/lidar_360/source.h"
#include "mr/sensor/ouster/source.h"
#include "mr/sensor/realsense/source.h"
#include "mr/sensor/rgbd_images.h"

namespace mr::sensor {
namespace {

constexpr SourceType kSourceTypes[] = {
    {RgbdImagesSource::kType, read_rgbd_images, open_rgbd_images},
    {TumSource::kType, read_tum, open_tum},
    {KinectMkvSource::kType, read_kinect_mkv, open_kinect_mkv},
    {RealSenseBagSource::kType, read_realsense_bag, open_realsense_bag},
    {OusterPcapSource::kType, read_ouster_pcap, open_ouster_pcap},
    {OusterLiveSource::kType, read_ouster_live, open_ouster_live},
    {Lidar360Source::kType, read_lidar_360, open_lidar_360},
    {K4aSource::kType, read_k4a, open_k4a},
};

}  // namespace

std::span<const SourceType> source_types() { return kSourceTypes; }

const SourceType* find_source_type(std::string_view name) {
  const auto found = std::ranges::find(kSourceTypes, name, &SourceType::name);
  return found == std::end(kSourceTypes) ? nullptr : found;
}

}  // namespace mr::sensor
