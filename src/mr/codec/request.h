#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "mr/core/chunk.h"
#include "mr/core/frame.h"
#include "mr/core/result.h"

namespace mr::codec {

/// What a receiver says to the node that it receives from (docs/wire-format.md, "Request and
/// answer"): what it lacks, and how far it has come.
struct Request {
  static constexpr std::size_t kMaxChunks = 4096, kMaxStreams = 1024;

  std::vector<std::uint32_t> key_frames;  ///< streams that need one, sorted, at most kMaxStreams
  std::vector<ChunkKey> chunks;           ///< wanted, at most kMaxChunks
  std::optional<std::uint64_t> taken;     ///< sequence of the newest packet that was made use of
  bool whole_head = false;                ///< the base of the node's packets did not come
  /// Sequence of the newest packet whose still surface is shown: it need not be sent as moving.
  std::optional<std::uint64_t> shown = {};
  bool time = false;  ///< what the node's clock says; the answer tells that and nothing else

  bool empty() const {
    return key_frames.empty() && chunks.empty() && !taken && !whole_head && !shown && !time;
  }
  /// Whether an answer is wanted.
  bool wants_answer() const { return !chunks.empty() || time; }
  bool wants_key_frame(std::uint32_t stream) const;
  friend bool operator==(const Request&, const Request&) = default;
};

std::vector<std::byte> encode_request(const Request& request);

/// Reads bytes that may come from anyone. Errors: corrupt, too_large.
Result<Request> decode_request(std::span<const std::byte> bytes);

/// The answer to a request for the time.
std::vector<std::byte> encode_time(TimePoint now);
/// Nothing where the bytes are another kind of answer. Errors: corrupt.
std::optional<Result<TimePoint>> decode_time(std::span<const std::byte> bytes);

}  // namespace mr::codec
