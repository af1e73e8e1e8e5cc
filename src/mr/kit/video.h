#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "mr/core/image.h"
#include "mr/core/result.h"

namespace mr::kit {

/// The linked video library.
struct VideoLibrary {
  std::string version;  ///< of libavcodec
  std::string licence;  ///< also applies to the program linked with it
};
VideoLibrary video_library();

struct VideoSettings {
  int width = 0, height = 0;  ///< pixels, even, at most 8192
  double fps = 30;
  int qp = 28;                  ///< quantiser of most pictures, 0..51; set_qp() changes it
  int threads = 1, slices = 1;  ///< fixed per scene, as libx264's output depends on them
  int key_frame_every = 250;    ///< pictures; 0: only the first and on demand
  bool bands = false;           ///< encode_band() may be called
  friend bool operator==(const VideoSettings&, const VideoSettings&) = default;
};

/// Rows of a picture's pixels, [first, end).
struct RowBand {
  int first = 0, end = 0;
};

struct AccessUnit {
  std::vector<std::byte> data;  ///< H.264 Annex B; SPS and PPS before each key frame
  bool key_frame = false;
};

/// H.264 by libx264 through libavcodec: no B frames, one picture in, one access unit out, BT.709
/// limited range declared in the stream, main profile or below (browsers).
class VideoEncoder {
 public:
  static Result<VideoEncoder> create(const VideoSettings& settings);
  VideoEncoder(VideoEncoder&&) noexcept;
  VideoEncoder& operator=(VideoEncoder&&) noexcept;
  ~VideoEncoder();

  /// Sets the quantiser of the following pictures, 0..51, without a key frame.
  void set_qp(int qp);

  /// The picture must have the settings' size.
  Result<AccessUnit> encode(const ImageRgb& picture, bool force_key_frame = false);
  /// Codes what is in a band; elsewhere, nearly all stays as it was. Refines a picture that did not
  /// change, part by part. Of rows in steps of kBandStep; settings().bands must be true.
  Result<AccessUnit> encode_band(const ImageRgb& picture, RowBand band);
  static constexpr int kBandStep = 16;

  const VideoSettings& settings() const;

 private:
  struct Impl;
  Result<AccessUnit> encode(const ImageRgb& picture, bool force_key_frame, const RowBand* band);
  explicit VideoEncoder(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

/// Decodes one H.264 stream; access units must come in order. Invalid data is an error, after which
/// the decoder can continue at the next key frame.
class VideoDecoder {
 public:
  static Result<VideoDecoder> create();
  VideoDecoder(VideoDecoder&&) noexcept;
  VideoDecoder& operator=(VideoDecoder&&) noexcept;
  ~VideoDecoder();

  Result<ImageRgb> decode(std::span<const std::byte> access_unit);

 private:
  struct Impl;
  explicit VideoDecoder(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace mr::kit
