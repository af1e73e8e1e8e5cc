// Values to FlatBuffers: packet_reader.cpp is the way back.
#include <algorithm>

#include "mr/codec/packet_codec.h"
#include "mr/codec/packet_message.h"
#include "mr/codec/seal.h"
#include "mr/core/assert.h"
#include "packet_generated.h"

namespace mr::codec {
namespace {

namespace fb = flatbuffers;
using Builder = fb::FlatBufferBuilder;

std::int64_t to_ns(TimePoint t) { return t.time_since_epoch().count(); }

wire::Vec3d to_wire(Vec3d v) { return {v.x, v.y, v.z}; }
wire::Pose to_wire(const Pose& T) {
  return {to_wire(T.rotation.row(0)), to_wire(T.rotation.row(1)), to_wire(T.rotation.row(2)),
          to_wire(T.translation)};
}
wire::Rect to_wire(const Rect& r) { return {r.x, r.y, r.width, r.height}; }
wire::ChunkKey to_wire(const ChunkKey& k) {
  return {k.id.cube.x,
          k.id.cube.y,
          k.id.cube.z,
          number_of(k.id.source),
          static_cast<std::uint32_t>(k.id.layer),
          k.level,
          k.version};
}
wire::ViewKey to_wire(const PacketChange::ViewKey& k) {
  return {number_of(k.first), static_cast<std::uint32_t>(k.second)};
}
wire::StreamState to_wire(const StreamState& s) { return {number_of(s.stream), s.serial}; }

/// Eight tiles a byte, the first in the lowest bit.
fb::Offset<wire::TileMask> write(Builder& b, const TileMask& mask) {
  std::vector<std::uint8_t> bits((mask.tiles.size() + 7) / 8);
  for (std::size_t i = 0; i < mask.tiles.size(); ++i)
    bits[i / 8] |= static_cast<std::uint8_t>((mask.tiles[i] != 0) << (i % 8));
  fb::Offset<fb::Vector<std::uint8_t>> list;
  if (!bits.empty()) list = b.CreateVector(bits);
  return wire::CreateTileMask(b, static_cast<std::uint16_t>(mask.tile_px),
                              static_cast<std::uint16_t>(mask.columns),
                              static_cast<std::uint16_t>(mask.rows), list);
}

fb::Offset<wire::Source> write(Builder& b, const SourceInfo& s) {
  const Camera& c = s.depth_camera;
  MR_ASSERT(c.distortion == DistortionModel::none);  // the wire has no room for it
  fb::Offset<fb::Vector<double>> altitude, azimuth;
  if (!c.beam_altitude_rad.empty()) altitude = b.CreateVector(c.beam_altitude_rad);
  if (!c.beam_azimuth_rad.empty()) azimuth = b.CreateVector(c.beam_azimuth_rad);
  const auto camera = wire::CreateCamera(b, static_cast<wire::CameraModel>(c.model), c.width,
                                         c.height, c.fx, c.fy, c.cx, c.cy, altitude, azimuth);
  const wire::Pose pose = to_wire(s.T_world_depth);
  fb::Offset<wire::TileMask> depth, color, blind;
  if (!s.confirmed_depth.empty()) depth = write(b, s.confirmed_depth);
  if (!s.confirmed_color.empty()) color = write(b, s.confirmed_color);
  if (!s.blind_color.empty()) blind = write(b, s.blind_color);
  return wire::CreateSource(b, number_of(s.sensor), camera, &pose, s.precision.base_m,
                            s.precision.per_m2, depth, color, blind);
}

fb::Offset<wire::Confirmed> write(Builder& b, const PacketChange::Confirmed& c) {
  fb::Offset<wire::TileMask> depth, color, blind;
  if (c.depth) depth = write(b, *c.depth);
  if (c.color) color = write(b, *c.color);
  if (c.blind) blind = write(b, *c.blind);
  return wire::CreateConfirmed(b, number_of(c.sensor), depth, color, blind);
}

fb::Offset<wire::View> write(Builder& b, const View& v) {
  const wire::Pose pose = to_wire(v.T_world_camera);
  const wire::Rect image = to_wire(v.image_rect), atlas = to_wire(v.atlas_rect);
  const wire::Gain gain{v.gain.x, v.gain.y, v.gain.z};
  return wire::CreateView(b, number_of(v.id), static_cast<wire::ViewKind>(v.kind), v.width,
                          v.height, v.fx, v.fy, v.cx, v.cy, &pose, &image, &atlas, v.gutter_px,
                          number_of(v.stream), v.layout, static_cast<std::uint8_t>(v.layer),
                          v.gain == Vec3f{1, 1, 1} ? nullptr : &gain);
}

fb::Offset<wire::Plan> write(Builder& b, const CodingPlan& p) {
  const auto f = [](double v) { return static_cast<float>(v); };
  return wire::CreatePlan(b, f(p.decimation.ratio), p.mesh_speed, f(p.texture_scale), p.texture_qp,
                          f(p.decimation.error_m), f(p.still_error_m), f(p.plate_scale),
                          p.plate_qp);
}

fb::Offset<fb::Vector<std::uint8_t>> write_bytes(Builder& b, const SharedBytes& bytes) {
  b.ForceVectorAlignment(bytes.size(), 1, 8);
  return b.CreateVector(reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size());
}

/// Nothing where there are none.
template <typename Id>
fb::Offset<fb::Vector<std::uint32_t>> write_ids(Builder& b, const std::vector<Id>& ids) {
  if (ids.empty()) return {};
  std::vector<std::uint32_t> numbers;
  for (const Id id : ids) numbers.push_back(number_of(id));
  return b.CreateVector(numbers);
}

fb::Offset<fb::Vector<std::uint32_t>> write_ranges(Builder& b,
                                                   const std::vector<TriangleRange>& ranges) {
  if (ranges.empty()) return {};
  std::vector<std::uint32_t> numbers;
  for (const TriangleRange& r : ranges) numbers.push_back(r.first), numbers.push_back(r.count);
  return b.CreateVector(numbers);
}

fb::Offset<wire::Chunk> write(Builder& b, const EncodedChunk& c) {
  const auto views = write_ids(b, c.views), sensors = write_ids(b, c.sensors);
  const auto guessed = write_ranges(b, c.guessed);
  const auto payload = write_bytes(b, c.payload);
  const wire::ChunkKey key = to_wire(c.key);
  return wire::CreateChunk(b, &key, c.error_m, c.triangles, views, payload, sensors, guessed);
}

fb::Offset<wire::Texture> write(Builder& b, const TextureUnit& t) {
  const auto data = write_bytes(b, t.data);
  return wire::CreateTexture(b, number_of(t.stream), static_cast<wire::TextureCodec>(t.codec),
                             t.layout, t.width, t.height, t.key_frame, data, t.serial);
}

fb::Offset<wire::Features> write(Builder& b, const FrameFeatures& f) {
  return wire::CreateFeatures(b, number_of(f.sensor), f.has_color, b.CreateVector(f.values));
}

fb::Offset<wire::Alpha> write(Builder& b, const AlphaPlane& a) {
  const auto data =
      b.CreateVector(reinterpret_cast<const std::uint8_t*>(a.data.data()), a.data.size());
  return wire::CreateAlpha(b, number_of(a.stream), static_cast<std::uint8_t>(a.step_px),
                           static_cast<std::uint16_t>(a.width),
                           static_cast<std::uint16_t>(a.height), data);
}

template <typename Out, typename Value>
fb::Offset<fb::Vector<fb::Offset<Out>>> write_all(Builder& b, const std::vector<Value>& values) {
  std::vector<fb::Offset<Out>> offsets;
  offsets.reserve(values.size());
  for (const Value& value : values) offsets.push_back(write(b, value));
  return b.CreateVector(offsets);
}

/// As write_all(), of structs; nothing for an empty list.
template <typename Out, typename Value>
fb::Offset<fb::Vector<const Out*>> write_structs(Builder& b, const std::vector<Value>& values) {
  if (values.empty()) return 0;
  std::vector<Out> out;
  out.reserve(values.size());
  for (const Value& value : values) out.push_back(to_wire(value));
  return b.CreateVectorOfStructs(out);
}

template <typename Out, typename Value>
fb::Offset<fb::Vector<fb::Offset<Out>>> write_some(Builder& b, const std::vector<Value>& values) {
  return values.empty() ? fb::Offset<fb::Vector<fb::Offset<Out>>>() : write_all<Out>(b, values);
}

fb::Offset<wire::Head> write_head(Builder& b, const Packet& head) {
  const auto scene = b.CreateString(head.scene), node = b.CreateString(head.node);
  const auto plan = write(b, head.plan);
  const auto sources = write_some<wire::Source>(b, head.sources);
  const auto views = write_some<wire::View>(b, head.views);
  const auto manifest = write_structs<wire::ChunkKey>(b, head.manifest);
  const auto streams = write_structs<wire::StreamState>(b, head.streams);
  std::vector<fb::Offset<fb::String>> stages;
  for (const TimeMark& mark : head.marks) stages.push_back(b.CreateString(mark.stage));
  fb::Offset<fb::Vector<fb::Offset<fb::String>>> stage_list;
  if (!stages.empty()) stage_list = b.CreateVector(stages);
  return wire::CreateHead(b, scene, node, plan, sources, views, manifest, streams, stage_list);
}

fb::Offset<wire::Change> write_change(Builder& b, const PacketChange& c) {
  if (c.empty()) return 0;
  const auto removed = write_structs<wire::ChunkKey>(b, c.removed);
  const auto added = write_structs<wire::ChunkKey>(b, c.added);
  const auto removed_views = write_structs<wire::ViewKey>(b, c.removed_views);
  const auto views = write_some<wire::View>(b, c.views);
  const auto removed_sources = write_ids(b, c.removed_sources);
  const auto sources = write_some<wire::Source>(b, c.sources);
  const auto confirmed = write_some<wire::Confirmed>(b, c.confirmed);
  fb::Offset<wire::Plan> plan;
  if (c.plan) plan = write(b, *c.plan);
  // Lists that are there and empty say something else than lists that are absent.
  fb::Offset<fb::Vector<fb::Offset<fb::String>>> stages;
  if (c.stages) stages = b.CreateVectorOfStrings(*c.stages);
  fb::Offset<fb::Vector<const wire::StreamState*>> streams;
  if (c.streams) {
    std::vector<wire::StreamState> states;
    for (const StreamState& state : *c.streams) states.push_back(to_wire(state));
    streams = b.CreateVectorOfStructs(states);
  }
  return wire::CreateChange(b, removed, added, removed_views, views, removed_sources, sources,
                            confirmed, plan, stages, streams);
}

/// Times after `from`: 32 bits each where all of them fit, else ns since 1970.
struct WrittenTimes {
  fb::Offset<fb::Vector<std::int32_t>> delays;
  fb::Offset<fb::Vector<std::int64_t>> times;
};

WrittenTimes write_times(Builder& b, TimePoint from, const std::vector<TimePoint>& times) {
  if (times.empty()) return {};
  std::vector<std::int32_t> delays;
  std::vector<std::int64_t> absolute;
  for (const TimePoint t : times) {
    absolute.push_back(to_ns(t));
    // Modulo 2^64: times that are no times overflow.
    const auto delay = static_cast<std::int64_t>(static_cast<std::uint64_t>(to_ns(t)) -
                                                 static_cast<std::uint64_t>(to_ns(from)));
    if (delay >= INT32_MIN && delay <= INT32_MAX)
      delays.push_back(static_cast<std::int32_t>(delay));
  }
  if (delays.size() == times.size()) return {b.CreateVector(delays), {}};
  return {{}, b.CreateVector(absolute)};
}

/// What the bytes of a packet are made of; `base` where they bring it.
struct Parts {
  std::uint32_t epoch = 0;
  std::uint64_t sequence = 0;
  std::uint32_t age = 0, coalesced = 0;
  TimePoint captured_at{};
  const std::vector<TimePoint>&source_times, &mark_times;
  const Packet* base;
  const PacketChange& change;
  const std::vector<EncodedChunk>& chunks;
  const std::vector<TextureUnit>& textures;
  const std::vector<AlphaPlane>& alpha;
  const std::vector<FrameFeatures>& features;
};

std::size_t expected_bytes(const Parts& parts) {
  std::size_t bytes = 1024 + 32 * (parts.change.removed.size() + parts.change.added.size());
  if (parts.base != nullptr)
    bytes += 4096 + 512 * parts.base->views.size() + 32 * parts.base->manifest.size();
  for (const EncodedChunk& c : parts.chunks) bytes += c.payload.size() + 96;
  for (const TextureUnit& t : parts.textures) bytes += t.data.size() + 96;
  for (const AlphaPlane& a : parts.alpha) bytes += a.data.size() + 64;
  return bytes;
}

std::vector<std::byte> sealed_bytes(const Builder& b) {
  const auto* bytes = reinterpret_cast<const std::byte*>(b.GetBufferPointer());
  std::vector<std::byte> out;
  out.reserve(b.GetSize() + kSealBytes);
  out.assign(bytes, bytes + b.GetSize());
  seal(out);
  return out;
}

std::vector<std::byte> encode(const Parts& parts) {
  Builder b(expected_bytes(parts));
  fb::Offset<wire::Head> head;
  if (parts.base != nullptr) head = write_head(b, *parts.base);
  const auto change = write_change(b, parts.change);
  const auto chunks = write_some<wire::Chunk>(b, parts.chunks);
  const auto textures = write_some<wire::Texture>(b, parts.textures);
  const auto alpha = write_some<wire::Alpha>(b, parts.alpha);
  const auto features = write_some<wire::Features>(b, parts.features);
  const WrittenTimes sources = write_times(b, parts.captured_at, parts.source_times);
  const WrittenTimes marks = write_times(b, parts.captured_at, parts.mark_times);
  wire::FinishPacketBuffer(
      b, wire::CreatePacket(b, parts.epoch, parts.sequence, to_ns(parts.captured_at), parts.age,
                            sources.delays, marks.delays, textures, chunks, change, head,
                            parts.coalesced, sources.times, marks.times, alpha, features));
  return sealed_bytes(b);
}

}  // namespace

std::vector<std::byte> encode_packet(const Packet& packet, const Packet& base,
                                     const PacketChange& change, bool bring) {
  std::vector<TimePoint> source_times, mark_times;
  for (const SourceInfo& source : packet.sources) source_times.push_back(source.captured_at);
  for (const TimeMark& mark : packet.marks) mark_times.push_back(mark.at);
  return encode({.epoch = packet.epoch,
                 .sequence = packet.sequence,
                 .age = static_cast<std::uint32_t>(packet.sequence - base.sequence),
                 .coalesced = packet.coalesced,
                 .captured_at = packet.captured_at,
                 .source_times = source_times,
                 .mark_times = mark_times,
                 .base = bring ? &base : nullptr,
                 .change = change,
                 .chunks = packet.chunks,
                 .textures = packet.textures,
                 .alpha = packet.alpha,
                 .features = packet.features});
}

std::vector<std::byte> encode_packet(const Packet& packet) {
  PacketChange change;  // to itself: what its units do not tell
  if (streams_after(packet.streams, packet.textures) != packet.streams)
    change.streams = packet.streams;
  return encode_packet(packet, packet, change, true);
}

std::vector<std::byte> encode_message(const PacketMessage& message) {
  return encode({.epoch = message.epoch,
                 .sequence = message.sequence,
                 .age = message.age,
                 .coalesced = message.coalesced,
                 .captured_at = message.captured_at,
                 .source_times = message.source_times,
                 .mark_times = message.mark_times,
                 .base = message.base.get(),
                 .change = message.change,
                 .chunks = message.chunks,
                 .textures = message.textures,
                 .alpha = message.alpha,
                 .features = message.features});
}

std::vector<std::byte> encode_chunks(std::span<const EncodedChunk> chunks) {
  Builder b(1024);
  std::vector<fb::Offset<wire::Chunk>> all;
  for (const EncodedChunk& chunk : chunks) all.push_back(write(b, chunk));
  const auto list = b.CreateVector(all);
  b.Finish(wire::CreateChunks(b, list), kChunksIdentifier);
  return sealed_bytes(b);
}

}  // namespace mr::codec
