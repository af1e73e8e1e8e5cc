#pragma once

#include <string>
#include <vector>

namespace mr::net {

/// The addresses of this machine that others can reach it at, IPv4 first: none of loopback, and of
/// IPv6 no link-local one. Without brackets.
std::vector<std::string> local_addresses();

}  // namespace mr::net
