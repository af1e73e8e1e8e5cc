#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <vector>

#include "mr/core/result.h"
#include "mr/net/outbox.h"

namespace mr::net {

/// A message over NATS is split into fragments no larger than the server's max_payload. Each
/// fragment has the header {u32 magic, u64 message id, u16 part, u16 parts}, little endian.
inline constexpr std::size_t kFragmentHeaderBytes = 16;

/// Number of parts, at least one. too_large: more than 65535 would be needed.
Result<std::uint16_t> fragment_count(std::size_t message_bytes, std::size_t max_payload);

/// Part `part` of `parts`, header included, as fragment_count() divides the message.
std::vector<std::byte> fragment(std::span<const std::byte> message, std::uint64_t id,
                                std::uint16_t part, std::uint16_t parts, std::size_t max_payload);

struct ReassemblyLimits {
  std::size_t message_bytes = 64u << 20;
  std::size_t messages = 64;         ///< incomplete at once; above it the oldest is lost
  std::size_t bytes = 128u << 20;    ///< held in incomplete messages; ditto
  std::chrono::seconds patience{2};  ///< without a new fragment for so long a message is lost
};

/// Reassembles messages from fragments. Fragments of one message must come in order; those of
/// several messages may be interleaved. No socket or clock inside.
class Reassembly {
 public:
  using TimePoint = std::chrono::steady_clock::time_point;

  explicit Reassembly(const ReassemblyLimits& limits) : limits_(limits) {}

  /// Takes one fragment; returns the message that it completes, else null.
  Message accept(TimePoint now, std::span<const std::byte> bytes);

  /// How many messages were given up incomplete, and inputs that were no fragment, so far.
  std::uint64_t lost() const { return lost_; }

 private:
  struct Partial {
    std::uint16_t parts = 0;
    std::uint16_t next = 0;
    TimePoint until;
    std::vector<std::byte> bytes;
  };
  using Partials = std::map<std::uint64_t, Partial>;

  void lose(Partials::iterator at);
  void lose_late(TimePoint now);
  Message append(Partials::iterator at, TimePoint now, std::span<const std::byte> bytes);

  ReassemblyLimits limits_;
  Partials partials_;
  std::size_t held_ = 0;  ///< bytes in partials_
  std::uint64_t lost_ = 0;
  std::uint64_t last_lost_ = 0;  ///< message id
};

}  // namespace mr::net
