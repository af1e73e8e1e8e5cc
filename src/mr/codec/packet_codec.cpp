#include "mr/codec/packet_codec.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <map>

#include "mr/core/assert.h"
#include "packet_generated.h"

namespace mr::codec {
namespace {

namespace fb = flatbuffers;
using Builder = fb::FlatBufferBuilder;

constexpr std::size_t kMaxViewsOfChunk = 254;
constexpr fb::uoffset_t kMaxDepth = 8, kMaxTables = 1u << 18;
constexpr const char* kChunksIdentifier = "MRCH";

// ---- values → FlatBuffers ----

std::int64_t to_ns(TimePoint t) { return t.time_since_epoch().count(); }

wire::Vec3d to_wire(Vec3d v) { return {v.x, v.y, v.z}; }
wire::Pose to_wire(const Pose& T) {
  return {to_wire(T.rotation.row(0)), to_wire(T.rotation.row(1)), to_wire(T.rotation.row(2)),
          to_wire(T.translation)};
}
wire::Rect to_wire(const Rect& r) { return {r.x, r.y, r.width, r.height}; }
wire::ChunkKey to_wire(const ChunkKey& k) {
  return {k.id.cube.x, k.id.cube.y, k.id.cube.z, k.id.source, k.level, k.version};
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
  return wire::CreateSource(b, s.sensor, to_ns(s.captured_at), camera, &pose, s.precision.base_m,
                            s.precision.per_m2);
}

fb::Offset<wire::View> write(Builder& b, const View& v) {
  const wire::Pose pose = to_wire(v.T_world_camera);
  const wire::Rect image = to_wire(v.image_rect), atlas = to_wire(v.atlas_rect);
  return wire::CreateView(b, v.id, static_cast<wire::ViewKind>(v.kind), v.width, v.height, v.fx,
                          v.fy, v.cx, v.cy, &pose, &image, &atlas, v.gutter_px, v.stream, v.layout);
}

fb::Offset<fb::Vector<std::uint8_t>> write_bytes(Builder& b, const std::vector<std::byte>& bytes) {
  b.ForceVectorAlignment(bytes.size(), 1, 8);
  return b.CreateVector(reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size());
}

fb::Offset<wire::Chunk> write(Builder& b, const EncodedChunk& c) {
  fb::Offset<fb::Vector<std::uint32_t>> views;
  if (!c.views.empty()) views = b.CreateVector(c.views);
  const auto payload = write_bytes(b, c.payload);
  const wire::ChunkKey key = to_wire(c.key);
  return wire::CreateChunk(b, &key, c.error_m, c.triangles, views, payload);
}

fb::Offset<wire::Texture> write(Builder& b, const TextureUnit& t) {
  const auto data = write_bytes(b, t.data);
  return wire::CreateTexture(b, t.stream, static_cast<wire::TextureCodec>(t.codec), t.layout,
                             t.width, t.height, t.key_frame, data);
}

fb::Offset<wire::Mark> write(Builder& b, const TimeMark& m) {
  const auto stage = b.CreateString(m.stage);
  return wire::CreateMark(b, stage, to_ns(m.at));
}

template <typename Out, typename Value>
fb::Offset<fb::Vector<fb::Offset<Out>>> write_all(Builder& b, const std::vector<Value>& values) {
  std::vector<fb::Offset<Out>> offsets;
  offsets.reserve(values.size());
  for (const Value& value : values) offsets.push_back(write(b, value));
  return b.CreateVector(offsets);
}

std::size_t expected_bytes(const Packet& packet) {
  std::size_t bytes = 4096 + 512 * packet.views.size() + 24 * packet.manifest.size();
  for (const EncodedChunk& c : packet.chunks) bytes += c.payload.size() + 96;
  for (const TextureUnit& t : packet.textures) bytes += t.data.size() + 96;
  return bytes;
}

// ---- FlatBuffers → values, every one of them checked ----

Error invalid_packet(const std::string& what) { return {Error::Cause::invalid, "packet: " + what}; }
Error too_large_packet(const std::string& what) {
  return {Error::Cause::too_large, "packet: " + what};
}

bool is_finite(const Pose& T) {
  for (const double v : T.rotation.m)
    if (!std::isfinite(v)) return false;
  return mr::is_finite(T.translation);
}

bool is_rigid(const Pose& T) {
  constexpr double kTolerance = 1e-3, kFarthest_m = 1e8;
  if (!is_finite(T)) return false;
  for (int i = 0; i < 3; ++i) {
    if (std::abs(T.translation[i]) > kFarthest_m) return false;
    for (int j = 0; j <= i; ++j)
      if (std::abs(dot(T.rotation.column(i), T.rotation.column(j)) - (i == j)) > kTolerance)
        return false;
  }
  return dot(cross(T.rotation.column(0), T.rotation.column(1)), T.rotation.column(2)) > 0;
}

/// `inner` is not empty and lies in [0, width] x [0, height].
bool fits(const Rect& inner, int width, int height) {
  return !inner.empty() && inner.x >= 0 && inner.y >= 0 && inner.width <= width - inner.x &&
         inner.height <= height - inner.y;
}

/// Values from `low` to `high`, numbers only.
bool within(double value, double low, double high) { return value >= low && value <= high; }

Vec3d read(const wire::Vec3d& v) { return {v.x(), v.y(), v.z()}; }
Pose read(const wire::Pose& p) {
  Pose T;
  const wire::Vec3d* rows[] = {&p.row0(), &p.row1(), &p.row2()};
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c) T.rotation(r, c) = read(*rows[r])[c];
  T.translation = read(p.translation());
  return T;
}
Rect read(const wire::Rect& r) { return {r.x(), r.y(), r.width(), r.height()}; }
ChunkKey read(const wire::ChunkKey& k) {
  return {{{k.x(), k.y(), k.z()}, k.source()}, k.level(), k.version()};
}

template <typename Vector>
std::size_t size_of(const Vector* vector) {
  return vector == nullptr ? 0 : vector->size();
}

/// Reads one verified buffer. Each step returns false once `error_` is set.
class Reader {
 public:
  Reader(std::size_t bytes, const PacketLimits& limits) : limits_(limits), unread_(bytes) {}

