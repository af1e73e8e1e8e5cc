#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "mr/core/image.h"
#include "mr/synth/view.h"

namespace mr::synth {

/// The format of a sensor's rendered frames, to recognize files of other rigs.
struct ShotLayout {
  std::uint64_t key = 0;  ///< hash of everything that the pictures depend on
  int depth_width = 0, depth_height = 0, color_width = 0, color_height = 0;

  std::size_t depth_pixels() const { return static_cast<std::size_t>(depth_width) * depth_height; }
  std::size_t color_bytes() const {
    return 3 * static_cast<std::size_t>(color_width) * color_height;
  }
};

/// A frame in the cache; refers to the mapped file until the next call.
struct ShotRef {
  std::span<const std::uint16_t> depth_mm;
  std::span<const Shot::Span> spans;
  std::span<const std::uint8_t> rgb;
};

/// A cache file of one sensor's rendered frames: the empty room's colour, then a log of frames in
/// any order. All records have checksums; damaged or truncated ones count as missing. One process
/// at a time appends (flock) while others read; a process that could not append tries again at the
/// next frame. Not thread-safe.
class ShotCache {
 public:
  /// `budget`: bytes that may still be written, shared with other caches; outlives this.
  ShotCache(std::filesystem::path file, const ShotLayout& layout,
            std::atomic<std::int64_t>& budget);
  ~ShotCache();
  ShotCache(const ShotCache&) = delete;
  ShotCache& operator=(const ShotCache&) = delete;

  /// The empty room, where the file holds it.
  std::optional<ImageRgb> empty_room() const;
  std::optional<ShotRef> find(std::uint32_t frame);
  /// How many of the frames `begin` to `end` - 1 it holds.
  int count(int begin, int end) const;

  /// Creates the file unless it exists. A cache that cannot be written stays empty.
  void begin(const ImageRgb& empty_room);
  void add(std::uint32_t frame, const Shot& shot);

 private:
  struct Record {
    std::size_t offset = 0;  ///< of its head
    bool checked = false;    ///< its payload's sum was right
  };

  bool open();
  void close();
  bool header_is_good() const;
  void map_all();
  void scan();
  bool lock();

  const std::filesystem::path file_;
  const ShotLayout layout_;
  std::atomic<std::int64_t>& budget_;
  int descriptor_ = -1;
  bool locked_ = false;
  const std::byte* data_ = nullptr;
  std::size_t mapped_ = 0, end_ = 0;            // end_: of the last whole record
  std::vector<std::optional<Record>> records_;  // by frame
};

/// Evicts the oldest rigs from a folder of caches until the others, without `keep`, need at most
/// `bytes` (LRU). Marks `keep` as the newest.
void trim_caches(const std::filesystem::path& folder, const std::filesystem::path& keep,
                 std::uintmax_t bytes);

/// Size of the files in a folder.
std::uintmax_t folder_bytes(const std::filesystem::path& folder);

}  // namespace mr::synth
