#include "mr/codec/control_pacing.h"

#include <utility>

namespace mr::codec {

Control ControlPacing::due(Control lacking, TimePoint now) {
  std::vector<StreamId> key_frames;
  for (const StreamId stream : lacking.key_frames) {
    const auto found = key_frames_.find(stream);
    const auto last = found == key_frames_.end() ? std::nullopt : std::optional(found->second);
    if (!is_due(last, kKeyFrameEvery, now) || key_frames.size() == Control::kMaxStreams) continue;
    key_frames_[stream] = now;
    key_frames.push_back(stream);
  }
  lacking.key_frames = std::move(key_frames);

  lacking.whole_head = lacking.whole_head && is_due(head_, kHeadEvery, now);
  if (lacking.whole_head) head_ = now;

  if (!is_due(chunks_, kChunksEvery, now)) lacking.chunks.clear();
  if (lacking.chunks.size() > Control::kMaxChunks) lacking.chunks.resize(Control::kMaxChunks);
  if (!lacking.chunks.empty()) chunks_ = now;
  return lacking;
}

void ControlPacing::begin_afresh() {
  key_frames_.clear();
  chunks_.reset();
}

}  // namespace mr::codec
