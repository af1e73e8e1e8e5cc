#pragma once

#include <atomic>
#include <cstdint>
#include <optional>

#include "mr/core/packet.h"
#include "mr/core/result.h"
#include "mr/kit/video.h"
#include "mr/scene/scene.h"

namespace mr::node {

/// One texture stream of a node: an encoder that starts afresh, with a key frame, when the
/// picture's size or its layout changes; another quantiser goes on without. Pictures of odd size
/// are padded by repeating their last row and column, as H.264 wants even ones.
class TextureStream {
 public:
  /// `periodic`: a key frame comes now and then; else only when one must.
  TextureStream(const Scene& scene, StreamId stream, bool periodic = true)
      : scene_(&scene), stream_(stream), periodic_(periodic) {}

  Result<TextureUnit> encode(const ImageRgb& picture, int qp, std::uint32_t layout);
  /// The next unit will be a key frame. Any thread.
  void ask_key_frame() { key_frame_asked_ = true; }
  /// Whether somebody waits for a key frame: then the picture is to be coded though it did not
  /// change. Any thread.
  bool key_frame_asked() const { return key_frame_asked_; }

 private:
  const Scene* scene_;
  StreamId stream_;
  bool periodic_;
  std::uint32_t layout_ = 0, serial_ = 0;
  std::atomic<bool> key_frame_asked_ = false;
  std::optional<kit::VideoEncoder> encoder_;
};

}  // namespace mr::node
