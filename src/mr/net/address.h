#pragma once

#include <string>

#include "mr/core/result.h"

namespace mr::net {

struct Address {
  std::string host;  ///< name or number, without brackets
  std::string port;  ///< "0" … "65535"
};

/// Reads "host:port", "1.2.3.4:port" or "[v6]:port". invalid: anything else.
Result<Address> parse_address(const std::string& text);

/// Whether a text ends like an address, ":port" after something; scene files need no more.
bool is_address(const std::string& text);

/// As parse_address reads it.
std::string to_string(const Address& address);

}  // namespace mr::net
