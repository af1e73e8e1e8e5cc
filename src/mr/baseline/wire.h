#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "mr/baseline/baseline.h"
#include "mr/core/pose.h"

/// The wire format of the baselines: little-endian numbers and length-prefixed blocks, with a magic
/// number and a checksum in front. It has no versions: both ends must be of the same build.
namespace mr::baseline {

class ByteWriter {
 public:
  void u32(std::uint32_t v) { number(v, 4); }
  void u64(std::uint64_t v) { number(v, 8); }
  void f32(float v);
  void f64(double v);
  /// A length-prefixed block; at most 2^32 - 1 bytes.
  void block(std::span<const std::byte> bytes);

  Bytes take() { return std::move(bytes_); }

 private:
  void number(std::uint64_t v, int bytes);

  Bytes bytes_;
};

/// Reads what ByteWriter wrote. After reading past the end, all numbers are 0, blocks are empty and
/// ok() is false.
class ByteReader {
 public:
  explicit ByteReader(std::span<const std::byte> bytes) : rest_(bytes) {}

  std::uint32_t u32() { return static_cast<std::uint32_t>(number(4)); }
  std::uint64_t u64() { return number(8); }
  float f32();
  double f64();
  std::span<const std::byte> block();

  bool ok() const { return ok_; }
  /// Everything was read, and nothing beyond the end.
  bool at_end() const { return ok_ && rest_.empty(); }
  std::size_t left() const { return rest_.size(); }

 private:
  std::uint64_t number(std::size_t bytes);

  std::span<const std::byte> rest_;
  bool ok_ = true;
};

/// The type of a message.
enum class Message : std::uint8_t {
  holoportation_geometry = 1,
  holoportation_texture,
  plus_geometry,
  video_texture,
  points_draco,
  points_vpcc,
  depth_video,
};

/// Prepends magic number, type and checksum to a message's body.
Bytes seal(Message kind, const Bytes& body);
/// Verifies a message and returns its body. corrupt: another type, too short, or a wrong checksum.
Result<std::span<const std::byte>> open_seal(Message kind, std::span<const std::byte> message);

/// LZ4 (block format), without a header of its own. Input below 2^31 bytes.
Result<Bytes> lz4_compress(std::span<const std::byte> raw);
/// Fills `raw` exactly; corrupt otherwise. Sizes that no LZ4 block can expand to are refused by
/// lz4_plausible() before anything is allocated for them.
Status lz4_decompress(std::span<const std::byte> packed, std::span<std::byte> raw);
bool lz4_plausible(std::size_t packed_bytes, std::uint64_t raw_bytes);

inline Error corrupt(const std::string& what) {
  return {Error::Cause::corrupt, "baseline: " + what};
}

/// The metadata of a sensor's capture that the receiver needs in addition to the scene file.
struct SensorHead {
  SensorId sensor{};
  TimePoint captured_at{};
  bool has_color = false;
  Pose T_world_depth;
};

/// The heads of a capture, sorted by sensor.
std::vector<SensorHead> heads_of(const Scene& scene, std::span<const Frame> capture);
/// Poses from the scene file are written as their index.
void write_heads(const Scene& scene, std::span<const Frame> capture, ByteWriter& out);
Result<std::vector<SensorHead>> read_heads(const Scene& scene, ByteReader& in);

}  // namespace mr::baseline
