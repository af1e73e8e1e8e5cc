#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "mr/core/secret_source.h"

namespace mr::net {

/// The NATS server that connects nodes, and a node's identity. Files are read when a node connects.
struct NatsConfig {
  std::string url = {};  ///< "nats://host:port" or "tls://…", several after commas; empty: no NATS
  std::filesystem::path ca = {};  ///< trusted certificate authorities; empty: the system's
  std::filesystem::path certificate = {}, key = {};  ///< of this node, PEM; both or none
  std::string nkey = {};                   ///< public NKey of this node, "U…"; empty: none
  std::filesystem::path nkey_seed = {};    ///< file with its seed
  std::filesystem::path credentials = {};  ///< file of a JWT and its seed; instead of an NKey

  /// The invalid fields, one line each; empty: valid.
  std::vector<std::string> problems() const;
  /// Whether a text looks like the public NKey of a user.
  static bool is_user_nkey(std::string_view text);
  friend bool operator==(const NatsConfig&, const NatsConfig&) = default;
};

/// How the nodes of a scene find each other when they run as processes of their own.
struct NetworkConfig {
  NatsConfig nats;
  std::map<std::string, std::string> tcp;  ///< node → host:port; empty: no TCP
  SecretSource tcp_secret;                 ///< shared by all nodes; empty: none

  /// The invalid fields, one line each; empty: valid.
  std::vector<std::string> problems() const;
  friend bool operator==(const NetworkConfig&, const NetworkConfig&) = default;
};

}  // namespace mr::net
