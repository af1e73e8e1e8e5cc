#pragma once

#include <cstdint>
#include <optional>

#include "mr/core/frame.h"
#include "mr/core/result.h"

namespace mr::codec {

/// Accepts the packets of one node in increasing order of sequence. A damaged, forged or replayed
/// packet must neither block the node's later packets nor move the stream back in time. So packets
/// that are older, or far ahead, are refused; if for kPatience only such packets arrive, the last
/// accepted one is assumed to have been wrong, and the order starts afresh. No clock inside.
class PacketOrder {
 public:
  static constexpr std::uint64_t kMostAhead = 4096;  ///< largest gap in sequence numbers
  static constexpr Duration kPatience = std::chrono::seconds(1);
  static constexpr int kRefusals = 2;

  /// next: continues the packets before. afresh: the state from the packets before is invalid.
  enum class Verdict { next, afresh };

  /// Accepts a packet, or refuses it with Error invalid.
  Result<Verdict> take(std::uint32_t epoch, std::uint64_t sequence, TimePoint now);

  /// Resets: the next packet is accepted whatever its number.
  void forget() { last_.reset(); }

 private:
  struct Last {
    std::uint32_t epoch;
    std::uint64_t sequence;
    TimePoint at;
  };
  std::optional<Error> objection(std::uint32_t epoch, std::uint64_t sequence) const;

  std::optional<Last> last_;
  int refused_ = 0;  ///< packets since the last accepted one
};

}  // namespace mr::codec
