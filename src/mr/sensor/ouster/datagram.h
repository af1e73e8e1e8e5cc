#pragma once

#include <array>
#include <compare>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "mr/core/frame.h"
#include "mr/core/result.h"

namespace mr::sensor {

/// An IPv4 address (in the first four bytes) or an IPv6 one, in network order.
struct IpAddress {
  std::array<std::uint8_t, 16> bytes{};
  bool v6 = false;

  friend auto operator<=>(const IpAddress&, const IpAddress&) = default;
};

/// "192.168.1.10" or "fe80::1".
std::string to_string(const IpAddress& address);
/// The inverse; invalid: the text is no numeric address.
Result<IpAddress> parse_ip_address(const std::string& text);

struct Endpoint {
  IpAddress address;
  std::uint16_t port = 0;

  friend auto operator<=>(const Endpoint&, const Endpoint&) = default;
};

/// One UDP datagram. `payload` belongs to whoever received it, until the next one is asked for.
struct Datagram {
  TimePoint captured_at{};  ///< by the clock of the computer that received it
  Endpoint from, to;        ///< a live socket does not know the address in `to`
  std::span<const std::byte> payload;
};

}  // namespace mr::sensor
