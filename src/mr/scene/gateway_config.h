#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "mr/core/range.h"
#include "mr/core/secret_source.h"
#include "mr/core/vec.h"

namespace mr {

/// Where a viewer starts; metres, world frame.
struct StartConfig {
  Vec3d eye, look_at;
  friend bool operator==(const StartConfig&, const StartConfig&) = default;
};

/// With what the gateway speaks TLS.
struct TlsConfig {
  std::filesystem::path cert, key;  ///< PEM files; both empty: a certificate of its own
  friend bool operator==(const TlsConfig&, const TlsConfig&) = default;
};

struct GatewayConfig {
  std::string listen = "127.0.0.1:8080";  ///< host:port; port 0: any free one
  std::optional<StartConfig> start{};     ///< none: the viewer looks for a good place
  std::optional<TlsConfig> tls{};         ///< none: plain HTTP
  SecretSource tokens{};                  ///< of those who may watch; empty: anybody
  std::vector<std::string> hosts{};       ///< names that it answers for; empty: see WebConfig
  bool open = false;                      ///< beyond this machine without TLS and tokens, knowingly
  int viewers = 64;                       ///< at once
  int viewers_per_address = 16;

  static constexpr Range kViewers{1, 10'000};
  /// The invalid fields, one line each; empty: valid.
  std::vector<std::string> problems() const;
  friend bool operator==(const GatewayConfig&, const GatewayConfig&) = default;
};

}  // namespace mr
