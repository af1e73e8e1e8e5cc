#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "mr/core/result.h"
#include "mr/sensor/ouster/datagram.h"

namespace mr::sensor {

/// Receives UDP datagrams from the network. One reader.
class UdpSocket {
 public:
  struct Options {
    std::string address{};   ///< numeric, of this computer; empty: all of IPv4 and IPv6
    std::uint16_t port = 0;  ///< 0: any free one
    /// What the system may hold until receive(). It gives less where net.core.rmem_max is lower.
    std::size_t buffer_bytes = std::size_t{16} << 20;
  };

  /// Errors: invalid: the address; io: the port is taken, or may not be used.
  static Result<UdpSocket> bind(const Options& options);

  UdpSocket(UdpSocket&& other) noexcept;
  UdpSocket& operator=(UdpSocket&& other) noexcept;
  ~UdpSocket();

  /// The next datagram; nothing when none came in time (or a signal came). io: the socket failed.
  Result<std::optional<Datagram>> receive(Duration timeout);

  std::uint16_t port() const { return port_; }
  /// What the system does give, by its own count (on Linux twice the payload).
  std::size_t buffer_bytes() const;
  /// Datagrams that the system dropped because the buffer was full, as known from the last one.
  std::uint32_t dropped() const { return dropped_; }

 private:
  explicit UdpSocket(int socket);

  int socket_ = -1;
  std::uint16_t port_ = 0;
  std::uint32_t dropped_ = 0;
  std::vector<std::byte> payload_;
};

}  // namespace mr::sensor
