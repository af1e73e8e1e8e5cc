#pragma once

#include <filesystem>

/// Small recordings as devices write them.
namespace mr::test {

/// Two captures of an Azure Kinect: depth 320x288, MJPG 1280x720; and its calibration as a file.
void write_kinect_recording(const std::filesystem::path& mkv,
                            const std::filesystem::path& calibration);

/// Two turns of an Ouster LiDAR, 512x16, with sender 192.168.1.10; and its metadata.
void write_ouster_recording(const std::filesystem::path& pcap,
                            const std::filesystem::path& metadata);

/// Two captures of a RealSense: depth 64x48, rgb8 96x64.
void write_realsense_recording(const std::filesystem::path& bag);

}  // namespace mr::test
