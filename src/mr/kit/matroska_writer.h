#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <span>
#include <string>
#include <vector>

#include "mr/core/result.h"

/// Writes Matroska files (RFC 8794, RFC 9559): recordings of synthetic sensors, and every variant
/// that tests of readers want.
namespace mr::kit {

struct MatroskaTrack {
  enum class Kind : std::uint8_t { video = 1, audio = 2, subtitle = 17 };

  std::uint64_t number = 1;  ///< by which blocks name it, from 1
  std::uint64_t uid = 1;     ///< by which tags name it, not 0
  Kind kind = Kind::video;
  std::string name, codec_id;
  std::vector<std::byte> codec_private;          ///< may be empty
  std::chrono::nanoseconds default_duration{0};  ///< of a frame; 0: not said
  int width = 0, height = 0;                     ///< pixels, of video
};

struct MatroskaAttachment {
  std::string file_name, mime_type;
  std::uint64_t uid = 1;  ///< not 0
  std::vector<std::byte> data;
};

/// A tag of a track, of an attachment, or with both 0 of the whole file.
struct MatroskaTag {
  std::string name, value;
  std::uint64_t track_uid = 0, attachment_uid = 0;
};

struct MatroskaSettings {
  std::string title, writing_app;
  std::chrono::sys_time<std::chrono::seconds> date{};  ///< of the recording
  std::chrono::nanoseconds tick{1000};                 ///< unit of all times (TimestampScale)
  std::chrono::nanoseconds cluster_span{32'000'000};   ///< a cluster covers less
  std::chrono::nanoseconds cue_every{1'000'000'000};   ///< at most one entry of the index in that
  bool cues = true;        ///< the index at the end; of the first track only
  bool checksums = true;   ///< CRC-32 of clusters and tags
  bool known_size = true;  ///< of the segment; else it is marked unknown
  bool tags_first = true;  ///< attachments and tags before the clusters, else after them
};

/// How several frames share a block.
enum class MatroskaLacing : std::uint8_t { none = 0, xiph = 1, fixed = 2, ebml = 3 };

/// Writes one file from front to back; memory holds one cluster. close() writes what is known only
/// then into room that was kept for it: size, list of positions, duration, and the unit of time.
/// A file that was never closed is that of a recorder that was killed. Not thread-safe.
class MatroskaWriter {
 public:
  using Frame = std::span<const std::byte>;
  using Time = std::chrono::nanoseconds;  ///< since the start of the file, not negative

  /// Makes the file and writes everything before the first cluster.
  static Result<MatroskaWriter> create(const std::filesystem::path& file, MatroskaSettings settings,
                                       std::vector<MatroskaTrack> tracks,
                                       std::vector<MatroskaAttachment> attachments,
                                       std::vector<MatroskaTag> tags);

  /// One frame as a SimpleBlock. Times should rise, give or take some milliseconds; they are
  /// rounded to ticks.
  Status write_frame(std::uint64_t track, Time at, Frame frame);

  /// Frames as a BlockGroup with its duration: 1 frame without lacing, 1 to 256 with it; of one
  /// size with `fixed`.
  Status write_group(std::uint64_t track, Time at, Time duration, std::span<const Frame> frames,
                     MatroskaLacing lacing);

  /// Ends the cluster and leaves so many bytes, at least 16, without content (a Void element), as a
  /// hole where the file system has them.
  Status skip(std::uint64_t bytes);

  Status close();

 private:
  using Bytes = std::vector<std::byte>;
  struct Position {
    std::uint32_t id = 0;
    std::uint64_t at = 0;  ///< of the element, from the segment's first byte
  };
  struct Cue {
    std::int64_t ticks = 0;
    std::uint64_t cluster_at = 0;
  };

  MatroskaWriter(std::filesystem::path file, MatroskaSettings settings,
                 std::vector<MatroskaTrack> tracks, std::vector<MatroskaAttachment> attachments,
                 std::vector<MatroskaTag> tags);

  Status begin();
  Status put(const Bytes& bytes);
  Status put_top(std::uint32_t id, const Bytes& content);
  Status put_attachments_and_tags();
  Status add_block(std::uint64_t track, Time at, Frame payload, const Bytes& after,
                   std::uint8_t flags, bool is_group);
  Status flush_cluster();
  Status fill_kept_room();
  std::uint64_t in_segment() const { return at_ - segment_at_; }

  std::filesystem::path file_;
  MatroskaSettings settings_;
  std::vector<MatroskaTrack> tracks_;
  std::vector<MatroskaAttachment> attachments_;
  std::vector<MatroskaTag> tags_;
  std::ofstream stream_;
  std::uint64_t at_ = 0;             ///< bytes written
  std::uint64_t segment_at_ = 0;     ///< its first byte after the header
  Bytes cluster_;                    ///< blocks of the open cluster
  std::int64_t cluster_ticks_ = -1;  ///< its time; -1: none is open
  std::int64_t last_ticks_ = 0;      ///< the latest block's time
  std::vector<Position> positions_;
  std::vector<Cue> cues_;
};

}  // namespace mr::kit
