#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "mr/core/result.h"
#include "mr/gateway/tokens.h"
#include "mr/net/web_server.h"
#include "mr/scene/scene.h"

namespace mr::gateway {

/// How the gateway controls access: the host names that it answers for, TLS, and tokens.
struct AccessPolicy {
  std::vector<std::string> hosts;               ///< as WebConfig::hosts
  std::optional<net::Certificate> certificate;  ///< none: plain HTTP
  std::optional<Tokens> tokens;                 ///< none: every visitor is admitted
  std::vector<std::string> notices;             ///< to be logged for the operator, one line each

  /// Reads the certificate and the tokens that the scene file names; a self-signed certificate is
  /// kept in `state_folder`. Errors invalid, io, not_found: they cannot be used. invalid, too: the
  /// gateway would listen beyond this machine without TLS and tokens, and without 'open: true'.
  static Result<AccessPolicy> open(const GatewayConfig& config,
                                   const std::filesystem::path& state_folder);
};

/// Configuration of the gateway's web server; `page`: folder of the built viewer.
net::WebConfig web_config(const GatewayConfig& config, const AccessPolicy& policy,
                          const std::filesystem::path& page);

/// The URLs under which people reach the viewer: at least one, the most useful first. A gateway
/// that listens on all addresses has one for each address of this machine.
std::vector<std::string> urls_of(const GatewayConfig& config, int port);

}  // namespace mr::gateway