  Result<Packet> read(const wire::Packet& in) {
    if (read_head(in) && read_plan(*in.plan()) && read_sources(in.sources()) &&
        read_manifest(in.manifest()) && read_packet_chunks(in.chunks()) &&
        read_textures(in.textures()) && read_views(in.views()) && read_marks(in.marks()))
      return std::move(out_);
    return error_;
  }

  Result<std::vector<EncodedChunk>> read(const wire::Chunks& in) {
    if (size_of(in.chunks()) > limits_.manifest_chunks) return too_large_packet("too many chunks");
    if (read_chunks(in.chunks())) return std::move(out_.chunks);
    return error_;
  }

 private:
  bool fail(Error error) {
    error_ = std::move(error);
    return false;
  }
  bool require(bool condition, const char* what) { return condition || fail(invalid_packet(what)); }

  /// Offsets may overlap, so a small buffer can name the same bytes often: what is copied out of
  /// it may not exceed what came in.
  bool spend(std::size_t bytes) {
    if (bytes > unread_) return fail(invalid_packet("fields overlap"));
    unread_ -= bytes;
    return true;
  }

  bool read_name(const fb::String& in, std::string& out, const char* what) {
    if (in.size() > limits_.name_bytes)
      return fail(too_large_packet(std::string(what) + " is too long"));
    if (!spend(in.size())) return false;
    for (const char c : in)
      if (c < ' ' || c > '~')
        return fail(invalid_packet(std::string(what) + " is not printable ASCII"));
    out.assign(in.c_str(), in.size());
    return true;
  }

  bool read_time(std::int64_t ns, TimePoint& out) {
    out = TimePoint(Duration(ns));
    // Sums and differences of times must not overflow.
    constexpr std::int64_t kCenturies = std::int64_t{1} << 61;
    return require(ns > -kCenturies && ns < kCenturies, "a time out of range");
  }

  bool read_bytes(const fb::Vector<std::uint8_t>& in, std::vector<std::byte>& out) {
    if (!require(in.size() > 0, "an empty payload") || !spend(in.size())) return false;
    const auto* data = reinterpret_cast<const std::byte*>(in.data());
    out.assign(data, data + in.size());
    return true;
  }

  bool read_head(const wire::Packet& in) {
    out_.epoch = in.epoch();
    out_.sequence = in.sequence();
    out_.coalesced = in.coalesced();
    return require(out_.coalesced <= out_.sequence, "more folded packets than there were") &&
           read_name(*in.scene(), out_.scene, "the scene's name") &&
           read_name(*in.node(), out_.node, "the node's name") &&
           read_time(in.captured_at_ns(), out_.captured_at);
  }

