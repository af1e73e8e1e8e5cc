#pragma once

#include <cstddef>
#include <cstdint>
#include <list>
#include <optional>
#include <span>
#include <vector>

#include "mr/sensor/ouster/datagram.h"

namespace mr::sensor {

/// One fragment of an IPv4 packet, without its IP header.
struct IpFragment {
  IpAddress from, to;
  std::uint16_t id = 0;
  std::uint8_t protocol = 0;
  std::size_t offset = 0;  ///< bytes, a multiple of 8
  bool more = false;       ///< not the last one
  std::span<const std::byte> bytes;
};

/// Puts fragmented IPv4 packets together (RFC 791). Fragments may come in any order, twice, or
/// overlapping (the first one's bytes count); those of several packets may be interleaved. Packets
/// that stay incomplete while many other fragments come are given up. Holds at most 4 MiB.
class IpReassembly {
 public:
  static constexpr std::size_t kPackets = 64;         ///< incomplete at once
  static constexpr std::uint64_t kPatience = 4096;    ///< fragments since a packet's last one
  static constexpr std::size_t kPacketBytes = 65535;  ///< of one packet

  /// The packet that this fragment completes, valid until the next call.
  std::optional<std::span<const std::byte>> add(const IpFragment& fragment);

  /// Packets given up so far: incomplete ones and those whose fragments contradict each other.
  std::uint64_t lost() const { return lost_; }
  std::size_t pending() const { return partials_.size(); }

 private:
  struct Partial {
    IpAddress from, to;
    std::uint16_t id = 0;
    std::uint8_t protocol = 0;
    std::vector<std::byte> bytes;
    std::vector<bool> received;  ///< by 8 bytes
    std::size_t received_count = 0;
    std::optional<std::size_t> size;  ///< known from the last fragment
    std::uint64_t last_at = 0;        ///< count of fragments
  };

  Partial& partial_of(const IpFragment& fragment);
  void give_up_stale();
  static bool contradicts(const Partial& partial, const IpFragment& fragment);
  static void copy_new(Partial& partial, const IpFragment& fragment);

  std::list<Partial> partials_;  ///< the one of the newest fragment first
  std::vector<std::byte> complete_;
  std::uint64_t fragments_ = 0, lost_ = 0;
};

}  // namespace mr::sensor
