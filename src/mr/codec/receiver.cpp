#include "mr/codec/receiver.h"

#include <algorithm>
#include <set>
#include <string>

#include "mr/codec/alpha_codec.h"
#include "mr/codec/mesh_codec.h"
#include "mr/core/parallel.h"
#include "mr/kit/video.h"

namespace mr::codec {
namespace {

/// One texture stream. Without a picture it waits for a key frame.
struct Stream {
  std::optional<kit::VideoDecoder> decoder;
  std::uint32_t layout = 0, serial = 0;
  std::shared_ptr<const ImageRgb> picture;

  bool waiting() const { return picture == nullptr; }
  Status decode(const TextureUnit& unit);
};

Status Stream::decode(const TextureUnit& unit) {
  const auto fail = [&](Error::Cause cause, const std::string& what) {
    picture = nullptr;
    return Error{cause, "stream " + std::to_string(number_of(unit.stream)) + ": " + what};
  };
  if (!unit.key_frame) {
    if (unit.serial != serial + 1) picture = nullptr;  // one before it was lost
    if (waiting()) return {};                          // nothing is wrong with it, only too early
    if (unit.layout != layout)
      return fail(Error::Cause::invalid, "the layout changed without a key frame");
  }
  if (!decoder) {
    auto created = kit::VideoDecoder::create();
    if (!created) return fail(created.error().cause, created.error().message);
    decoder = std::move(*created);
  }
  auto decoded = decoder->decode(unit.data);
  if (!decoded) return fail(decoded.error().cause, decoded.error().message);
  if (decoded->width != unit.width || decoded->height != unit.height)
    return fail(Error::Cause::invalid, "the picture's size is not as promised");
  layout = unit.layout, serial = unit.serial;
  picture = std::make_shared<const ImageRgb>(std::move(*decoded));
  return {};
}

/// The access units of one stream, in order.
struct StreamWork {
  Stream* stream = nullptr;
  std::vector<const TextureUnit*> units;
  std::vector<Error> errors;

  void run() {
    for (const TextureUnit* unit : units)
      if (auto ok = stream->decode(*unit); !ok) errors.push_back(ok.error());
  }
};

struct ChunkWork {
  const EncodedChunk* encoded = nullptr;
  std::shared_ptr<const Chunk> decoded;
  std::optional<Error> error;

  void run(const Lattice& lattice) {
    auto chunk = decode_chunk(*encoded, lattice);
    if (chunk)
      decoded = std::make_shared<const Chunk>(std::move(*chunk));
    else
      error = chunk.error();
  }
};

struct AlphaWork {
  const AlphaPlane* encoded = nullptr;
  std::shared_ptr<const Alpha> decoded;
  std::optional<Error> error;

  void run() {
    auto plane = decode_alpha(encoded->data, encoded->width, encoded->height);
    if (plane)
      decoded = std::make_shared<const Alpha>(Alpha{encoded->step_px, *std::move(plane)});
    else
      error = Error{plane.error().cause, "stream " + std::to_string(number_of(encoded->stream)) +
                                             ": " + plane.error().message};
  }
};

}  // namespace

struct Receiver::Impl {
  explicit Impl(const Lattice& l) : lattice(l) {}

  Lattice lattice;
  std::optional<Packet> newest;  ///< without payloads
  std::map<ChunkKey, std::shared_ptr<const Chunk>> chunks;
  std::map<StreamId, Stream> streams;
  std::map<StreamId, std::shared_ptr<const Alpha>> alpha;  ///< of the newest packet