  bool read_plan(const wire::Plan& plan) {
    out_.plan = {plan.simplify_ratio(), plan.mesh_speed(), plan.texture_scale(), plan.texture_qp()};
    return require(within(plan.simplify_ratio(), 0, 1) && within(plan.mesh_speed(), 0, 10) &&
                       within(plan.texture_scale(), 0, 16) && within(plan.texture_qp(), 0, 51),
                   "an impossible coding plan");
  }

  bool read_beams(const fb::Vector<double>* in, std::vector<double>& out) {
    if (!spend(8 * size_of(in))) return false;
    for (std::size_t i = 0; i < size_of(in); ++i) {
      out.push_back(in->Get(static_cast<fb::uoffset_t>(i)));
      if (!within(out.back(), -7, 7)) return fail(invalid_packet("an impossible LiDAR beam"));
    }
    return true;
  }

  bool read_camera(const wire::Camera& in, Camera& out) {
    if (!require(in.model() <= wire::CameraModel::lidar, "an unknown camera model")) return false;
    out.model = static_cast<CameraModel>(in.model());
    out.width = in.width(), out.height = in.height();
    out.fx = in.fx(), out.fy = in.fy(), out.cx = in.cx(), out.cy = in.cy();
    if (!read_beams(in.beam_altitude_rad(), out.beam_altitude_rad) ||
        !read_beams(in.beam_azimuth_rad(), out.beam_azimuth_rad))
      return false;
    return check_camera(out);
  }

  bool check_camera(const Camera& camera) {
    for (const double v : {camera.fx, camera.fy, camera.cx, camera.cy})
      if (!std::isfinite(v)) return fail(invalid_packet("intrinsics that are not finite"));
    const auto problems = camera.problems();
    return problems.empty() || fail(invalid_packet("a camera whose " + problems.front()));
  }

  bool read_sources(const fb::Vector<fb::Offset<wire::Source>>* all) {
    if (size_of(all) > limits_.views) return fail(too_large_packet("too many sources"));
    for (std::size_t i = 0; i < size_of(all); ++i) {
      const wire::Source& in = *all->Get(static_cast<fb::uoffset_t>(i));
      SourceInfo& out = out_.sources.emplace_back();
      out.sensor = in.sensor();
      out.T_world_depth = mr::codec::read(*in.t_world_depth());
      out.precision = {in.sigma_base_m(), in.sigma_per_m2()};
      if (!require(i == 0 || out_.sources[i - 1].sensor < out.sensor, "unsorted sources") ||
          !read_time(in.captured_at_ns(), out.captured_at) ||
          !read_camera(*in.depth_camera(), out.depth_camera) ||
          !require(is_rigid(out.T_world_depth), "a pose that is not rigid") ||
          !require(within(out.precision.base_m, 0, 1e3) && within(out.precision.per_m2, 0, 1e3),
                   "an impossible precision"))
        return false;
    }
    return true;
  }

  bool read_manifest(const fb::Vector<const wire::ChunkKey*>* all) {
    const std::size_t count = size_of(all);
    if (count > limits_.manifest_chunks)
      return fail(too_large_packet("too many chunks in the manifest"));
    out_.manifest.reserve(count);
    for (std::size_t i = 0; i < count; ++i) {
      out_.manifest.push_back(mr::codec::read(*all->Get(static_cast<fb::uoffset_t>(i))));
      if (!require(i == 0 || out_.manifest[i - 1] < out_.manifest[i], "an unsorted manifest"))
        return false;
    }
    return true;
  }

  bool read_packet_chunks(const fb::Vector<fb::Offset<wire::Chunk>>* all) {
    const auto named = [&](const EncodedChunk& chunk) {
      return std::binary_search(out_.manifest.begin(), out_.manifest.end(), chunk.key);
    };
    return require(size_of(all) <= out_.manifest.size(), kUnnamed) && read_chunks(all) &&
           require(std::all_of(out_.chunks.begin(), out_.chunks.end(), named), kUnnamed);
  }

