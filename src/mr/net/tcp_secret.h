#pragma once

#include <array>
#include <boost/asio/ssl/context.hpp>
#include <boost/system/error_code.hpp>
#include <memory>
#include <span>
#include <string>

#include "mr/core/result.h"
#include "mr/net/digest.h"

namespace mr::net {

/// The secret that the nodes of a scene share, as TLS 1.3 with a pre-shared key uses it: it proves
/// to each side that the other knows it, and is never sent. What was recorded stays unreadable even
/// for who learns it later (ephemeral keys). The side that connects must verify certificates, of
/// which none is trusted: else a certificate could take the secret's place. Immutable; must outlive
/// the streams that use it.
class TcpSecret {
 public:
  static constexpr std::size_t kShortest = 16;

  /// invalid: shorter than 16 characters. io: OpenSSL cannot be set up.
  static Result<std::shared_ptr<TcpSecret>> make(const std::string& secret);

  boost::asio::ssl::context& context() { return context_; }

 private:
  explicit TcpSecret(const std::string& secret);
  static const TcpSecret& of(SSL* ssl);
  static unsigned client_key(SSL* ssl, const char* hint, char* identity, unsigned identity_bytes,
                             unsigned char* key, unsigned key_bytes);
  static unsigned server_key(SSL* ssl, const char* identity, unsigned char* key,
                             unsigned key_bytes);

  boost::asio::ssl::context context_;
  Sha256 key_{};
};

/// Whether the first bytes of a connection begin a TLS handshake; frames never begin so.
inline constexpr std::size_t kFirstBytes = 5;
bool begins_tls(std::span<const std::byte> first);

/// What both sides tell where only one has a secret.
inline constexpr const char* kOnlyConnectingHasSecret =
    "only the side that connects has a secret (tcp.secret)";
inline constexpr const char* kOnlyListeningHasSecret =
    "only the side that listens has a secret (tcp.secret)";

/// Why a handshake failed, for the one who connected and for the one who listens.
Error client_refusal(const boost::system::error_code& error);
Error server_refusal(const boost::system::error_code& error);

}  // namespace mr::net
