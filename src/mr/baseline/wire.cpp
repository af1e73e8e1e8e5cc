#include "mr/baseline/wire.h"

#include <lz4.h>

#include <algorithm>
#include <bit>
#include <cstring>

namespace mr::baseline {
namespace {

constexpr std::size_t kSealBytes = 4 + 8;
constexpr std::uint32_t kMark = 0x00424D52u;  // "RMB" and the kind
constexpr std::uint32_t kHasColor = 1, kOwnPose = 2;

/// Not meant against people, but against accidents.
std::uint64_t check_sum(std::span<const std::byte> bytes) {
  std::uint64_t sum = 0x9E3779B97F4A7C15ull + bytes.size();
  for (std::size_t at = 0; at < bytes.size(); at += 8) {
    std::uint64_t word = 0;
    std::memcpy(&word, bytes.data() + at, std::min<std::size_t>(8, bytes.size() - at));
    sum = (sum ^ word) * 0xBF58476D1CE4E5B9ull;
    sum ^= sum >> 32;
  }
  return sum;
}

std::uint32_t mark_of(Message kind) { return kMark | static_cast<std::uint32_t>(kind) << 24; }

}  // namespace

void ByteWriter::number(std::uint64_t v, int bytes) {
  for (int i = 0; i < bytes; ++i) bytes_.push_back(static_cast<std::byte>(v >> 8 * i & 255));
}
void ByteWriter::f32(float v) { u32(std::bit_cast<std::uint32_t>(v)); }
void ByteWriter::f64(double v) { u64(std::bit_cast<std::uint64_t>(v)); }

void ByteWriter::block(std::span<const std::byte> bytes) {
  MR_ASSERT(bytes.size() <= 0xFFFFFFFFu);
  u32(static_cast<std::uint32_t>(bytes.size()));
  bytes_.insert(bytes_.end(), bytes.begin(), bytes.end());
}

std::uint64_t ByteReader::number(std::size_t bytes) {
  ok_ &= rest_.size() >= bytes;
  if (!ok_) return 0;
  std::uint64_t v = 0;
  for (std::size_t i = 0; i < bytes; ++i) v |= std::to_integer<std::uint64_t>(rest_[i]) << 8 * i;
  rest_ = rest_.subspan(bytes);
  return v;
}
float ByteReader::f32() { return std::bit_cast<float>(u32()); }
double ByteReader::f64() { return std::bit_cast<double>(u64()); }

std::span<const std::byte> ByteReader::block() {
  const std::size_t size = u32();
  ok_ &= rest_.size() >= size;
  if (!ok_) return {};
  const auto out = rest_.first(size);
  rest_ = rest_.subspan(size);
  return out;
}

Bytes seal(Message kind, const Bytes& body) {
  ByteWriter head;
  head.u32(mark_of(kind));
  head.u64(check_sum(body));
  Bytes out = head.take();
  out.insert(out.end(), body.begin(), body.end());
  return out;
}

Result<std::span<const std::byte>> open_seal(Message kind, std::span<const std::byte> message) {
  ByteReader head(message);
  const std::uint32_t mark = head.u32();
  const std::uint64_t sum = head.u64();
  if (!head.ok() || mark != mark_of(kind)) return corrupt("not a message of this kind");
  const auto body = message.subspan(kSealBytes);
  if (check_sum(body) != sum) return corrupt("the check sum does not fit");
  return body;
}

Result<Bytes> lz4_compress(std::span<const std::byte> raw) {
  if (raw.size() > LZ4_MAX_INPUT_SIZE)
    return Error{Error::Cause::too_large, "baseline: too many bytes for an LZ4 block"};
  const int size = static_cast<int>(raw.size());
  Bytes out(static_cast<std::size_t>(LZ4_compressBound(size)));
  const int packed =
      LZ4_compress_default(reinterpret_cast<const char*>(raw.data()),
                           reinterpret_cast<char*>(out.data()), size, static_cast<int>(out.size()));
  if (packed <= 0) return Error{Error::Cause::io, "baseline: LZ4 refuses to compress"};
  out.resize(static_cast<std::size_t>(packed));
  return out;
}

bool lz4_plausible(std::size_t packed_bytes, std::uint64_t raw_bytes) {
  constexpr std::uint64_t kMostPerByte = 255;
  return raw_bytes <= LZ4_MAX_INPUT_SIZE && raw_bytes <= kMostPerByte * packed_bytes;
}

Status lz4_decompress(std::span<const std::byte> packed, std::span<std::byte> raw) {
  if (packed.size() > LZ4_MAX_INPUT_SIZE || !lz4_plausible(packed.size(), raw.size()))
    return corrupt("an LZ4 block of impossible size");
  const int size = LZ4_decompress_safe(
      reinterpret_cast<const char*>(packed.data()), reinterpret_cast<char*>(raw.data()),
      static_cast<int>(packed.size()), static_cast<int>(raw.size()));
  if (size < 0 || static_cast<std::size_t>(size) != raw.size())
    return corrupt("a damaged LZ4 block");
  return {};
}

// ---- what goes with every capture

std::vector<SensorHead> heads_of(const Scene& scene, std::span<const Frame> capture) {
  std::vector<SensorHead> heads;
  for (const Frame& frame : capture)
    heads.push_back({frame.sensor, frame.captured_at(),
                     !frame.color.empty() && scene.sensor(frame.sensor).color_camera.has_value(),
                     frame.T_world_depth});
  std::sort(heads.begin(), heads.end(),
            [](const SensorHead& a, const SensorHead& b) { return a.sensor < b.sensor; });
  return heads;
}

void write_heads(const Scene& scene, std::span<const Frame> capture, ByteWriter& out) {
  const std::vector<SensorHead> heads = heads_of(scene, capture);
  out.u32(static_cast<std::uint32_t>(heads.size()));
  for (const SensorHead& head : heads) {
    const auto& poses = scene.sensor(head.sensor).T_world_depth;
    const auto known = std::find(poses.begin(), poses.end(), head.T_world_depth);
    const bool own = known == poses.end();
    out.u32(number_of(head.sensor));
    out.u64(static_cast<std::uint64_t>(head.captured_at.time_since_epoch().count()));
    out.u32((head.has_color ? kHasColor : 0) | (own ? kOwnPose : 0));
    if (!own) out.u32(static_cast<std::uint32_t>(known - poses.begin()));
    if (own)
      for (const double v : head.T_world_depth.matrix()) out.f64(v);
  }
}

namespace {

Result<Pose> read_pose(const SensorConfig& sensor, bool own, ByteReader& in) {
  if (own) {
    std::array<double, 16> matrix;
    for (double& v : matrix) v = in.f64();
    return pose_from_matrix(matrix);
  }
  const std::uint32_t number = in.u32();
  if (number >= sensor.T_world_depth.size()) return corrupt("a pose that the scene lacks");
  return sensor.T_world_depth[number];
}

}  // namespace

Result<std::vector<SensorHead>> read_heads(const Scene& scene, ByteReader& in) {
  const std::uint32_t count = in.u32();
  if (count == 0 || count > scene.sensors.size()) return corrupt("sensors that the scene lacks");
  std::vector<SensorHead> heads(count);
  for (std::uint32_t i = 0; i < count; ++i) {
    SensorHead& head = heads[i];
    head.sensor = SensorId{in.u32()};
    if (index_of(head.sensor) >= scene.sensors.size() ||
        (i > 0 && head.sensor <= heads[i - 1].sensor))
      return corrupt("sensors that the scene lacks");
    const SensorConfig& sensor = scene.sensor(head.sensor);
    head.captured_at = TimePoint(Duration(static_cast<std::int64_t>(in.u64())));
    const std::uint32_t flags = in.u32();
    head.has_color = flags & kHasColor;
    if (head.has_color && !sensor.color_camera) return corrupt("colour of a sensor without it");
    auto pose = read_pose(sensor, flags & kOwnPose, in);
    if (!pose) return pose.error();
    head.T_world_depth = *pose;
  }
  if (!in.ok()) return corrupt("the message ends early");
  return heads;
}

}  // namespace mr::baseline
