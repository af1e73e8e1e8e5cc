#pragma once

#include <string>
#include <vector>

#include "mr/core/result.h"
#include "mr/net/network_config.h"

namespace mr::net {

/// The servers of a URL, which commas separate. invalid: one of them is no NATS URL.
Result<std::vector<std::string>> nats_servers(const std::string& urls);

/// The servers without user, password or token: what may be logged.
std::string loggable(const std::string& urls);

/// A text of libnats or of a server as part of a line: printable, not long.
std::string nats_text(std::string text);

/// Why there is no connection to a NATS server.
struct NatsFailure {
  enum class Kind { unreachable, tls, refused, other };
  Kind kind = Kind::other;
  std::string text;  ///< one line, says what to do; holds no secret
};

/// From what libnats says of a failed or broken connection: its natsStatus and its text. Looks
/// whether the server can be reached where libnats does not say; that may take a second.
NatsFailure nats_failure(int status, const std::string& text, const NatsConfig& config);

/// What the server said when it did not let us publish or subscribe.
struct NatsDenial {
  std::string subject;  ///< of an inbox without the last part, which counts requests
  bool publishing = false;
};

/// Reads `Permissions Violation for Publish to "subject"`.
NatsDenial nats_denial(const std::string& text);

}  // namespace mr::net