  bool read_chunks(const fb::Vector<fb::Offset<wire::Chunk>>* all) {
    for (std::size_t i = 0; i < size_of(all); ++i) {
      const wire::Chunk& in = *all->Get(static_cast<fb::uoffset_t>(i));
      EncodedChunk& out = out_.chunks.emplace_back();
      out.key = mr::codec::read(*in.key());
      out.error_m = in.error_m();
      out.triangles = in.triangles();
      triangles_ += in.triangles();
      if (in.triangles() > limits_.chunk_triangles || triangles_ > limits_.packet_triangles)
        return fail(too_large_packet("too many triangles"));
      if (!require(i == 0 || out_.chunks[i - 1].key < out.key, "unsorted chunks") ||
          !require(within(out.error_m, 0, 1e6), "an impossible error of a chunk") ||
          !require(out.triangles > 0, "a chunk without triangles") ||
          !read_labels(in.views(), out.views) || !read_bytes(*in.payload(), out.payload))
        return false;
    }
    return true;
  }

  bool read_labels(const fb::Vector<std::uint32_t>* in, std::vector<ViewId>& out) {
    if (size_of(in) > kMaxViewsOfChunk)
      return fail(too_large_packet("a chunk with over 254 views"));
    if (!spend(4 * size_of(in))) return false;
    for (std::size_t i = 0; i < size_of(in); ++i) {
      out.push_back(in->Get(static_cast<fb::uoffset_t>(i)));
      if (!require(out[i] != kNoView && (i == 0 || out[i - 1] < out[i]),
                   "unsorted views of a chunk"))
        return false;
    }
    return true;
  }

  bool read_textures(const fb::Vector<fb::Offset<wire::Texture>>* all) {
    if (size_of(all) > limits_.textures) return fail(too_large_packet("too many textures"));
    for (std::size_t i = 0; i < size_of(all); ++i) {
      const wire::Texture& in = *all->Get(static_cast<fb::uoffset_t>(i));
      TextureUnit& out = out_.textures.emplace_back();
      out.stream = in.stream();
      out.layout = in.layout();
      out.width = in.width(), out.height = in.height();
      out.key_frame = in.key_frame();
      if (out.width > limits_.texture_side || out.height > limits_.texture_side)
        return fail(too_large_packet("a texture's side is too long"));
      if (!require(in.codec() == wire::TextureCodec::h264, "an unknown texture codec") ||
          !require(out.width > 0 && out.height > 0 && out.width % 2 == 0 && out.height % 2 == 0,
                   "an impossible size of a texture") ||
          !read_bytes(*in.data(), out.data))
        return false;
      texture_size_[out.stream] = {out.width, out.height};
    }
    return true;
  }

  bool read_views(const fb::Vector<fb::Offset<wire::View>>* all) {
    if (size_of(all) > limits_.views) return fail(too_large_packet("too many views"));
    for (std::size_t i = 0; i < size_of(all); ++i) {
      const wire::View& in = *all->Get(static_cast<fb::uoffset_t>(i));
      if (!require(in.kind() <= wire::ViewKind::equirectangular, "an unknown kind of view"))
        return false;
      View& out = out_.views.emplace_back();
      out.id = in.id();
      out.kind = static_cast<View::Kind>(in.kind());
      out.width = in.width(), out.height = in.height();
      out.fx = in.fx(), out.fy = in.fy(), out.cx = in.cx(), out.cy = in.cy();
      out.T_world_camera = mr::codec::read(*in.t_world_camera());
      out.image_rect = mr::codec::read(*in.image_rect());
      out.atlas_rect = mr::codec::read(*in.atlas_rect());
      out.gutter_px = in.gutter_px();
      out.stream = in.stream(), out.layout = in.layout();
      if (!require(i == 0 || out_.views[i - 1].id < out.id, "unsorted views") || !check_view(out))
        return false;
    }
    return true;
  }

  bool check_view(const View& view) {
    Vec2i atlas{limits_.texture_side, limits_.texture_side};
    if (const auto it = texture_size_.find(view.stream); it != texture_size_.end())
      atlas = it->second;
    return require(view.id != kNoView, "a view with the number of no view") &&
           check_camera(view.camera()) &&
           require(is_rigid(view.T_world_camera), "a pose that is not rigid") &&
           require(fits(view.image_rect, view.width, view.height),
                   "a view's image_rect outside its picture") &&
           require(fits(view.atlas_rect, atlas.x, atlas.y),
                   "a view's atlas_rect outside its texture") &&
           require(within(view.gutter_px, 0, 1024), "an impossible gutter");
  }

