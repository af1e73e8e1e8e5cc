#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "mr/core/chunk.h"
#include "mr/core/coding_plan.h"
#include "mr/core/frame.h"
#include "mr/core/range.h"
#include "mr/core/shared_bytes.h"
#include "mr/core/view.h"

namespace mr {

/// Spread of a depth sensor: sigma(z) = base + per_m2 · z².
struct Precision {
  double base_m = 0.001;
  double per_m2 = 0.0002;

  static constexpr Range kBase_m{0, 1, true}, kPer_m2{0, 1};
  /// What is impossible in it, a line each.
  std::vector<std::string> problems() const {
    return out_of_range({{"base_m", base_m, kBase_m}, {"per_m2", per_m2, kPer_m2}});
  }
  double sigma_m(double depth_m) const { return base_m + per_m2 * depth_m * depth_m; }
  friend bool operator==(const Precision&, const Precision&) = default;
};

/// A yes or no for each square tile of a picture, row by row; the last row and column may be cut
/// off. Empty: nothing is said.
struct TileMask {
  int tile_px = 0;
  int columns = 0, rows = 0;
  std::vector<std::uint8_t> tiles;  ///< [rows, columns] 0 or 1

  bool empty() const { return tiles.empty(); }
  /// Whether it has the number of tiles of a picture of this size.
  bool is_of(int width, int height) const {
    const auto count = [&](int side) { return (side + tile_px - 1) / tile_px; };
    return !empty() && columns == count(width) && rows == count(height);
  }
  bool at(int column, int row) const {
    return tiles[static_cast<std::size_t>(row) * columns + column] != 0;
  }
  friend bool operator==(const TileMask&, const TileMask&) = default;
};

/// A sensor that contributed to a packet, with all that a merger needs to cast its rays.
struct SourceInfo {
  SensorId sensor{};
  TimePoint captured_at{};
  Camera depth_camera;  ///< undistorted
  Pose T_world_depth;
  Precision precision;
  /// Where the sensor measures its still surface in this very capture, in tiles of its depth
  /// picture (8 px) and of its colour picture (16 px). Only on the way to the root.
  TileMask confirmed_depth{}, confirmed_color{};
  /// Where no surface may take its colour from the sensor's colour picture in this very capture
  /// (sensor/blind_tiles.h), in tiles of 16 px. Only on the way to the root.
  TileMask blind_color{};

  friend bool operator==(const SourceInfo&, const SourceInfo&) = default;
};

enum class TextureCodec : std::uint8_t { h264 };

/// One access unit of a texture stream: H.264 Annex B, BT.709 limited range.
struct TextureUnit {
  StreamId stream{};
  std::uint32_t serial = 0;  ///< counts the stream's units, so that a receiver sees what it lacks
  TextureCodec codec = TextureCodec::h264;
  std::uint32_t layout = 0;
  int width = 0, height = 0;  ///< decoded size
  bool key_frame = false;
  SharedBytes data;

  friend bool operator==(const TextureUnit&, const TextureUnit&) = default;
};

/// How far a texture stream has come. A packet without a unit of it shows the same picture as the
/// one before.
struct StreamState {
  StreamId stream{};
  std::uint32_t serial = 0;  ///< of the unit whose picture belongs to the packet

  friend bool operator==(const StreamState&, const StreamState&) = default;
};

/// The binary alpha plane of a texture stream's picture in one capture, coded
/// (codec/alpha_codec.h): what is textured where it is 0 is not drawn. Several pixels of the
/// picture, a square, share one of the plane; between the middles of these alpha is bilinear, and
/// over a half is drawn.
struct AlphaPlane {
  static constexpr int kStep_px = 2;  ///< of the planes that we make
  static constexpr int kMostStep_px = 16;
  static constexpr int kBlock_px = 8;  ///< a uniform block of the plane costs next to no bits

  StreamId stream{};
  int step_px = kStep_px;     ///< side of the square
  int width = 0, height = 0;  ///< of the plane
  SharedBytes data;

  friend bool operator==(const AlphaPlane&, const AlphaPlane&) = default;
};

/// What a sensor's frame is like, for the root's rate control: as rate::values_of() orders it.
struct FrameFeatures {
  static constexpr std::size_t kMostValues = 64;

  SensorId sensor{};
  bool has_color = false;
  std::vector<float> values;

  friend bool operator==(const FrameFeatures&, const FrameFeatures&) = default;
};

/// When a stage ended, for latency overlays.
struct TimeMark {
  std::string stage;  ///< "<node>/<stage>"
  TimePoint at{};

  friend bool operator==(const TimeMark&, const TimeMark&) = default;
};

/// What every node produces and every merger and client consumes. Mesh and
/// texture of one capture travel together.
struct Packet {
  std::string scene, node;
  std::uint32_t epoch = 0;  ///< another lattice or a restarted node is another epoch
  std::uint64_t sequence = 0;
  std::uint32_t coalesced = 0;      ///< packets right before this one that were folded into it
  TimePoint captured_at{};          ///< of a merged packet: the tick it was aligned to
  std::vector<SourceInfo> sources;  ///< each sensor's own time, sorted by sensor
  CodingPlan plan;
  std::vector<View> views;              ///< sorted by id, then by layer
  std::vector<ChunkKey> manifest;       ///< every live chunk, sorted
  std::vector<EncodedChunk> chunks;     ///< the payloads that are new, sorted by key
  std::vector<TextureUnit> textures;    ///< in order; none of a stream whose picture did not change
  std::vector<StreamState> streams;     ///< sorted by stream; codec::HeadWriter fills it in
  std::vector<AlphaPlane> alpha;        ///< of this capture, sorted by stream; none: all is drawn
  std::vector<FrameFeatures> features;  ///< sorted by sensor; only on the way to the root
  std::vector<TimeMark> marks;

  friend bool operator==(const Packet&, const Packet&) = default;
};

}  // namespace mr
