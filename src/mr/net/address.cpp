#include "mr/net/address.h"

#include <charconv>

namespace mr::net {

Result<Address> parse_address(const std::string& text) {
  const Error error{Error::Cause::invalid,
                    "\"" + text + "\" is no address: write host:port, or [address]:port for IPv6"};
  const std::size_t colon = text.rfind(':');
  if (colon == std::string::npos || colon == 0) return error;
  Address address{text.substr(0, colon), text.substr(colon + 1)};
  if (address.host.front() == '[' && address.host.back() == ']')
    address.host = address.host.substr(1, address.host.size() - 2);
  else if (address.host.find_first_of("[]:") != std::string::npos)
    return error;
  unsigned port = 0;
  const char* end = address.port.data() + address.port.size();
  const auto read = std::from_chars(address.port.data(), end, port);
  if (address.host.empty() || read.ec != std::errc() || read.ptr != end || port > 65535)
    return error;
  address.port = std::to_string(port);
  return address;
}

std::string to_string(const Address& address) {
  const bool v6 = address.host.find(':') != std::string::npos;
  return (v6 ? "[" + address.host + "]" : address.host) + ":" + address.port;
}

bool is_address(const std::string& text) {
  const std::size_t colon = text.rfind(':');
  if (colon == std::string::npos || colon == 0) return false;
  int port = -1;
  const char *begin = text.data() + colon + 1, *end = text.data() + text.size();
  const auto [stop, failed] = std::from_chars(begin, end, port);
  return failed == std::errc() && stop == end && port >= 0 && port <= 65535;
}

}  // namespace mr::net
