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

/// What stands between viewers and the room: the names that the gateway answers for, TLS, tokens.
struct FrontDoor {
  std::vector<std::string> hosts;               ///< as WebConfig::hosts
  std::optional<net::Certificate> certificate;  ///< none: plain HTTP
  std::optional<Tokens> tokens;                 ///< none: anybody may watch
  std::vector<std::string> notices;             ///< for people, one line each

  /// Reads certificate and tokens. `state_folder` keeps a certificate of its own. invalid, io,
  /// not_found: they cannot be used; or it would be open to other machines though the scene does
  /// not say so.
  static Result<FrontDoor> open(const GatewayConfig& config,
                                const std::filesystem::path& state_folder);
};

/// How the gateway's web server is set up; `page`: folder of the built viewer.
net::WebConfig web_config(const GatewayConfig& config, const FrontDoor& door,
                          const std::filesystem::path& page);

/// The addresses that people open, at least one, the likeliest first: of a gateway that listens on
/// all addresses, those of this machine that others may reach.
std::vector<std::string> urls_of(const GatewayConfig& config, int port);

}  // namespace mr::gateway
