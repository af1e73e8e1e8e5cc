#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <string>
#include <utility>

#include "mr/codec/packet_message.h"
#include "mr/core/assert.h"

namespace mr::codec {
namespace {

PacketChange::ViewKey key_of(const View& view) { return {view.id, view.layer}; }
SensorId key_of(const SourceInfo& source) { return source.sensor; }
ChunkKey key_of(const ChunkKey& key) { return key; }

/// Whether two sources are equal except for time and masks.
bool same_sensor(const SourceInfo& a, const SourceInfo& b) {
  return a.depth_camera == b.depth_camera && a.T_world_depth == b.T_world_depth &&
         a.precision == b.precision;
}

std::vector<std::string> stages_of(const Packet& packet) {
  std::vector<std::string> out;
  for (const TimeMark& mark : packet.marks) out.push_back(mark.stage);
  return out;
}

/// Merges two lists sorted by key: calls gone(item) for keys only in a, come(item) for keys only in
/// b, both(item of a, item of b) for keys in both.
template <typename T, typename Gone, typename Come, typename Both>
void compare(const std::vector<T>& a, const std::vector<T>& b, Gone gone, Come come, Both both) {
  auto i = a.begin(), j = b.begin();
  while (i != a.end() || j != b.end()) {
    if (j == b.end() || (i != a.end() && key_of(*i) < key_of(*j)))
      gone(*i++);
    else if (i == a.end() || key_of(*j) < key_of(*i))
      come(*j++);
    else
      both(*i++, *j++);
  }
}

void compare_sources(const Packet& base, const Packet& packet, PacketChange& out) {
  const auto add = [&](const SourceInfo& source) {
    out.sources.push_back(source);
    out.sources.back().captured_at = {};
  };
  compare(
      base.sources, packet.sources,
      [&](const SourceInfo& gone) { out.removed_sources.push_back(gone.sensor); }, add,
      [&](const SourceInfo& before, const SourceInfo& now) {
        if (!same_sensor(before, now)) return add(now);
        const bool depth = before.confirmed_depth != now.confirmed_depth;
        const bool color = before.confirmed_color != now.confirmed_color;
        const bool blind = before.blind_color != now.blind_color;
        if (!depth && !color && !blind) return;
        PacketChange::Confirmed& masks = out.confirmed.emplace_back();
        masks.sensor = now.sensor;
        if (depth) masks.depth = now.confirmed_depth;
        if (color) masks.color = now.confirmed_color;
        if (blind) masks.blind = now.blind_color;
      });
}

Error misfit(const std::string& what) { return {Error::Cause::invalid, "packet: " + what}; }

/// Applies removals, additions and replacements to `base`; false: a removed item does not exist.
template <typename T, typename Key>
bool change_list(std::vector<T>& list, const std::vector<Key>& removed,
                 const std::vector<T>& come) {
  auto gone = removed.begin();
  std::vector<T> kept;
  kept.reserve(list.size() + come.size());
  for (T& item : list) {
    if (gone != removed.end() && key_of(item) == *gone)
      ++gone;
    else
      kept.push_back(std::move(item));
  }
  if (gone != removed.end()) return false;
  list.clear();
  auto old = kept.begin();
  for (const T& item : come) {
    while (old != kept.end() && key_of(*old) < key_of(item)) list.push_back(std::move(*old++));
    if (old != kept.end() && key_of(*old) == key_of(item)) ++old;
    list.push_back(item);
  }
  std::move(old, kept.end(), std::back_inserter(list));
  return true;
}

Status change_masks(std::vector<SourceInfo>& sources, std::vector<PacketChange::Confirmed> masks) {
  for (PacketChange::Confirmed& mask : masks) {
    const auto at = std::lower_bound(
        sources.begin(), sources.end(), mask.sensor,
        [](const SourceInfo& source, SensorId sensor) { return source.sensor < sensor; });
    if (at == sources.end() || at->sensor != mask.sensor)
      return misfit("a mask of a sensor that it does not name");
    if (mask.depth) at->confirmed_depth = *std::move(mask.depth);
    if (mask.color) at->confirmed_color = *std::move(mask.color);
    if (mask.blind) at->blind_color = *std::move(mask.blind);
  }
  return {};
}

Status change_head(Packet& packet, PacketMessage& message) {
  PacketChange& change = message.change;
  if (!change_list(packet.manifest, change.removed, {})) return misfit("it removes unknown chunks");
  const std::size_t expected = packet.manifest.size() + change.added.size();
  change_list(packet.manifest, std::vector<ChunkKey>{}, change.added);
  if (packet.manifest.size() != expected) return misfit("it adds chunks that were there");
  if (!change_list(packet.views, change.removed_views, change.views))
    return misfit("it removes unknown views");
  if (!change_list(packet.sources, change.removed_sources, change.sources))
    return misfit("it removes unknown sensors");
  if (const Status masked = change_masks(packet.sources, std::move(change.confirmed)); !masked)
    return masked;
  if (change.plan) packet.plan = *change.plan;
  if (change.stages) {
    packet.marks.clear();
    for (std::string& stage : *change.stages) packet.marks.push_back({std::move(stage), {}});
  }
  packet.streams =
      change.streams ? *std::move(change.streams) : streams_after(packet.streams, message.textures);
  return {};
}

Status set_times(Packet& packet, const PacketMessage& message) {
  if (packet.sources.size() != message.source_times.size() ||
      packet.marks.size() != message.mark_times.size())
    return misfit("not one time for each sensor and mark");
  for (std::size_t i = 0; i < packet.sources.size(); ++i)
    packet.sources[i].captured_at = message.source_times[i];
  for (std::size_t i = 0; i < packet.marks.size(); ++i) packet.marks[i].at = message.mark_times[i];
  return {};
}

bool fits(const TileMask& mask, int width, int height) {
  return mask.empty() || mask.is_of(width, height);
}

Status check_masks(const Packet& packet, const PacketLimits& limits) {
  std::map<ViewId, Vec2i> size;
  for (const View& view : packet.views) size.emplace(view.id, Vec2i{view.width, view.height});
  std::uint64_t tiles = 0;
  for (const SourceInfo& source : packet.sources) {
    tiles += source.confirmed_depth.tiles.size() + source.confirmed_color.tiles.size() +
             source.blind_color.tiles.size();
    const auto color = size.find(view_of(source.sensor));
    const auto fits_color = [&](const TileMask& mask) {
      return color == size.end() || fits(mask, color->second.x, color->second.y);
    };
    if (!fits(source.confirmed_depth, source.depth_camera.width, source.depth_camera.height) ||
        !fits_color(source.confirmed_color) || !fits_color(source.blind_color))
      return misfit("a mask of another picture");
  }
  if (tiles > limits.mask_tiles) return Error{Error::Cause::too_large, "packet: too many tiles"};
  return {};
}

/// The checks that need the complete packet.
Status check_whole(const Packet& packet, const PacketLimits& limits) {
  const auto too_many = [](const char* what) {
    return Error{Error::Cause::too_large, std::string("packet: too many ") + what};
  };
  if (packet.manifest.size() > limits.manifest_chunks) return too_many("chunks in the manifest");
  if (packet.views.size() > limits.views) return too_many("views");
  if (packet.sources.size() > limits.views) return too_many("sources");
  if (packet.streams.size() > limits.views) return too_many("streams");
  if (packet.marks.size() > limits.marks) return too_many("marks");
  for (const EncodedChunk& chunk : packet.chunks)
    if (!std::binary_search(packet.manifest.begin(), packet.manifest.end(), chunk.key))
      return misfit("a chunk that the manifest does not name");
  std::map<StreamId, Vec2i> texture;  // the newest of each stream
  for (const TextureUnit& unit : packet.textures) texture[unit.stream] = {unit.width, unit.height};
  for (const View& view : packet.views)
    if (const auto at = texture.find(view.stream);
        at != texture.end() && (view.atlas_rect.width > at->second.x - view.atlas_rect.x ||
                                view.atlas_rect.height > at->second.y - view.atlas_rect.y))
      return misfit("a view's atlas_rect outside its texture");
  return check_masks(packet, limits);
}

}  // namespace

std::vector<StreamState> streams_after(const std::vector<StreamState>& before,
                                       const std::vector<TextureUnit>& units) {
  std::map<StreamId, std::uint32_t> serials;
  for (const StreamState& state : before) serials[state.stream] = state.serial;
  for (const TextureUnit& unit : units) serials[unit.stream] = unit.serial;
  std::vector<StreamState> out;
  for (const auto& [stream, serial] : serials) out.push_back({stream, serial});
  return out;
}

std::shared_ptr<const Packet> base_of(const Packet& packet) {
  auto out = std::make_shared<Packet>();
  out->scene = packet.scene, out->node = packet.node;
  out->epoch = packet.epoch, out->sequence = packet.sequence;
  out->sources = packet.sources;
  for (SourceInfo& source : out->sources) source.captured_at = {};
  out->plan = packet.plan;
  out->views = packet.views;
  out->manifest = packet.manifest;
  out->streams = packet.streams;
  for (const TimeMark& mark : packet.marks) out->marks.push_back({mark.stage, {}});
  return out;
}

PacketChange change_between(const Packet& base, const Packet& packet) {
  PacketChange out;
  compare(
      base.manifest, packet.manifest, [&](const ChunkKey& gone) { out.removed.push_back(gone); },
      [&](const ChunkKey& come) { out.added.push_back(come); },
      [](const ChunkKey&, const ChunkKey&) {});
  compare(
      base.views, packet.views,
      [&](const View& gone) { out.removed_views.push_back(key_of(gone)); },
      [&](const View& come) { out.views.push_back(come); },
      [&](const View& before, const View& now) {
        if (before != now) out.views.push_back(now);
      });
  compare_sources(base, packet, out);
  if (base.plan != packet.plan) out.plan = packet.plan;
  if (auto stages = stages_of(packet); stages != stages_of(base)) out.stages = std::move(stages);
  if (streams_after(base.streams, packet.textures) != packet.streams) out.streams = packet.streams;
  return out;
}

Result<Packet> complete(PacketMessage message, const Packet& base, const PacketLimits& limits) {
  MR_ASSERT(base.chunks.empty() && base.textures.empty() && base.alpha.empty());
  Packet packet = base;
  packet.epoch = message.epoch, packet.sequence = message.sequence;
  packet.coalesced = message.coalesced;
  packet.captured_at = message.captured_at;
  if (const Status changed = change_head(packet, message); !changed) return changed.error();
  if (const Status timed = set_times(packet, message); !timed) return timed.error();
  packet.chunks = std::move(message.chunks);
  packet.textures = std::move(message.textures);
  packet.alpha = std::move(message.alpha);
  packet.features = std::move(message.features);
  if (const Status sound = check_whole(packet, limits); !sound) return sound.error();
  return packet;
}

}  // namespace mr::codec
