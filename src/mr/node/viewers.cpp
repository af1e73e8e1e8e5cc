#include "mr/node/viewers.h"

#include <algorithm>
#include <set>

#include "mr/codec/coalesce.h"
#include "mr/codec/packet_codec.h"
#include "mr/node/node_clock.h"

namespace mr::node {
namespace {

/// Whether every stream that a view uses has a key frame in the packet.
bool starts_all_streams(const Packet& packet) {
  std::set<std::uint32_t> used, started;
  for (const View& view : packet.views) used.insert(view.stream);
  for (const TextureUnit& unit : packet.textures)
    if (unit.key_frame) started.insert(unit.stream);
  return std::includes(started.begin(), started.end(), used.begin(), used.end());
}

}  // namespace

void Viewers::opened(Id viewer) { viewers_[viewer]; }
void Viewers::closed(Id viewer) { viewers_.erase(viewer); }

std::vector<Viewers::Send> Viewers::packet(Packet packet, net::Message bytes) {
  const auto shared = std::make_shared<const Packet>(std::move(packet));
  take_head(shared);
  const bool start = starts_all_streams(*shared) && complete();
  net::Message everything;
  std::vector<Send> out;
  for (auto& [id, viewer] : viewers_) {
    if (viewer.fresh) {
      if (!start || viewer.in_flight.size() >= kInFlight) continue;
      if (!everything) everything = refresh(*shared);
      viewer.fresh = false;
      viewer.in_flight.push_back(shared->sequence);
      out.emplace_back(id, everything);
      continue;
    }
    viewer.waiting.push_back({shared, bytes});
    if (viewer.waiting.size() > kMaxWaiting) {
      viewer.waiting.clear();
      viewer.fresh = true;
      ++restarted_;
    }
    if (auto send = flush(id, viewer)) out.push_back(*std::move(send));
  }
  return out;
}

void Viewers::take_head(const std::shared_ptr<const Packet>& packet) {
  if (newest_ && newest_->epoch != packet->epoch) chunks_.clear();
  newest_ = packet;
  const auto& manifest = packet->manifest;
  std::erase_if(chunks_, [&](const auto& item) {
    return !std::binary_search(manifest.begin(), manifest.end(), item.first);
  });
  for (const EncodedChunk& chunk : packet->chunks)
    chunks_[chunk.key] = std::make_shared<const EncodedChunk>(chunk);
}

void Viewers::take_chunks(std::vector<EncodedChunk> chunks) {
  if (!newest_) return;
  const auto& manifest = newest_->manifest;
  for (EncodedChunk& chunk : chunks)
    if (std::binary_search(manifest.begin(), manifest.end(), chunk.key)) {
      const ChunkKey key = chunk.key;
      chunks_[key] = std::make_shared<const EncodedChunk>(std::move(chunk));
    }
}

bool Viewers::complete() const { return newest_ && chunks_.size() == newest_->manifest.size(); }

/// A packet with all chunks of its manifest, and of each stream only what follows its newest key
/// frame.
net::Message Viewers::refresh(const Packet& packet) const {
  Packet all = packet;
  all.coalesced = 0;
  all.chunks.clear();
  for (const auto& [key, chunk] : chunks_) all.chunks.push_back(*chunk);
  all.textures.clear();
  for (const TextureUnit& unit : packet.textures) {
    if (unit.key_frame)
      std::erase_if(all.textures, [&](const auto& u) { return u.stream == unit.stream; });
    all.textures.push_back(unit);
  }
  return std::make_shared<const std::vector<std::byte>>(codec::encode_packet(all));
}

/// What waits for a viewer, as one packet, if it may get one.
std::optional<Viewers::Send> Viewers::flush(Id id, Viewer& viewer) {
  if (viewer.waiting.empty() || viewer.in_flight.size() >= kInFlight) return std::nullopt;
  std::vector<Waiting> waiting;
  waiting.swap(viewer.waiting);
  viewer.in_flight.push_back(waiting.back().packet->sequence);
  if (waiting.size() == 1) return Send(id, waiting.front().bytes);
  folded_ += waiting.size() - 1;
  std::vector<Packet> packets;
  for (const Waiting& w : waiting) packets.push_back(*w.packet);
  return Send(id, std::make_shared<const std::vector<std::byte>>(
                      codec::encode_packet(codec::coalesce(packets))));
}

std::vector<Viewers::Send> Viewers::shown(Id id, std::uint64_t sequence) {
  const auto found = viewers_.find(id);
  if (found == viewers_.end()) return {};
  auto& in_flight = found->second.in_flight;
  const auto at = std::find(in_flight.begin(), in_flight.end(), sequence);
  if (at == in_flight.end()) return {};
  in_flight.erase(in_flight.begin(), at + 1);
  auto send = flush(id, found->second);
  return send ? std::vector<Send>{*std::move(send)} : std::vector<Send>{};
}

std::optional<net::Message> Viewers::asked(Id id, const codec::Request& request, TimePoint now) {
  const auto viewer = viewers_.find(id);
  if (viewer == viewers_.end()) return std::nullopt;
  key_frame_wanted_ |= request.key_frame;
  if (request.chunks.empty()) return std::nullopt;
  if (!is_time(viewer->second.answered, kAnswerEvery, now)) {
    ++impatient_;
    return std::nullopt;
  }
  viewer->second.answered = now;
  std::set<ChunkKey> wanted(request.chunks.begin(), request.chunks.end());
  std::vector<EncodedChunk> found;
  for (const ChunkKey& key : wanted)
    if (const auto chunk = chunks_.find(key); chunk != chunks_.end())
      found.push_back(*chunk->second);
  if (found.empty()) return std::nullopt;
  return std::make_shared<const std::vector<std::byte>>(codec::encode_chunks(found));
}

codec::Request Viewers::wanted(TimePoint now) {
  codec::Request request;
  const bool newcomer = std::any_of(viewers_.begin(), viewers_.end(), [](const auto& item) {
    return item.second.fresh && item.second.in_flight.size() < kInFlight;
  });
  if ((newcomer || key_frame_wanted_) && is_time(key_frame_asked_, kKeyFrameEvery, now)) {
    request.key_frame = true;
    key_frame_wanted_ = false;
    key_frame_asked_ = now;
  }
  if (newest_ && !complete() && is_time(chunks_asked_, kChunksEvery, now)) {
    for (const ChunkKey& key : newest_->manifest)
      if (!chunks_.contains(key) && request.chunks.size() < codec::Request::kMaxChunks)
        request.chunks.push_back(key);
    chunks_asked_ = now;
  }
  return request;
}

std::optional<std::uint64_t> Viewers::taken() const {
  if (!newest_) return std::nullopt;
  const auto can_take = [](const auto& item) { return item.second.in_flight.size() < kInFlight; };
  if (viewers_.empty() || std::any_of(viewers_.begin(), viewers_.end(), can_take))
    return newest_->sequence;
  return std::nullopt;
}

std::map<std::string, std::uint64_t> Viewers::drops() const {
  std::map<std::string, std::uint64_t> out;
  if (folded_ > 0) out["viewers: packets folded, a viewer is slow"] = folded_;
  if (impatient_ > 0) out["viewers: requests too soon after the last"] = impatient_;
  if (restarted_ > 0) out["viewers: a slow one had to start anew"] = restarted_;
  return out;
}

}  // namespace mr::node
