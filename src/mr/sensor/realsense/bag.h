#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "mr/core/frame.h"
#include "mr/core/result.h"

namespace mr::sensor {

/// A message of a bag.
struct BagMessage {
  std::string_view topic;            ///< valid as long as its reader
  Duration recorded{};               ///< when it was recorded, by the recorder's clock
  std::span<const std::byte> bytes;  ///< as ROS serializes it; valid until the reader reads on
};

/// Reads a ROS bag of version 2.0 forward, a message at a time, without a ROS library: files of any
/// size, also those that were never closed. Chunks may be uncompressed or LZ4.
class BagReader {
 public:
  /// Errors: not_found, io; corrupt: no bag, or one of another version.
  static Result<BagReader> open(const std::filesystem::path& file);
  BagReader(BagReader&&) noexcept;
  BagReader& operator=(BagReader&&) noexcept;
  ~BagReader();

  /// The next whole message; nothing at the end, which of a bag that was never closed is wherever
  /// it breaks off. Errors come once and end the bag: corrupt (damaged, or cut off), too_large,
  /// unsupported (chunks compressed by bz2).
  Result<std::optional<BagMessage>> next();

  bool is_closed() const;  ///< the recorder finished the file
  bool has_index() const;  ///< it is closed, and the index at its end can be read
  /// By number of connection: all of the file where it has an index, else of what was read.
  const std::map<std::uint32_t, std::string>& topics() const;

  /// Goes to a place from where next() reaches what was recorded at a time: the beginning, or
  /// nearer where there is an index.
  Status seek(Duration recorded);
  /// Goes to the beginning of the last chunk with messages of a topic. False: nothing is known of
  /// one, and the place is as before.
  bool seek_last(std::string_view topic);
  Status rewind();

 private:
  struct Impl;
  explicit BagReader(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace mr::sensor
