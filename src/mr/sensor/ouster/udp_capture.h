#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>

#include "mr/core/result.h"
#include "mr/sensor/ouster/datagram.h"

namespace mr::sensor {

/// Reads the UDP datagrams of a capture file: pcap (micro- or nanoseconds, either byte order) or
/// pcapng with one kind of link. Links: Ethernet (VLAN tags, too), Linux "any" (SLL, SLL2), raw IP,
/// and loopback. Fragmented IPv4 datagrams are put together; of IPv6 only unfragmented ones
/// without extension headers are read. Everything else is passed over and counted.
class PcapReader {
 public:
  struct Counts {
    std::uint64_t datagrams = 0;
    std::uint64_t other = 0;       ///< frames that are not UDP
    std::uint64_t damaged = 0;     ///< frames that are shorter than their headers say
    std::uint64_t incomplete = 0;  ///< datagrams of which fragments are missing
  };

  /// Errors: not_found, io; corrupt: no capture file; unsupported: another link. They name the
  /// file.
  static Result<PcapReader> open(const std::filesystem::path& file);
  /// The same of bytes, which must outlive the reader; `name` is for messages.
  static Result<PcapReader> open(std::span<const std::byte> bytes, const std::string& name);

  PcapReader(PcapReader&&) noexcept;
  PcapReader& operator=(PcapReader&&) noexcept;
  ~PcapReader();

  /// The next datagram; nothing at the end. corrupt: the file ends within a frame or is damaged;
  /// what came before was whole, and nothing comes after.
  Result<std::optional<Datagram>> next();

  Counts counts() const;

 private:
  struct Impl;
  explicit PcapReader(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace mr::sensor
