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

/// Whether a text has the form "something:port": the check for scene files.
bool is_address(const std::string& text);

/// The inverse of parse_address().
std::string to_string(const Address& address);

}  // namespace mr::net
