#pragma once

#include <string>
#include <vector>

#include "mr/core/result.h"
#include "mr/net/network_config.h"

namespace mr::net {

/// Splits a comma-separated list of server URLs. invalid: one of them is no NATS URL.
Result<std::vector<std::string>> nats_servers(const std::string& urls);

/// The server URLs without user, password and token, for logs.
std::string loggable(const std::string& urls);

/// A text from libnats or a server made safe for a log line: printable and short.
std::string nats_text(std::string text);

/// Why there is no connection to a NATS server.
struct NatsFailure {
  enum class Kind { unreachable, tls, refused, other };
  Kind kind = Kind::other;
  std::string text;  ///< one line with advice; contains no secret
};

/// Diagnoses a failed or broken connection from libnats' status (natsStatus) and text. If those
/// are not enough, probes the server by TCP, which may take a second.
NatsFailure nats_failure(int status, const std::string& text, const NatsConfig& config);

/// A permissions violation: the server refused a publication or subscription.
struct NatsDenial {
  std::string subject;  ///< of an inbox without the last part, which counts requests
  bool publishing = false;
};

/// Reads `Permissions Violation for Publish to "subject"`.
NatsDenial nats_denial(const std::string& text);

}  // namespace mr::net