  bool same_origin(const Packet& p) const {
    return newest && newest->scene == p.scene && newest->node == p.node && newest->epoch == p.epoch;
  }
  bool names(const ChunkKey& key) const {
    return newest && std::binary_search(newest->manifest.begin(), newest->manifest.end(), key);
  }
  void take_head(const Packet& packet);
  std::vector<ChunkWork> chunk_work(const Packet& packet) const;
  std::vector<StreamWork> stream_work(const Packet& packet);
  std::vector<AlphaWork> alpha_work(const Packet& packet) const;
  void check_streams(const Packet& packet);
  bool whole() const;
};

/// Everything but the payloads; forgets what the packet no longer uses.
void Receiver::Impl::take_head(const Packet& packet) {
  Packet head;
  head.scene = packet.scene, head.node = packet.node;
  head.epoch = packet.epoch, head.sequence = packet.sequence;
  head.captured_at = packet.captured_at;
  head.sources = packet.sources;
  head.views = packet.views;
  head.manifest = packet.manifest;
  newest = std::move(head);
  std::erase_if(chunks, [&](const auto& item) { return !names(item.first); });
  std::set<StreamId> used;
  for (const View& view : packet.views) used.insert(view.stream);
  for (const TextureUnit& unit : packet.textures) used.insert(unit.stream);
  std::erase_if(streams, [&](const auto& item) { return !used.contains(item.first); });
}

std::vector<ChunkWork> Receiver::Impl::chunk_work(const Packet& packet) const {
  std::vector<ChunkWork> work;
  for (const EncodedChunk& chunk : packet.chunks)
    if (names(chunk.key) && !chunks.contains(chunk.key)) work.push_back({&chunk, nullptr, {}});
  return work;
}

std::vector<StreamWork> Receiver::Impl::stream_work(const Packet& packet) {
  std::map<StreamId, StreamWork> by_stream;
  for (const TextureUnit& unit : packet.textures) {
    StreamWork& work = by_stream[unit.stream];
    work.stream = &streams[unit.stream];
    work.units.push_back(&unit);
  }
  std::vector<StreamWork> work;
  for (auto& [stream, item] : by_stream) work.push_back(std::move(item));
  return work;
}

std::vector<AlphaWork> Receiver::Impl::alpha_work(const Packet& packet) const {
  std::vector<AlphaWork> work;
  for (const AlphaPlane& plane : packet.alpha)
    if (streams.contains(plane.stream)) work.push_back({&plane, nullptr, {}});
  return work;
}

/// A stream whose newest unit was lost shows an older capture.
void Receiver::Impl::check_streams(const Packet& packet) {
  for (const StreamState& state : packet.streams)
    if (const auto it = streams.find(state.stream);
        it != streams.end() && it->second.serial != state.serial)
      it->second.picture = nullptr;
}

bool Receiver::Impl::whole() const {
  if (!newest) return false;
  for (const ChunkKey& key : newest->manifest)
    if (!chunks.contains(key)) return false;
  return std::ranges::all_of(newest->views, [&](const View& view) {
    const auto it = streams.find(view.stream);
    return it != streams.end() && !it->second.waiting() && it->second.layout == view.layout;
  });
}

Receiver::Receiver(const Lattice& lattice) : impl_(std::make_unique<Impl>(lattice)) {}
Receiver::~Receiver() = default;
Receiver::Receiver(Receiver&&) noexcept = default;
Receiver& Receiver::operator=(Receiver&&) noexcept = default;

bool Receiver::is_stale(const Packet& packet) const {
  return impl_->same_origin(packet) && packet.sequence <= impl_->newest->sequence;
}

std::vector<Error> Receiver::accept(const Packet& packet) {
  Impl& i = *impl_;
  if (i.same_origin(packet)) {
    const std::uint64_t last = i.newest->sequence;
    if (packet.sequence <= last)
      return {{Error::Cause::invalid, "packet " + std::to_string(packet.sequence) +
                                          " comes after packet " + std::to_string(last)}};
  } else {
    i.chunks.clear();
    i.streams.clear();
  }
  i.take_head(packet);

  std::vector<ChunkWork> chunks = i.chunk_work(packet);
  std::vector<StreamWork> streams = i.stream_work(packet);
  std::vector<AlphaWork> planes = i.alpha_work(packet);
  const std::size_t pictures = streams.size() + planes.size();
  parallel_for(pictures + chunks.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t n = begin; n < end; ++n)
      if (n < streams.size())
        streams[n].run();
      else if (n < pictures)
        planes[n - streams.size()].run();
      else
        chunks[n - pictures].run(i.lattice);
  });

  i.check_streams(packet);
  std::vector<Error> errors;
  for (ChunkWork& work : chunks) {
    if (work.error)
      errors.push_back(std::move(*work.error));
    else
      i.chunks[work.encoded->key] = std::move(work.decoded);
  }
  for (StreamWork& work : streams)
    std::move(work.errors.begin(), work.errors.end(), std::back_inserter(errors));
  i.alpha.clear();
  for (AlphaWork& work : planes) {
    if (work.error)
      errors.push_back(*std::move(work.error));
    else
      i.alpha[work.encoded->stream] = std::move(work.decoded);
  }
  return errors;
}

std::optional<std::uint64_t> Receiver::newest_sequence() const {
  return impl_->newest ? std::optional(impl_->newest->sequence) : std::nullopt;
}

std::vector<ChunkKey> Receiver::missing() const {
  std::vector<ChunkKey> out;
  if (impl_->newest)
    for (const ChunkKey& key : impl_->newest->manifest)
      if (!impl_->chunks.contains(key)) out.push_back(key);
  return out;
}

Status Receiver::provide(const EncodedChunk& chunk) {
  if (!impl_->names(chunk.key))
    return Error{Error::Cause::invalid, "chunk: not what the newest manifest names"};
  if (impl_->chunks.contains(chunk.key)) return {};
  auto decoded = decode_chunk(chunk, impl_->lattice);
  if (!decoded) return decoded.error();
  impl_->chunks[chunk.key] = std::make_shared<const Chunk>(std::move(*decoded));
  return {};
}

std::vector<StreamId> Receiver::streams_waiting() const {
  std::set<StreamId> out;
  for (const auto& [id, stream] : impl_->streams)
    if (stream.waiting()) out.insert(id);
  // A view may name a stream of which nothing ever came, or a layout that was lost.
  if (impl_->newest)
    for (const View& view : impl_->newest->views) {
      const auto it = impl_->streams.find(view.stream);
      if (it == impl_->streams.end() || it->second.layout != view.layout) out.insert(view.stream);
    }
  return {out.begin(), out.end()};
}

std::optional<std::vector<std::shared_ptr<const Chunk>>> Receiver::mesh() const {
  if (!impl_->newest || !missing().empty()) return std::nullopt;
  std::vector<std::shared_ptr<const Chunk>> out;
  for (const ChunkKey& key : impl_->newest->manifest) out.push_back(impl_->chunks.at(key));
  return out;
}

std::optional<DecodedScene> Receiver::scene() const {
  if (!impl_->whole()) return std::nullopt;
  DecodedScene out;
  out.captured_at = impl_->newest->captured_at;
  out.sources = impl_->newest->sources;
  out.views = impl_->newest->views;
  out.chunks = *mesh();
  for (const auto& [id, stream] : impl_->streams)
    if (!stream.waiting()) out.textures[id] = stream.picture;
  for (const auto& [id, alpha] : impl_->alpha)
    if (const auto picture = out.textures.find(id);
        picture != out.textures.end() && alpha->fits(*picture->second))
      out.alpha[id] = alpha;
  return out;
}

}  // namespace mr::codec
