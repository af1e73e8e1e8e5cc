// FlatBuffers to values, every one of them checked: they may come from anyone.
#include <algorithm>
#include <cmath>
#include <cstring>

#include "mr/codec/packet_codec.h"
#include "mr/codec/packet_message.h"
#include "mr/codec/seal.h"
#include "packet_generated.h"

namespace mr::codec {
namespace {

namespace fb = flatbuffers;

constexpr std::size_t kMaxViewsOfChunk = 254;
constexpr fb::uoffset_t kMaxDepth = 8, kMaxTables = 1u << 18;

Error invalid_packet(const std::string& what) { return {Error::Cause::invalid, "packet: " + what}; }
Error too_large_packet(const std::string& what) {
  return {Error::Cause::too_large, "packet: " + what};
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
/// The layer is to be checked.
ChunkKey read(const wire::ChunkKey& k) {
  return {{{k.x(), k.y(), k.z()}, SensorId{k.source()}, static_cast<Layer>(k.layer())},
          k.level(),
          k.version()};
}
bool is_layer(std::uint32_t layer) { return layer <= static_cast<std::uint32_t>(Layer::still); }

template <typename Vector>
std::size_t size_of(const Vector* vector) {
  return vector == nullptr ? 0 : vector->size();
}

/// One of a vector's numbers. The verifier asks that the vector's length be aligned, not that its
/// numbers are: those of 8 bytes may lie anywhere.
template <typename Number>
Number number_at(const fb::Vector<Number>& vector, std::size_t i) {
  Number value;
  std::memcpy(&value, vector.Data() + i * sizeof value, sizeof value);
  return fb::EndianScalar(value);
}

/// Reads one verified buffer. Each step returns false once `error_` is set.
class Reader {
 public:
  /// With an `owner` of the buffer payloads share it, else they are copied.
  Reader(std::size_t bytes, const PacketLimits& limits, std::shared_ptr<const void> owner)
      : limits_(limits), unread_(bytes), owner_(std::move(owner)) {}

  Result<PacketMessage> read(const wire::Packet& in) {
    if (read_times(in) && read_base(in) &&
        (in.change() == nullptr || read_change(*in.change(), out_.change)) &&
        count_chunks(in.chunks()) && read_chunks(in.chunks()) && read_textures(in.textures()) &&
        read_alpha(in.alpha()) && read_features(in.features()))
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

  bool read_payload(const fb::Vector<std::uint8_t>& in, SharedBytes& out) {
    if (!require(in.size() > 0, "an empty payload") || !spend(in.size())) return false;
    const std::span bytes(reinterpret_cast<const std::byte*>(in.data()), in.size());
    out = owner_ ? SharedBytes(owner_, bytes) : std::vector(bytes.begin(), bytes.end());
    return true;
  }

  /// Numbers and times.
  bool read_times(const wire::Packet& in) {
    out_.epoch = in.epoch();
    out_.sequence = in.sequence();
    out_.age = in.age();
    out_.coalesced = in.coalesced();
    return require(out_.coalesced <= out_.sequence, "more folded packets than there were") &&
           require(out_.age <= out_.sequence, "a base before the first packet") &&
           require(out_.age > 0 || in.head() != nullptr, "its own base, which it does not bring") &&
           read_time(in.captured_at_ns(), out_.captured_at) &&
           read_times(in.source_delays_ns(), in.source_times_ns(), limits_.views,
                      out_.source_times) &&
           read_times(in.mark_delays_ns(), in.mark_times_ns(), limits_.marks, out_.mark_times);
  }

  bool read_times(const fb::Vector<std::int32_t>* delays, const fb::Vector<std::int64_t>* times,
                  std::size_t most, std::vector<TimePoint>& out) {
    if (!require(delays == nullptr || times == nullptr, "times told twice")) return false;
    const std::size_t count = size_of(delays) + size_of(times);
    if (count > most) return fail(too_large_packet("too many times"));
    if (!spend(4 * size_of(delays) + 8 * size_of(times))) return false;
    for (std::size_t i = 0; i < count; ++i) {
      const std::int64_t ns =
          delays != nullptr ? out_.captured_at.time_since_epoch().count() + number_at(*delays, i)
                            : number_at(*times, i);
      if (!read_time(ns, out.emplace_back())) return false;
    }
    return true;
  }

  bool read_base(const wire::Packet& message) {
    if (message.head() == nullptr) return true;
    const wire::Head& in = *message.head();
    const auto base = std::make_shared<Packet>();
    base->epoch = message.epoch(), base->sequence = message.sequence() - message.age();
    std::vector<std::string> stages;
    if (!read_name(*in.scene(), base->scene, "the scene's name") ||
        !read_name(*in.node(), base->node, "the node's name") ||
        !read_plan(*in.plan(), base->plan) || !read_sources(in.sources(), base->sources) ||
        !read_views(in.views(), base->views) || !read_keys(in.manifest(), base->manifest) ||
        !read_streams(in.streams(), base->streams) || !read_stages(in.stages(), stages))
      return false;
    for (std::string& stage : stages) base->marks.push_back({std::move(stage), {}});
    out_.base = base;
    return true;
  }

  bool read_change(const wire::Change& in, PacketChange& out) {
    if (!read_keys(in.removed(), out.removed) || !read_keys(in.added(), out.added) ||
        !read_view_keys(in.removed_views(), out.removed_views) ||
        !read_views(in.views(), out.views) ||
        !read_sensors(in.removed_sources(), out.removed_sources) ||
        !read_sources(in.sources(), out.sources) || !read_confirmed(in.confirmed(), out.confirmed))
      return false;
    return (in.plan() == nullptr || read_plan(*in.plan(), out.plan.emplace())) &&
           (in.stages() == nullptr || read_stages(in.stages(), out.stages.emplace())) &&
           (in.streams() == nullptr || read_streams(in.streams(), out.streams.emplace()));
  }

  bool read_plan(const wire::Plan& plan, CodingPlan& out) {
    out = {{plan.simplify_ratio(), plan.simplify_error_m()},
           plan.still_error_m(),
           plan.mesh_speed(),
           plan.texture_scale(),
           plan.texture_qp(),
           plan.plate_scale(),
           plan.plate_qp()};
    return require(out.problems().empty(), "an impossible coding plan");
  }

  bool read_beams(const fb::Vector<double>* in, std::vector<double>& out) {
    if (!spend(8 * size_of(in))) return false;
    for (std::size_t i = 0; i < size_of(in); ++i) {
      out.push_back(number_at(*in, i));
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

  /// Masks grow to a byte for each bit: what all hold is bounded before it is read.
  bool read_mask(const wire::TileMask* in, TileMask& out) {
    if (in == nullptr) return true;
    const int tile = in->tile_px(), columns = in->columns(), rows = in->rows();
    if (tile == 0)
      return require(columns == 0 && rows == 0 && size_of(in->bits()) == 0, "a mask without tiles");
    const int most = (limits_.texture_side + tile - 1) / tile;
    if (!require(tile <= 256 && columns > 0 && rows > 0, "an impossible mask")) return false;
    if (columns > most || rows > most) return fail(too_large_packet("too large a mask"));
    const std::size_t tiles = static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows);
    tiles_ += tiles;
    if (tiles_ > limits_.mask_tiles) return fail(too_large_packet("too many tiles"));
    if (!require(size_of(in->bits()) == (tiles + 7) / 8, "a mask that is not as long as it says") ||
        !spend(in->bits()->size()))
      return false;
    out = {tile, columns, rows, std::vector<std::uint8_t>(tiles)};
    const std::uint8_t* bits = in->bits()->data();
    for (std::size_t i = 0; i < tiles; ++i) out.tiles[i] = bits[i / 8] >> (i % 8) & 1;
    return require(tiles % 8 == 0 || bits[tiles / 8] >> (tiles % 8) == 0,
                   "bits beyond a mask's last tile");
  }

  bool read_sources(const fb::Vector<fb::Offset<wire::Source>>* all,
                    std::vector<SourceInfo>& list) {
    if (size_of(all) > limits_.views) return fail(too_large_packet("too many sources"));
    for (std::size_t i = 0; i < size_of(all); ++i) {
      const wire::Source& in = *all->Get(static_cast<fb::uoffset_t>(i));
      SourceInfo& out = list.emplace_back();
      out.sensor = SensorId{in.sensor()};
      out.T_world_depth = mr::codec::read(*in.t_world_depth());
      out.precision = {in.sigma_base_m(), in.sigma_per_m2()};
      if (!require(i == 0 || list[i - 1].sensor < out.sensor, "unsorted sources") ||
          !read_camera(*in.depth_camera(), out.depth_camera) ||
          !require(is_rigid(out.T_world_depth), "a pose that is not rigid") ||
          !require(within(out.precision.base_m, 0, 1e3) && within(out.precision.per_m2, 0, 1e3),
                   "an impossible precision") ||
          !read_mask(in.confirmed_depth(), out.confirmed_depth) ||
          !read_mask(in.confirmed_color(), out.confirmed_color) ||
          !read_mask(in.blind_color(), out.blind_color))
        return false;
    }
    return true;
  }

  bool read_confirmed(const fb::Vector<fb::Offset<wire::Confirmed>>* all,
                      std::vector<PacketChange::Confirmed>& list) {
    if (size_of(all) > limits_.views) return fail(too_large_packet("too many masks"));
    for (std::size_t i = 0; i < size_of(all); ++i) {
      const wire::Confirmed& in = *all->Get(static_cast<fb::uoffset_t>(i));
      PacketChange::Confirmed& out = list.emplace_back();
      out.sensor = SensorId{in.sensor()};
      if (!require(i == 0 || list[i - 1].sensor < out.sensor, "unsorted masks") ||
          (in.depth() != nullptr && !read_mask(in.depth(), out.depth.emplace())) ||
          (in.color() != nullptr && !read_mask(in.color(), out.color.emplace())) ||
          (in.blind() != nullptr && !read_mask(in.blind(), out.blind.emplace())))
        return false;
    }
    return true;
  }

  bool read_sensors(const fb::Vector<std::uint32_t>* all, std::vector<SensorId>& list) {
    if (size_of(all) > limits_.views) return fail(too_large_packet("too many sources"));
    if (!spend(4 * size_of(all))) return false;
    for (std::size_t i = 0; i < size_of(all); ++i) {
      list.push_back(SensorId{all->Get(static_cast<fb::uoffset_t>(i))});
      if (!require(i == 0 || list[i - 1] < list[i], "unsorted sources")) return false;
    }
    return true;
  }

  bool read_keys(const fb::Vector<const wire::ChunkKey*>* all, std::vector<ChunkKey>& list) {
    const std::size_t count = size_of(all);
    if (count > limits_.manifest_chunks)
      return fail(too_large_packet("too many chunks in the manifest"));
    if (!spend(sizeof(wire::ChunkKey) * count)) return false;
    list.reserve(count);
    for (std::size_t i = 0; i < count; ++i) {
      const wire::ChunkKey& key = *all->Get(static_cast<fb::uoffset_t>(i));
      list.push_back(mr::codec::read(key));
      if (!require(is_layer(key.layer()), "an unknown layer") ||
          !require(i == 0 || list[i - 1] < list[i], "an unsorted manifest"))
        return false;
    }
    return true;
  }

  bool read_view_keys(const fb::Vector<const wire::ViewKey*>* all,
                      std::vector<PacketChange::ViewKey>& list) {
    if (size_of(all) > limits_.views) return fail(too_large_packet("too many views"));
    if (!spend(sizeof(wire::ViewKey) * size_of(all))) return false;
    for (std::size_t i = 0; i < size_of(all); ++i) {
      const wire::ViewKey& key = *all->Get(static_cast<fb::uoffset_t>(i));
      list.emplace_back(ViewId{key.id()}, static_cast<Layer>(key.layer()));
      if (!require(is_layer(key.layer()), "an unknown layer") ||
          !require(i == 0 || list[i - 1] < list[i], "unsorted views"))
        return false;
    }
    return true;
  }

  bool read_streams(const fb::Vector<const wire::StreamState*>* all,
                    std::vector<StreamState>& list) {
    if (size_of(all) > limits_.views) return fail(too_large_packet("too many streams"));
    if (!spend(sizeof(wire::StreamState) * size_of(all))) return false;
    for (std::size_t i = 0; i < size_of(all); ++i) {
      const wire::StreamState& in = *all->Get(static_cast<fb::uoffset_t>(i));
      list.push_back({StreamId{in.stream()}, in.serial()});
      if (!require(i == 0 || list[i - 1].stream < list[i].stream, "unsorted streams")) return false;
    }
    return true;
  }

  bool read_stages(const fb::Vector<fb::Offset<fb::String>>* all, std::vector<std::string>& list) {
    if (size_of(all) > limits_.marks) return fail(too_large_packet("too many marks"));
    for (std::size_t i = 0; i < size_of(all); ++i)
      if (!read_name(*all->Get(static_cast<fb::uoffset_t>(i)), list.emplace_back(),
                     "a stage's name"))
        return false;
    return true;
  }

  /// No more than any manifest names.
  bool count_chunks(const fb::Vector<fb::Offset<wire::Chunk>>* all) {
    return size_of(all) <= limits_.manifest_chunks || fail(too_large_packet("too many chunks"));
  }

  bool read_chunks(const fb::Vector<fb::Offset<wire::Chunk>>* all) {
    for (std::size_t i = 0; i < size_of(all); ++i) {
      const wire::Chunk& in = *all->Get(static_cast<fb::uoffset_t>(i));
      EncodedChunk& out = out_.chunks.emplace_back();
      if (!require(is_layer(in.key()->layer()), "an unknown layer")) return false;
      out.key = mr::codec::read(*in.key());
      out.error_m = in.error_m();
      out.triangles = in.triangles();
      triangles_ += in.triangles();
      if (in.triangles() > limits_.chunk_triangles || triangles_ > limits_.packet_triangles)
        return fail(too_large_packet("too many triangles"));
      if (!require(i == 0 || out_.chunks[i - 1].key < out.key, "unsorted chunks") ||
          !require(within(out.error_m, 0, 1e6), "an impossible error of a chunk") ||
          !require(out.triangles > 0, "a chunk without triangles") ||
          !read_labels(in.views(), out.views) || !read_labels(in.sensors(), out.sensors) ||
          !require(out.views.empty() || out.sensors.empty(),
                   "a chunk whose labels mean views and sensors") ||
          !read_ranges(in.guessed(), out.triangles, out.guessed) ||
          !read_payload(*in.payload(), out.payload))
        return false;
    }
    return true;
  }

  /// Ascending and apart, of so many triangles.
  bool read_ranges(const fb::Vector<std::uint32_t>* in, std::uint32_t triangles,
                   std::vector<TriangleRange>& out) {
    if (!require(size_of(in) % 2 == 0 && size_of(in) <= triangles + 1, "impossible guesses") ||
        !spend(4 * size_of(in)))
      return false;
    for (fb::uoffset_t i = 0; i < size_of(in); i += 2) out.push_back({in->Get(i), in->Get(i + 1)});
    return require(are_apart(out, triangles), "impossible guesses");
  }

  template <typename Id>
  bool read_labels(const fb::Vector<std::uint32_t>* in, std::vector<Id>& out) {
    if (size_of(in) > kMaxViewsOfChunk)
      return fail(too_large_packet("a chunk with over 254 labels"));
    if (!spend(4 * size_of(in))) return false;
    for (std::size_t i = 0; i < size_of(in); ++i) {
      out.push_back(Id{in->Get(static_cast<fb::uoffset_t>(i))});
      if (!require(number_of(out[i]) != number_of(kNoView) && (i == 0 || out[i - 1] < out[i]),
                   "unsorted labels of a chunk"))
        return false;
    }
    return true;
  }

  bool read_textures(const fb::Vector<fb::Offset<wire::Texture>>* all) {
    if (size_of(all) > limits_.textures) return fail(too_large_packet("too many textures"));
    for (std::size_t i = 0; i < size_of(all); ++i) {
      const wire::Texture& in = *all->Get(static_cast<fb::uoffset_t>(i));
      TextureUnit& out = out_.textures.emplace_back();
      out.stream = StreamId{in.stream()};
      out.serial = in.serial();
      out.layout = in.layout();
      out.width = in.width(), out.height = in.height();
      out.key_frame = in.key_frame();
      if (out.width > limits_.texture_side || out.height > limits_.texture_side)
        return fail(too_large_packet("a texture's side is too long"));
      if (!require(in.codec() == wire::TextureCodec::h264, "an unknown texture codec") ||
          !require(out.width > 0 && out.height > 0 && out.width % 2 == 0 && out.height % 2 == 0,
                   "an impossible size of a texture") ||
          !read_payload(*in.data(), out.data))
        return false;
    }
    return true;
  }

  /// Planes grow when they are decoded: what all hold is bounded.
  bool read_alpha(const fb::Vector<fb::Offset<wire::Alpha>>* all) {
    if (size_of(all) > limits_.views) return fail(too_large_packet("too many alpha planes"));
    std::size_t pixels = 0;
    for (std::size_t i = 0; i < size_of(all); ++i) {
      const wire::Alpha& in = *all->Get(static_cast<fb::uoffset_t>(i));
      AlphaPlane& out = out_.alpha.emplace_back();
      out.stream = StreamId{in.stream()};
      out.step_px = in.step_px(), out.width = in.width(), out.height = in.height();
      pixels += static_cast<std::size_t>(out.width) * static_cast<std::size_t>(out.height);
      if (!require(out.step_px >= 1 && out.step_px <= AlphaPlane::kMostStep_px && out.width > 0 &&
                       out.height > 0,
                   "an impossible alpha plane") ||
          !require(i == 0 || out_.alpha[i - 1].stream < out.stream, "unsorted alpha planes"))
        return false;
      if (std::max(out.width, out.height) > limits_.texture_side || pixels > limits_.alpha_pixels)
        return fail(too_large_packet("too large an alpha plane"));
      if (!read_payload(*in.data(), out.data)) return false;
    }
    return true;
  }

  bool read_features(const fb::Vector<fb::Offset<wire::Features>>* all) {
    if (size_of(all) > limits_.views) return fail(too_large_packet("too many features"));
    for (std::size_t i = 0; i < size_of(all); ++i) {
      const wire::Features& in = *all->Get(static_cast<fb::uoffset_t>(i));
      FrameFeatures& out = out_.features.emplace_back();
      out.sensor = SensorId{in.sensor()}, out.has_color = in.has_color();
      const std::size_t values = size_of(in.values());
      if (values > FrameFeatures::kMostValues) return fail(too_large_packet("too many features"));
      if (!require(i == 0 || out_.features[i - 1].sensor < out.sensor, "unsorted features") ||
          !spend(sizeof(float) * values))
        return false;
      for (std::size_t k = 0; k < values; ++k) out.values.push_back(number_at(*in.values(), k));
      if (!require(std::ranges::all_of(out.values, [](float v) { return std::isfinite(v); }),
                   "features that are not finite"))
        return false;
    }
    return true;
  }

  bool read_views(const fb::Vector<fb::Offset<wire::View>>* all, std::vector<View>& list) {
    if (size_of(all) > limits_.views) return fail(too_large_packet("too many views"));
    for (std::size_t i = 0; i < size_of(all); ++i) {
      const wire::View& in = *all->Get(static_cast<fb::uoffset_t>(i));
      if (!require(in.kind() <= wire::ViewKind::equirectangular, "an unknown kind of view"))
        return false;
      View& out = list.emplace_back();
      out.id = ViewId{in.id()};
      out.kind = static_cast<View::Kind>(in.kind());
      out.width = in.width(), out.height = in.height();
      out.fx = in.fx(), out.fy = in.fy(), out.cx = in.cx(), out.cy = in.cy();
      out.T_world_camera = mr::codec::read(*in.t_world_camera());
      out.image_rect = mr::codec::read(*in.image_rect());
      out.atlas_rect = mr::codec::read(*in.atlas_rect());
      out.gutter_px = in.gutter_px();
      out.stream = StreamId{in.stream()}, out.layout = in.layout();
      if (!require(is_layer(in.layer()), "an unknown layer")) return false;
      out.layer = static_cast<Layer>(in.layer());
      if (in.gain() != nullptr) out.gain = {in.gain()->r(), in.gain()->g(), in.gain()->b()};
      const auto key = [](const View& v) { return PacketChange::ViewKey(v.id, v.layer); };
      if (!require(i == 0 || key(list[i - 1]) < key(out), "unsorted views") || !check_view(out))
        return false;
    }
    return true;
  }

  bool check_view(const View& view) {
    constexpr double kMostGain = 16;
    const auto usable = [](float gain) { return within(gain, 1 / kMostGain, kMostGain); };
    return require(view.id != kNoView, "a view with the number of no view") &&
           check_camera(view.camera()) &&
           require(is_rigid(view.T_world_camera), "a pose that is not rigid") &&
           require(fits(view.image_rect, view.width, view.height),
                   "a view's image_rect outside its picture") &&
           require(fits(view.atlas_rect, limits_.texture_side, limits_.texture_side),
                   "a view's atlas_rect outside its texture") &&
           require(within(view.gutter_px, 0, 1024), "an impossible gutter") &&
           require(usable(view.gain.x) && usable(view.gain.y) && usable(view.gain.z),
                   "an impossible gain");
  }

  const PacketLimits& limits_;
  std::size_t unread_;
  std::shared_ptr<const void> owner_;
  std::uint64_t triangles_ = 0, tiles_ = 0;
  PacketMessage out_;
  Error error_;
};

/// A verified FlatBuffer's bytes, aligned to 8. `copy`: where they were not.
struct Aligned {
  explicit Aligned(std::span<const std::byte> in) : bytes(in) {
    if (reinterpret_cast<std::uintptr_t>(in.data()) % alignof(std::uint64_t) == 0) return;
    copy = std::make_shared<std::vector<std::uint64_t>>((in.size() + 7) / 8);
    std::memcpy(copy->data(), in.data(), in.size());
    bytes = std::as_bytes(std::span(*copy)).first(in.size());
  }
  std::span<const std::byte> bytes;
  std::shared_ptr<std::vector<std::uint64_t>> copy;
};

/// Verifies bytes that may come from anyone, then reads them as the FlatBuffer `Wire`.
template <typename Wire, typename Value>
Result<Value> decode(std::span<const std::byte> sealed, const char* identifier,
                     const PacketLimits& limits, std::shared_ptr<const void> owner = nullptr) {
  if (sealed.size() > limits.packet_bytes)
    return too_large_packet(std::to_string(sealed.size()) + " bytes, at most " +
                            std::to_string(limits.packet_bytes));
  constexpr std::size_t kIdentifierAt = 4, kIdentifierBytes = 4;
  if (sealed.size() < kIdentifierAt + kIdentifierBytes + kSealBytes ||
      std::memcmp(sealed.data() + kIdentifierAt, identifier, kIdentifierBytes) != 0)
    return Error{Error::Cause::corrupt, "packet: not one of ours, or of another version"};
  const auto unsealed = unseal(sealed);
  if (!unsealed) return Error{unsealed.error().cause, "packet: " + unsealed.error().message};
  const Aligned aligned(*unsealed);  // bytes from a network lie anywhere
  if (owner && aligned.copy) owner = aligned.copy;
  const auto* data = reinterpret_cast<const std::uint8_t*>(aligned.bytes.data());
  fb::Verifier verifier(data, aligned.bytes.size(), kMaxDepth, kMaxTables);
  if (!verifier.VerifyBuffer<Wire>(identifier))
    return Error{Error::Cause::corrupt, "packet: cut off or damaged"};
  return Reader(aligned.bytes.size(), limits, std::move(owner)).read(*fb::GetRoot<Wire>(data));
}

}  // namespace

Result<PacketMessage> decode_message(std::span<const std::byte> bytes, const PacketLimits& limits) {
  return decode<wire::Packet, PacketMessage>(bytes, wire::PacketIdentifier(), limits);
}

Result<PacketMessage> read_message(const std::shared_ptr<const std::vector<std::byte>>& bytes,
                                   const PacketLimits& limits) {
  return decode<wire::Packet, PacketMessage>(*bytes, wire::PacketIdentifier(), limits, bytes);
}

Result<Packet> decode_packet(std::span<const std::byte> bytes, const PacketLimits& limits) {
  auto message = decode_message(bytes, limits);
  if (!message) return message.error();
  const auto base = message->base;
  if (!base)
    return Error{Error::Cause::not_found, "packet: it does not bring the head that it builds on"};
  return complete(*std::move(message), *base, limits);
}

Result<std::vector<EncodedChunk>> decode_chunks(std::span<const std::byte> bytes,
                                                const PacketLimits& limits) {
  return decode<wire::Chunks, std::vector<EncodedChunk>>(bytes, kChunksIdentifier, limits);
}

}  // namespace mr::codec
