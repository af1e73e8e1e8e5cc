#pragma once

#include <string>
#include <vector>

namespace mr::net {

/// The addresses of this machine's network interfaces, IPv4 first, without loopback and IPv6
/// link-local ones. IPv6 addresses have no brackets.
std::vector<std::string> local_addresses();

}  // namespace mr::net
