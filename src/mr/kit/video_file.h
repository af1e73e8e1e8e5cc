#pragma once

#include <cstddef>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "mr/core/frame.h"
#include "mr/core/image.h"
#include "mr/core/result.h"
#include "mr/kit/panorama_info.h"

namespace mr::kit {

/// What a video file states about its picture.
struct VideoFileInfo {
  std::string container;                 ///< "mov,mp4,…" or "matroska,webm"
  std::string codec;                     ///< "h264", "hevc", "mjpeg", "vp9", …
  int width = 0, height = 0;             ///< pixels, as they are coded
  double frames_per_s = 0;               ///< on average; 0: not stated
  Duration duration{0};                  ///< 0: not stated
  Duration start{0};                     ///< time of the first picture on the file's own time line
  std::optional<TimePoint> recorded_at;  ///< of time 0, by the camera's clock (creation_time)
  int rotation_deg =
      0;  ///< by how much to turn the picture clockwise to see it upright; not applied
  bool stereo = false;  ///< a picture for each eye in one
  PanoramaInfo panorama;
};

struct TimedImage {
  Duration time{0};  ///< presentation time on the file's own time line
  ImageRgb image;
};

/// Reads the picture of MP4, MOV, MKV and WebM files by libavformat and libavcodec: H.264, H.265,
/// MJPEG, VP9 and whatever else the linked libavcodec has, 8 bits and more per channel. Other
/// containers are refused, as some of them read further files or the network.
///
/// Pictures become RGB by the stream's own matrix and range; without a statement by BT.709 from 720
/// rows or 1280 columns on, by BT.601 below; limited range. 4:2:0 in BT.709, limited range, goes
/// through yuv_to_rgb() (chroma interpolated between centres), all else through libswscale. HDR
/// curves are not undone. The same file gives the same pictures.
///
/// Spherical metadata: V2 boxes (sv3d) and Matroska's Projection with pose and crop. V1 (XML)
/// states the projection only, as its angles are where a viewer looks first, not how the camera
/// stood.
class VideoFile {
 public:
  /// Errors: not_found; corrupt (not a video, cut off before its index); unsupported (no picture,
  /// no decoder for it); too_large. Each names the file.
  static Result<VideoFile> open(const std::filesystem::path& file);
  /// The same from memory; `name` is what errors call it.
  static Result<VideoFile> open(std::vector<std::byte> bytes, const std::string& name);
  VideoFile(VideoFile&&) noexcept;
  VideoFile& operator=(VideoFile&&) noexcept;
  ~VideoFile();

  const VideoFileInfo& info() const;

  /// The next picture in order of presentation; nothing at the end. After an error (a damaged
  /// picture, a file cut off) it may be called again: damaged pictures and those that follow from
  /// them are left out until the next key frame.
  Result<std::optional<TimedImage>> next();

  /// next() then gives the first picture at or after `time`, on the file's own time line.
  Status seek(Duration time);

 private:
  struct Impl;
  explicit VideoFile(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace mr::kit