  bool read_marks(const fb::Vector<fb::Offset<wire::Mark>>* all) {
    if (size_of(all) > limits_.marks) return fail(too_large_packet("too many marks"));
    for (std::size_t i = 0; i < size_of(all); ++i) {
      const wire::Mark& in = *all->Get(static_cast<fb::uoffset_t>(i));
      TimeMark& out = out_.marks.emplace_back();
      if (!read_name(*in.stage(), out.stage, "a stage's name") || !read_time(in.at_ns(), out.at))
        return false;
    }
    return true;
  }

  static constexpr const char* kUnnamed = "a chunk that the manifest does not name";

  const PacketLimits& limits_;
  std::size_t unread_;
  std::uint64_t triangles_ = 0;
  std::map<std::uint32_t, Vec2i> texture_size_;  ///< the newest of each stream
  Packet out_;
  Error error_;
};

std::vector<std::byte> bytes_of(const Builder& b) {
  const auto* bytes = reinterpret_cast<const std::byte*>(b.GetBufferPointer());
  return std::vector<std::byte>(bytes, bytes + b.GetSize());
}

/// Verifies bytes that may come from anyone, then reads them as the FlatBuffer `Wire`.
template <typename Wire, typename Value>
Result<Value> decode(std::span<const std::byte> bytes, const char* identifier,
                     const PacketLimits& limits) {
  if (bytes.size() > limits.packet_bytes)
    return too_large_packet(std::to_string(bytes.size()) + " bytes, at most " +
                            std::to_string(limits.packet_bytes));
  // Bytes from a network lie anywhere; the reads below need 8-byte alignment.
  std::vector<std::uint64_t> aligned((bytes.size() + 7) / 8);
  if (!bytes.empty()) std::memcpy(aligned.data(), bytes.data(), bytes.size());
  const auto* data = reinterpret_cast<const std::uint8_t*>(aligned.data());
  // The least that the identifier check reads; flatbuffers does not ask.
  if (bytes.size() < 8 || !fb::BufferHasIdentifier(data, identifier))
    return Error{Error::Cause::corrupt, "packet: not one of ours, or of another version"};
  fb::Verifier verifier(data, bytes.size(), kMaxDepth, kMaxTables);
  if (!verifier.VerifyBuffer<Wire>(identifier))
    return Error{Error::Cause::corrupt, "packet: cut off or damaged"};
  return Reader(bytes.size(), limits).read(*fb::GetRoot<Wire>(data));
}

}  // namespace

std::vector<std::byte> encode_packet(const Packet& packet) {
  Builder b(expected_bytes(packet));
  const auto scene = b.CreateString(packet.scene), node = b.CreateString(packet.node);
  const auto sources = write_all<wire::Source>(b, packet.sources);
  const auto plan = wire::CreatePlan(b, packet.plan.simplify_ratio, packet.plan.mesh_speed,
                                     packet.plan.texture_scale, packet.plan.texture_qp);
  const auto views = write_all<wire::View>(b, packet.views);
  std::vector<wire::ChunkKey> keys;
  keys.reserve(packet.manifest.size());
  for (const ChunkKey& key : packet.manifest) keys.push_back(to_wire(key));
  const auto manifest = b.CreateVectorOfStructs(keys);
  const auto chunks = write_all<wire::Chunk>(b, packet.chunks);
  const auto textures = write_all<wire::Texture>(b, packet.textures);
  const auto marks = write_all<wire::Mark>(b, packet.marks);
  wire::FinishPacketBuffer(
      b, wire::CreatePacket(b, scene, node, packet.epoch, packet.sequence,
                            to_ns(packet.captured_at), sources, plan, views, manifest, chunks,
                            textures, marks, packet.coalesced));
  return bytes_of(b);
}

std::vector<std::byte> encode_chunks(std::span<const EncodedChunk> chunks) {
  Builder b(1024);
  std::vector<fb::Offset<wire::Chunk>> all;
  for (const EncodedChunk& chunk : chunks) all.push_back(write(b, chunk));
  const auto list = b.CreateVector(all);
  b.Finish(wire::CreateChunks(b, list), kChunksIdentifier);
  return bytes_of(b);
}

Result<Packet> decode_packet(std::span<const std::byte> bytes, const PacketLimits& limits) {
  return decode<wire::Packet, Packet>(bytes, wire::PacketIdentifier(), limits);
}

Result<std::vector<EncodedChunk>> decode_chunks(std::span<const std::byte> bytes,
                                                const PacketLimits& limits) {
  return decode<wire::Chunks, std::vector<EncodedChunk>>(bytes, kChunksIdentifier, limits);
}

}  // namespace mr::codec
