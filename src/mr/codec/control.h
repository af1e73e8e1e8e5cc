#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "mr/core/chunk.h"
#include "mr/core/coding_plan.h"
#include "mr/core/frame.h"
#include "mr/core/result.h"

namespace mr::codec {

/// What goes against the stream, on every hop: what a receiver lacks, how far it has come, and how
/// the nodes from there on are to code (docs/wire-format.md, "Control and answer").
struct Control {
  static constexpr std::uint32_t kVersion = 1;
  static constexpr std::size_t kMaxChunks = 4096, kMaxStreams = 1024;

  std::vector<StreamId> key_frames;    ///< streams that need one, sorted, at most kMaxStreams
  std::vector<ChunkKey> chunks;        ///< wanted, at most kMaxChunks
  std::optional<std::uint64_t> taken;  ///< sequence of the newest packet that was made use of
  bool whole_head = false;             ///< the base of the node's packets did not come
  /// Sequence of the newest packet whose still surface is shown: it need not be sent as moving.
  std::optional<std::uint64_t> shown = {};
  bool time = false;  ///< what the node's clock says; the answer tells that and nothing else
  /// From the next frame on; the node passes it on to its own inputs. Its problems() are none.
  std::optional<ScenePlan> plan = {};

  bool empty() const {
    return key_frames.empty() && chunks.empty() && !taken && !whole_head && !shown && !time &&
           !plan;
  }
  /// Whether an answer is wanted.
  bool wants_answer() const { return !chunks.empty() || time; }
  bool wants_key_frame(StreamId stream) const;
  friend bool operator==(const Control&, const Control&) = default;
};

std::vector<std::byte> encode_control(const Control& control);

/// Reads bytes that may come from anyone. Errors: corrupt, too_large; unsupported: a message of
/// another version, which is to be answered by encode_refusal().
Result<Control> decode_control(std::span<const std::byte> bytes);

/// The answer to a request for the time.
std::vector<std::byte> encode_time(TimePoint now);
/// Nothing where the bytes are another kind of answer. Errors: corrupt.
std::optional<Result<TimePoint>> decode_time(std::span<const std::byte> bytes);

/// The answer to what the node cannot read: one line that says why, of at most kMostWhy bytes.
inline constexpr std::size_t kMostWhy = 200;
std::vector<std::byte> encode_refusal(const std::string& why);
/// Nothing where the bytes are another kind of answer. Errors: corrupt.
std::optional<Result<std::string>> decode_refusal(std::span<const std::byte> bytes);

}  // namespace mr::codec
