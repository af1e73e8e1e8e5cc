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

/// The secret that the nodes of a scene share, used as the pre-shared key of TLS 1.3 (RFC 8446,
/// psk_dhe_ke): mutual authentication without sending the secret, and forward secrecy by ephemeral
/// Diffie-Hellman keys. The connecting side must verify certificates and trust none: otherwise a
/// server without the secret could authenticate by a certificate instead. Immutable; must outlive
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

/// Whether the first bytes of a connection begin a TLS handshake. No frame begins with these.
inline constexpr std::size_t kFirstBytes = 5;
bool begins_tls(std::span<const std::byte> first);

/// The error of both sides when only one has a secret.
inline constexpr const char* kOnlyConnectingHasSecret =
    "only the side that connects has a secret (tcp.secret)";
inline constexpr const char* kOnlyListeningHasSecret =
    "only the side that listens has a secret (tcp.secret)";

/// The error of a failed handshake, as the connecting and as the listening side reports it.
Error client_refusal(const boost::system::error_code& error);
Error server_refusal(const boost::system::error_code& error);

}  // namespace mr::net
