#include "mr/net/tcp_secret.h"

#include <openssl/err.h>
#include <openssl/ssl.h>

#include <algorithm>
#include <boost/asio/ssl/error.hpp>
#include <cstring>
#include <stdexcept>

namespace mr::net {
namespace ssl = boost::asio::ssl;

namespace {

constexpr const char* kIdentity = "meshreduce";
constexpr const char* kOtherSecret =
    "the two sides have different secrets; tcp.secret must be the same for all nodes";
constexpr const char* kKeyLabel = "meshreduce tcp";

/// Where an SSL_CTX keeps its TcpSecret; asio uses its app_data itself.
int secret_index() {
  static const int index = ::SSL_CTX_get_ex_new_index(0, nullptr, nullptr, nullptr, nullptr);
  return index;
}

/// OpenSSL's reason code of an error; 0: not an error of OpenSSL.
int ssl_reason(const boost::system::error_code& error) {
  if (error.category() != boost::asio::error::get_ssl_category()) return 0;
  return ERR_GET_REASON(static_cast<unsigned long>(error.value()));
}

}  // namespace

TcpSecret::TcpSecret(const std::string& secret) : context_(ssl::context::tls) {
  key_ = sha256(kKeyLabel + secret);
  SSL_CTX* const handle = context_.native_handle();
  const bool ok = ::SSL_CTX_set_min_proto_version(handle, TLS1_3_VERSION) == 1 &&
                  ::SSL_CTX_set_ciphersuites(handle, "TLS_AES_128_GCM_SHA256") == 1 &&
                  ::SSL_CTX_set_num_tickets(handle, 0) == 1 &&
                  ::SSL_CTX_set_ex_data(handle, secret_index(), this) == 1;
  if (!ok) throw std::runtime_error("OpenSSL offers no TLS 1.3 with a pre-shared key");
  ::SSL_CTX_set_session_cache_mode(handle, SSL_SESS_CACHE_OFF);
  ::SSL_CTX_set_psk_client_callback(handle, client_key);
  ::SSL_CTX_set_psk_server_callback(handle, server_key);
}

Result<std::shared_ptr<TcpSecret>> TcpSecret::make(const std::string& secret) {
  if (secret.size() < kShortest)
    return Error{
        Error::Cause::invalid,
        "tcp.secret must have 16 characters or more, so that nobody can guess it; `openssl "
        "rand -base64 24` makes one"};
  try {
    return std::shared_ptr<TcpSecret>(new TcpSecret(secret));
  } catch (const std::exception& e) {
    return Error{Error::Cause::io, e.what()};
  }
}

const TcpSecret& TcpSecret::of(SSL* ssl) {
  return *static_cast<const TcpSecret*>(
      ::SSL_CTX_get_ex_data(::SSL_get_SSL_CTX(ssl), secret_index()));
}

unsigned TcpSecret::client_key(SSL* ssl, const char* /*hint*/, char* identity,
                               unsigned identity_bytes, unsigned char* key, unsigned key_bytes) {
  const Sha256& ours = of(ssl).key_;
  if (identity_bytes <= std::strlen(kIdentity) || key_bytes < ours.size()) return 0;
  std::strcpy(identity, kIdentity);
  std::copy(ours.begin(), ours.end(), key);
  return static_cast<unsigned>(ours.size());
}

unsigned TcpSecret::server_key(SSL* ssl, const char* identity, unsigned char* key,
                               unsigned key_bytes) {
  const Sha256& ours = of(ssl).key_;
  if (std::strcmp(identity, kIdentity) != 0 || key_bytes < ours.size()) return 0;
  std::copy(ours.begin(), ours.end(), key);
  return static_cast<unsigned>(ours.size());
}

bool begins_tls(std::span<const std::byte> first) {
  // A TLS handshake record. As a frame header these bytes would mean a payload of at least 790
  // bytes; a greeting is shorter.
  return first.size() >= 2 && first[0] == std::byte{0x16} && first[1] == std::byte{0x03};
}

Error client_refusal(const boost::system::error_code& error) {
  switch (ssl_reason(error)) {
    case 0:
      return {Error::Cause::io, "the connection broke before secrets were compared"};
    case SSL_R_WRONG_VERSION_NUMBER:
    case SSL_R_UNEXPECTED_MESSAGE:
    case SSL_R_PACKET_LENGTH_TOO_LONG:
    case SSL_R_BAD_RECORD_TYPE:
      return {Error::Cause::invalid, kOnlyConnectingHasSecret};
    case SSL_R_CERTIFICATE_VERIFY_FAILED:
      return {Error::Cause::invalid,
              "it shows a certificate and does not know the secret (tcp.secret)"};
    default:
      return {Error::Cause::invalid, kOtherSecret};
  }
}

Error server_refusal(const boost::system::error_code& error) {
  switch (ssl_reason(error)) {
    case 0:
      return {Error::Cause::io, "the connection broke before secrets were compared"};
    case SSL_R_BINDER_DOES_NOT_VERIFY:
      return {Error::Cause::invalid, kOtherSecret};
    default:
      return {Error::Cause::invalid, "a TLS handshake without tcp.secret"};
  }
}

}  // namespace mr::net
