#pragma once

#include <cmath>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <vector>

#include "mr/codec/chunk_cache.h"
#include "mr/codec/control.h"
#include "mr/codec/mesh_codec.h"
#include "mr/codec/packet_codec.h"
#include "mr/core/packet.h"
#include "mr/kit/video.h"
#include "support/meshes.h"

namespace mr::test {

/// A node that sends a row of chunks, some of which change with every packet, and one video.
class Sender {
 public:
  static constexpr int kWidth = 64, kHeight = 48;
  static constexpr StreamId kStream{4};

  explicit Sender(int chunks = 6, std::uint32_t epoch = 1) : epoch_(epoch) {
    for (int i = 0; i < chunks; ++i) change(i);
    restart_video();
  }

  void change(int cube) {
    const auto x = static_cast<float>(cube);
    const Mesh mesh = grid({x, 0, 1}, {1, 0, 0}, {0, 1, 0}, 8, 8, 0.05f, ++version_);
    Chunk chunk{{{{cube, 0, 0}, kMergedSource}, 0, version_}, 0, *codec::snap_to_lattice(mesh, {})};
    chunk.mesh.views = {{0, 60, ViewId{0}}, {60, 68, kNoView}};
    const EncodedChunk encoded = *codec::encode_chunk(chunk, {}, 5);
    live_[cube] = encoded;
    fresh_.insert(cube);
    cache.put(encoded);
  }

  void new_layout() { ++layout_; }
  void restart_video() {
    encoder_ =
        std::move(*kit::VideoEncoder::create({.width = kWidth, .height = kHeight, .qp = 20}));
  }

  Packet next(bool key_frame = false) {
    Packet p = quiet();
    auto unit = encoder_->encode(picture(p.sequence), key_frame);
    p.textures = {{kStream, ++serial_, TextureCodec::h264, layout_, kWidth, kHeight,
                   unit->key_frame, unit->data}};
    p.streams = {{kStream, serial_}};
    return p;
  }

  /// A packet whose picture did not change.
  Packet quiet() {
    Packet p;
    p.scene = "test", p.node = "sender";
    p.epoch = epoch_, p.sequence = sequence_++;
    p.captured_at = TimePoint(Duration(33'000'000 * static_cast<std::int64_t>(p.sequence)));
    View view;
    view.id = ViewId{0};
    view.width = kWidth, view.height = kHeight;
    view.fx = view.fy = 60, view.cx = 32, view.cy = 24;
    view.image_rect = view.atlas_rect = {0, 0, kWidth, kHeight};
    view.stream = kStream, view.layout = layout_;
    p.views = {view};
    SourceInfo source;
    source.captured_at = p.captured_at;
    source.depth_camera = view.camera();
    p.sources = {source};
    for (const auto& [cube, chunk] : live_) {
      p.manifest.push_back(chunk.key);
      if (fresh_.contains(cube)) p.chunks.push_back(chunk);
    }
    fresh_.clear();
    cache.keep(p.manifest);
    p.streams = {{kStream, serial_}};
    return p;
  }

  /// The answer with the chunks that a request names; empty: it names none.
  std::vector<std::byte> answer(const codec::Control& request) const {
    std::vector<EncodedChunk> found;
    for (const ChunkKey& key : request.chunks)
      if (const auto chunk = cache.find(key)) found.push_back(*chunk);
    return found.empty() ? std::vector<std::byte>{} : codec::encode_chunks(found);
  }

  static ImageRgb picture(std::uint64_t sequence) {
    ImageRgb out(kWidth, kHeight);
    for (int y = 0; y < kHeight; ++y)
      for (int x = 0; x < kWidth; ++x)
        for (int c = 0; c < 3; ++c)
          out.at(x, y)[c] = static_cast<std::uint8_t>(
              128 + 100 * std::sin(0.1 * x + 0.2 * static_cast<double>(sequence) + c + 0.05 * y));
    return out;
  }

  /// What a receiver should have.
  std::vector<Chunk> chunks() const {
    std::vector<Chunk> out;
    for (const auto& [cube, chunk] : live_) out.push_back(*codec::decode_chunk(chunk, {}));
    return out;
  }

  codec::ChunkCache cache;

 private:
  std::uint32_t epoch_ = 1, version_ = 0, layout_ = 0, serial_ = 0;
  std::uint64_t sequence_ = 100;
  std::map<int, EncodedChunk> live_;
  std::set<int> fresh_;
  std::optional<kit::VideoEncoder> encoder_;
};

}  // namespace mr::test
