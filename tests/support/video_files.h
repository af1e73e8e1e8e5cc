#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "mr/core/image.h"

/// Video files as cameras write them, made by the same libraries that read them.
namespace mr::test {

/// Spherical Video V2.
struct SphericalPose {
  double yaw_deg = 0, pitch_deg = 0, roll_deg = 0;
  double left = 0, top = 0, right = 0, bottom = 0;  ///< cut off, in parts of the whole sphere
};

struct VideoKind {
  std::string container = "mp4";    ///< of libavformat: "mp4", "mov", "matroska"
  std::string encoder = "libx264";  ///< of libavcodec
  std::string pixels = "yuv420p";   ///< of libavutil
  bool bt709 = true;                ///< otherwise BT.601
  bool full_range = false;
  bool says_color = true;  ///< whether matrix and range are stated
  int fps = 30, key_frame_every = 12, b_frames = 2;
  bool index_first = false;     ///< MP4
  int rotation_deg = 0;         ///< clockwise
  std::string creation_time{};  ///< ISO 8601
  std::optional<SphericalPose> sphere{};
};

/// Whether the linked libavcodec has it.
bool has_encoder(const std::string& name);

/// Writes pictures of one even size; aborts where the libraries refuse.
void write_video(const std::filesystem::path& file, std::span<const ImageRgb> pictures,
                 const VideoKind& kind);

/// An MP4 without picture: one second of silence.
void write_sound_only(const std::filesystem::path& file);

/// The same MP4 (index at its end) with Spherical Video V1: an XML box in its only track.
std::string with_spherical_v1(std::string mp4, const std::string& xml);

}  // namespace mr::test
