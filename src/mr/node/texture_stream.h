#pragma once

#include <atomic>
#include <cstdint>
#include <optional>

#include "mr/core/packet.h"
#include "mr/core/result.h"
#include "mr/kit/video.h"
#include "mr/scene/scene.h"

namespace mr::node {

/// One texture stream of a node: a video encoder that is restarted, with a key frame, when the
/// picture's size or layout changes; a change of the quantiser needs none. Pictures of odd size are
/// padded by repeating their last row and column, as H.264 requires even sizes.
class TextureStream {
 public:
  /// `periodic`: key frames at intervals; false: only when needed or requested.
  TextureStream(const Scene& scene, StreamId stream, bool periodic = true)
      : scene_(&scene), stream_(stream), periodic_(periodic) {}

  Result<TextureUnit> encode(const ImageRgb& picture, int qp, std::uint32_t layout);
  /// Refines a band of the last picture, which did not change: see
  /// kit::VideoEncoder::encode_band(). Where a key frame is due, that brings all of it. Of a stream
  /// without periodic key frames, where rate is controlled.
  Result<TextureUnit> refine(const ImageRgb& picture, int qp, std::uint32_t layout,
                             kit::RowBand band);
  /// The next unit will be a key frame. Any thread.
  void ask_key_frame() { key_frame_asked_ = true; }
  /// Whether a picture of this size and layout would become a key frame now.
  bool is_key_frame_due(int width, int height, std::uint32_t layout) const;
  /// Whether a key frame was requested: then the picture must be encoded even if it did not change.
  /// Any thread.
  bool key_frame_asked() const { return key_frame_asked_; }

 private:
  Result<TextureUnit> encode(const ImageRgb& picture, int qp, std::uint32_t layout,
                             const kit::RowBand* band);

  const Scene* scene_;
  StreamId stream_;
  bool periodic_;
  std::uint32_t layout_ = 0, serial_ = 0;
  int since_key_frame_ = 0;  ///< units
  std::atomic<bool> key_frame_asked_ = false;
  std::optional<kit::VideoEncoder> encoder_;
};

}  // namespace mr::node
