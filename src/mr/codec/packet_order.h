#pragma once

#include <cstdint>
#include <optional>

#include "mr/core/frame.h"
#include "mr/core/result.h"

namespace mr::codec {

/// Which packets of one node go on from those before. Packets come from a network where one may be
/// damaged, forged or sent again: none of these may silence the node, nor go back in time. So what
/// is older, or far ahead, is refused; and where for a while nothing but that comes, it was the
/// packet taken last that was wrong, and all starts afresh. No clock inside.
class PacketOrder {
 public:
  static constexpr std::uint64_t kMostAhead = 4096;  ///< packets that may be missing
  static constexpr Duration kPatience = std::chrono::seconds(1);
  static constexpr int kRefusals = 2;

  /// next: goes on from the one before. afresh: nothing of what came before holds.
  enum class Verdict { next, afresh };

  /// Takes the packet, or refuses it (invalid).
  Result<Verdict> take(std::uint32_t epoch, std::uint64_t sequence, TimePoint now);

  /// Whatever packet comes next is taken.
  void forget() { last_.reset(); }

 private:
  struct Last {
    std::uint32_t epoch;
    std::uint64_t sequence;
    TimePoint at;
  };
  std::optional<Error> objection(std::uint32_t epoch, std::uint64_t sequence) const;

  std::optional<Last> last_;
  int refused_ = 0;  ///< since the last that was taken
};

}  // namespace mr::codec
