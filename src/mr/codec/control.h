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

/// The feedback message, sent upstream on every hop: what the receiver requests, what it has
/// received, and the coding plan for the nodes upstream (docs/wire-format.md, "Control and
/// answer").
struct Control {
  static constexpr std::uint32_t kVersion = 1;
  static constexpr std::size_t kMaxChunks = 4096, kMaxStreams = 1024;

  std::vector<StreamId> key_frames;    ///< streams for which a key frame is requested, sorted
  std::vector<ChunkKey> chunks;        ///< requested, at most kMaxChunks
  std::optional<std::uint64_t> taken;  ///< acknowledgement: newest packet used, by its sequence
  bool whole_head = false;             ///< requests a packet with its base head: the base was lost
  /// Sequence of the newest packet whose still surface the root shows: the sensor need not send
  /// that surface as moving any longer (hand-over).
  std::optional<std::uint64_t> shown = {};
  bool time = false;  ///< requests the node's clock; the answer holds nothing else
  /// In force from the next frame on; the node passes it on to its own inputs. It is valid.
  std::optional<ScenePlan> plan = {};
  /// Mbit/s at which viewers can follow, above 0, for the root's rate control.
  std::optional<double> target_mbps = {};

  bool empty() const {
    return key_frames.empty() && chunks.empty() && !taken && !whole_head && !shown && !time &&
           !plan && !target_mbps;
  }
  /// Whether the sender expects an answer.
  bool wants_answer() const { return !chunks.empty() || time; }
  bool wants_key_frame(StreamId stream) const;
  friend bool operator==(const Control&, const Control&) = default;
};

/// A control that asks for this plan. Error invalid: the first of the plan's problems().
Result<Control> plan_control(const ScenePlan& plan);

std::vector<std::byte> encode_control(const Control& control);

/// Decodes untrusted bytes. Errors: corrupt, too_large; unsupported: a message of another version,
/// to be answered by encode_refusal().
Result<Control> decode_control(std::span<const std::byte> bytes);

/// The answer to a request for the time.
std::vector<std::byte> encode_time(TimePoint now);
/// Decodes such an answer; nothing if the bytes are another kind of answer. Errors: corrupt.
std::optional<Result<TimePoint>> decode_time(std::span<const std::byte> bytes);

/// The answer to a message that the node cannot read: the reason in one line, at most kMostWhy
/// bytes.
inline constexpr std::size_t kMostWhy = 200;
std::vector<std::byte> encode_refusal(const std::string& why);
/// Decodes such an answer; nothing if the bytes are another kind of answer. Errors: corrupt.
std::optional<Result<std::string>> decode_refusal(std::span<const std::byte> bytes);

}  // namespace mr::codec
