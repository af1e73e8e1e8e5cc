#include "mr/gateway/viewers.h"

#include <algorithm>
#include <utility>

#include "mr/codec/packet_message.h"
#include "mr/node/coalesce_packets.h"
#include "mr/node/node_clock.h"

namespace mr::gateway {

void Viewers::opened(Id viewer) { viewers_[viewer]; }
void Viewers::closed(Id viewer) { viewers_.erase(viewer); }

bool Viewers::Viewer::may_get_packet() const {
  return in_flight.size() < kInFlight && unread.size() < kInFlight;
}

bool Viewers::Viewer::has_unread_answer() const {
  return std::any_of(unread.begin(), unread.end(), [](const Unread& u) { return u.is_answer; });
}

bool Viewers::has_shown(Id viewer) const {
  const auto found = viewers_.find(viewer);
  return found != viewers_.end() && found->second.has_shown;
}

std::vector<Viewers::Send> Viewers::packet(Packet packet, net::Message bytes,
                                           std::shared_ptr<const Packet> base, TimePoint now) {
  const auto shared = std::make_shared<const Packet>(std::move(packet));
  base_ = std::move(base);
  take_head(shared);
  keep_units(*shared);
  const bool start = can_start();
  net::Message everything;
  std::vector<Send> out;
  for (auto& [id, viewer] : viewers_) {
    if (viewer.fresh) {
      // Everything is much: whoever has not read what came before waits.
      if (!start || viewer.in_flight.size() >= kInFlight || !viewer.unread.empty()) continue;
      if (!everything) {
        const std::size_t unread = unread_bytes();
        if (unread > 0 && unread + refresh_bytes() > kUnreadBytes) continue;
        everything = refresh(*shared);
      }
      viewer.fresh = false;
      viewer.in_flight.push_back(shared->sequence);
      viewer.unread.push_back({everything, now});
      out.emplace_back(id, everything);
      continue;
    }
    viewer.waiting.push_back({shared, bytes});
    if (viewer.waiting.size() > kMaxWaiting) {
      viewer.waiting.clear();
      viewer.fresh = true;
      ++restarted_;
    }
    if (auto send = flush(id, viewer, now)) out.push_back(*std::move(send));
  }
  return out;
}

void Viewers::begin_afresh() {
  newest_.reset();
  chunks_.clear();
  kept_.clear();
  key_frames_wanted_.clear();
  pacing_.begin_afresh();
  for (auto& [id, viewer] : viewers_) {
    viewer.waiting.clear();
    viewer.in_flight.clear();
    viewer.fresh = true;
  }
}

void Viewers::take_head(const std::shared_ptr<const Packet>& packet) {
  newest_ = packet;
  const auto& manifest = packet->manifest;
  std::erase_if(chunks_, [&](const auto& item) {
    return !std::binary_search(manifest.begin(), manifest.end(), item.first);
  });
  for (const EncodedChunk& chunk : packet->chunks) chunks_[chunk.key] = chunk;
}

/// Keeps what a newcomer needs of each stream, for as long as nothing of it is lost.
void Viewers::keep_units(const Packet& packet) {
  for (const TextureUnit& unit : packet.textures) {
    Kept& kept = kept_[unit.stream];
    const bool follows = !kept.units.empty() && unit.serial == kept.units.back().serial + 1 &&
                         kept.units.size() < kMaxKeptUnits &&
                         kept.bytes + unit.data.size() <= kMaxKeptBytes;
    if (unit.key_frame || !follows) kept = {};
    if (!unit.key_frame && !follows) continue;
    kept.bytes += unit.data.size();
    kept.units.push_back(unit);
  }
  for (const StreamState& state : packet.streams)
    if (const auto kept = kept_.find(state.stream);
        kept != kept_.end() && !kept->second.units.empty() &&
        kept->second.units.back().serial != state.serial)
      kept->second = {};
  std::set<StreamId> used;
  for (const View& view : packet.views) used.insert(view.stream);
  std::erase_if(kept_, [&](const auto& item) { return !used.contains(item.first); });
  pacing_.forget_streams([&](StreamId stream) { return !used.contains(stream); });
  std::erase_if(key_frames_wanted_, [&](StreamId stream) { return !used.contains(stream); });
}

/// The streams that views of the newest packet use and that nobody could start with.
std::set<StreamId> Viewers::streams_without_start() const {
  std::set<StreamId> out;
  if (!newest_) return out;
  for (const View& view : newest_->views) {
    const auto kept = kept_.find(view.stream);
    if (kept == kept_.end() || kept->second.units.empty() ||
        kept->second.units.back().layout != view.layout)
      out.insert(view.stream);
  }
  return out;
}

void Viewers::take_chunks(std::vector<EncodedChunk> chunks) {
  if (!newest_) return;
  const auto& manifest = newest_->manifest;
  for (EncodedChunk& chunk : chunks)
    if (std::binary_search(manifest.begin(), manifest.end(), chunk.key)) {
      const ChunkKey key = chunk.key;
      chunks_[key] = std::move(chunk);
    }
}

bool Viewers::complete() const { return newest_ && chunks_.size() == newest_->manifest.size(); }

/// A packet with its base, all chunks of its manifest, and of each stream what follows its newest
/// key frame.
net::Message Viewers::refresh(const Packet& packet) const {
  Packet all = packet;
  all.coalesced = 0;
  all.chunks.clear();
  for (const auto& [key, chunk] : chunks_) all.chunks.push_back(chunk);
  all.textures.clear();
  for (const auto& [stream, kept] : kept_)
    all.textures.insert(all.textures.end(), kept.units.begin(), kept.units.end());
  return net::as_message(
      codec::encode_packet(all, *base_, codec::change_between(*base_, all), true));
}

std::size_t Viewers::refresh_bytes() const {
  std::size_t bytes = 0;
  for (const auto& [key, chunk] : chunks_) bytes += chunk.payload.size();
  for (const auto& [stream, kept] : kept_) bytes += kept.bytes;
  return bytes;
}

/// What waits for a viewer, as one packet, if it may get one. A fold is the viewer's own, and
/// counts.
std::optional<Viewers::Send> Viewers::flush(Id id, Viewer& viewer, TimePoint now) {
  if (viewer.waiting.empty() || !viewer.may_get_packet()) return std::nullopt;
  if (viewer.waiting.size() > 1 && unread_bytes() > kUnreadBytes) return std::nullopt;
  std::vector<Waiting> waiting;
  waiting.swap(viewer.waiting);
  viewer.in_flight.push_back(waiting.back().packet->sequence);
  folded_ += waiting.size() - 1;
  std::vector<net::Message> messages;
  for (Waiting& w : waiting) messages.push_back(std::move(w.bytes));
  viewer.unread.push_back({node::coalesce_packets(messages), now});
  return Send(id, viewer.unread.back().message);
}

std::vector<Viewers::Send> Viewers::shown(Id id, std::uint64_t sequence, TimePoint now) {
  const auto found = viewers_.find(id);
  if (found == viewers_.end()) return {};
  auto& in_flight = found->second.in_flight;
  const auto at = std::find(in_flight.begin(), in_flight.end(), sequence);
  if (at == in_flight.end()) return {};
  in_flight.erase(in_flight.begin(), at + 1);
  found->second.has_shown = true;
  found->second.last_shown = now;
  auto send = flush(id, found->second, now);
  return send ? std::vector<Send>{*std::move(send)} : std::vector<Send>{};
}

std::vector<Viewers::Send> Viewers::written(Id id, std::size_t messages, TimePoint now) {
  const auto found = viewers_.find(id);
  if (found == viewers_.end()) return {};
  auto& unread = found->second.unread;
  const auto n = static_cast<std::ptrdiff_t>(std::min(messages, unread.size()));
  unread.erase(unread.begin(), unread.begin() + n);
  if (!found->second.first_written) found->second.first_written = now;
  auto send = flush(id, found->second, now);
  return send ? std::vector<Send>{*std::move(send)} : std::vector<Send>{};
}

std::size_t Viewers::unread_bytes() const {
  std::set<const void*> counted;
  std::size_t bytes = 0;
  for (const auto& [id, viewer] : viewers_)
    for (const Unread& unread : viewer.unread)
      if (counted.insert(unread.message.get()).second) bytes += unread.message->size();
  return bytes;
}

std::vector<Viewers::Overdue> Viewers::overdue(TimePoint now) const {
  std::vector<Overdue> out;
  const Id* slowest = nullptr;
  TimePoint since = now - kSlow;
  for (const auto& [id, viewer] : viewers_) {
    const bool waits = !viewer.unread.empty();
    const bool is_full = !waits && viewer.in_flight.size() >= kInFlight;
    if (!viewer.has_shown && viewer.first_written && now - *viewer.first_written > kFirstShown)
      out.push_back({id, "nothing of the stream was acknowledged", !waits});
    else if (is_full && viewer.last_shown && now - *viewer.last_shown > kSlowest)
      out.push_back({id, "nothing was acknowledged for a minute", true});
    else if (waits && now - viewer.unread.front().at > kSlowest)
      out.push_back({id, "too slow: what waits to be read is a minute old", false});
    else if (waits && viewer.unread.front().at < since)
      slowest = &id, since = viewer.unread.front().at;
  }
  if (slowest != nullptr && unread_bytes() > kUnreadBytes / 4 * 3)
    out.push_back({*slowest, "too slow for a busy server", false});
  return out;
}

std::optional<net::Message> Viewers::asked(Id id, const codec::Control& request, TimePoint now) {
  const auto viewer = viewers_.find(id);
  if (viewer == viewers_.end()) return std::nullopt;
  if (newest_)
    for (const View& view : newest_->views)
      if (request.wants_key_frame(view.stream)) key_frames_wanted_.insert(view.stream);
  if (request.whole_head && is_due(viewer->second.began_anew, kAnewEvery, now)) {
    viewer->second.waiting.clear();
    viewer->second.in_flight.clear();  // it cannot use them, so it will not acknowledge them
    viewer->second.fresh = true;
    viewer->second.began_anew = now;
    ++restarted_;
  }
  if (request.chunks.empty()) return std::nullopt;
  if (!is_due(viewer->second.answered, kAnswerEvery, now)) {
    ++impatient_;
    return std::nullopt;
  }
  if (viewer->second.has_unread_answer() || unread_bytes() > kUnreadBytes / 2) {
    ++unread_answers_;
    return std::nullopt;
  }
  viewer->second.answered = now;
  const std::vector<EncodedChunk> found = find_chunks(request.chunks);
  if (found.empty()) return std::nullopt;
  viewer->second.unread.push_back({net::as_message(codec::encode_chunks(found)), now, true});
  return viewer->second.unread.back().message;
}

std::size_t Viewers::still_chunks() const {
  return static_cast<std::size_t>(std::ranges::count_if(
      chunks_, [](const auto& item) { return item.first.id.layer == Layer::still; }));
}

void Viewers::move(Id id, Viewers& to) {
  auto node = viewers_.extract(id);
  if (node.empty()) return;
  Viewer& viewer = node.mapped();
  viewer.fresh = true;
  viewer.waiting.clear(), viewer.in_flight.clear();
  if (!viewer.has_shown) viewer.first_written.reset();  // it has as long as any newcomer
  to.viewers_.insert(std::move(node));
}

/// Those that are there, as many as one answer holds; the rest is asked for again.
std::vector<EncodedChunk> Viewers::find_chunks(const std::vector<ChunkKey>& keys) const {
  const std::set<ChunkKey> wanted(keys.begin(), keys.end());
  std::vector<EncodedChunk> found;
  std::size_t bytes = 0;
  for (const ChunkKey& key : wanted) {
    const auto chunk = chunks_.find(key);
    if (chunk == chunks_.end()) continue;
    bytes += chunk->second.payload.size();
    if (!found.empty() && bytes > kAnswerBytes) break;
    found.push_back(chunk->second);
  }
  return found;
}

/// Streams whose key frame a viewer or a newcomer waits for.
std::set<StreamId> Viewers::key_frames_lacking() const {
  const bool newcomer =
      expects_newcomers_ || std::any_of(viewers_.begin(), viewers_.end(), [](const auto& item) {
        return item.second.fresh && item.second.may_get_packet();
      });
  std::set<StreamId> out = key_frames_wanted_;
  if (newcomer) out.merge(streams_without_start());
  return out;
}

codec::Control Viewers::wanted(bool lacks_base, TimePoint now) {
  codec::Control lacking;
  const std::set<StreamId> streams = key_frames_lacking();
  lacking.key_frames.assign(streams.begin(), streams.end());
  lacking.whole_head = lacks_base;
  if (newest_ && !complete())
    for (const ChunkKey& key : newest_->manifest)
      if (!chunks_.contains(key)) lacking.chunks.push_back(key);
  codec::Control request = pacing_.due(std::move(lacking), now);
  for (const StreamId stream : request.key_frames) key_frames_wanted_.erase(stream);
  return request;
}

bool Viewers::can_take() const {
  return std::ranges::any_of(viewers_,
                             [](const auto& item) { return item.second.may_get_packet(); });
}

std::map<std::string, std::uint64_t> Viewers::drops() const {
  std::map<std::string, std::uint64_t> out;
  if (folded_ > 0) out["viewers: packets folded, a viewer is slow"] = folded_;
  if (impatient_ > 0) out["viewers: requests too soon after the last"] = impatient_;
  if (unread_answers_ > 0)
    out["viewers: requests before the last answer was read"] = unread_answers_;
  if (restarted_ > 0) out["viewers: a slow one had to start anew"] = restarted_;
  return out;
}

}  // namespace mr::gateway
