#include "mr/net/nats_failure.h"

#include <nats/nats.h>
#include <netdb.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <memory>

#include "mr/net/address.h"
#include "mr/net/printable.h"

namespace mr::net {
namespace {

constexpr int kProbeMs = 1000;

std::vector<std::string> split_urls(const std::string& urls) {
  std::vector<std::string> all;
  for (std::size_t from = 0; from <= urls.size();) {
    const std::size_t comma = std::min(urls.find(',', from), urls.size());
    all.push_back(urls.substr(from, comma - from));
    from = comma + 1;
  }
  return all;
}

std::string without_secrets(const std::string& url) {
  const std::size_t scheme = url.find("://");
  const std::size_t at = url.rfind('@');
  if (at == std::string::npos) return url;
  return (scheme == std::string::npos ? "" : url.substr(0, scheme + 3)) + url.substr(at + 1);
}

Result<Address> address_of(const std::string& url) {
  const std::string shown = without_secrets(url);
  for (const std::string scheme : {"nats://", "tls://"}) {
    if (!shown.starts_with(scheme)) continue;
    const std::string host = shown.substr(scheme.size());
    if (auto address = parse_address(host)) return address;
    if (auto address = parse_address(host + ":4222")) return address;
  }
  return Error{Error::Cause::invalid,
               "\"" + shown + "\" is no NATS server: write nats://host:port"};
}

/// Tries one TCP connection. Returns the reason of a failure; empty: it succeeded.
std::string why_not_reached(const ::addrinfo& to) {
  const int handle = ::socket(to.ai_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  if (handle < 0) return std::strerror(errno);
  int failed = ::connect(handle, to.ai_addr, to.ai_addrlen) == 0 ? 0 : errno;
  if (failed == EINPROGRESS) {
    ::pollfd wait{handle, POLLOUT, 0};
    socklen_t size = sizeof failed;
    if (::poll(&wait, 1, kProbeMs) <= 0)
      failed = ETIMEDOUT;
    else
      ::getsockopt(handle, SOL_SOCKET, SO_ERROR, &failed, &size);
  }
  ::close(handle);
  return failed == 0 ? "" : std::strerror(failed);
}

/// Probes what libnats does not report: whether the host name resolves and its port is open. Empty:
/// the server can be reached.
std::string why_unreachable(const std::string& urls) {
  const auto address = address_of(split_urls(urls).front());
  if (!address) return address.error().message;
  ::addrinfo hints{};
  hints.ai_socktype = SOCK_STREAM;
  ::addrinfo* found = nullptr;
  if (::getaddrinfo(address->host.c_str(), address->port.c_str(), &hints, &found) != 0)
    return "no such host";
  const std::unique_ptr<::addrinfo, decltype(&::freeaddrinfo)> all(found, &::freeaddrinfo);
  std::string why;
  for (const ::addrinfo* at = found; at != nullptr; at = at->ai_next)
    if (why = why_not_reached(*at); why.empty()) return why;
  return why;
}

/// The failure of a server that accepts a connection and closes it. With TLS 1.3 the server checks
/// our certificate only after our side of the handshake is complete.
NatsFailure hang_up(const NatsConfig& config) {
  if (config.url.find("tls://") == std::string::npos)
    return {NatsFailure::Kind::unreachable, "cannot be reached: it ends the connection"};
  return {NatsFailure::Kind::tls,
          config.certificate.empty()
              ? "it hangs up after the TLS handshake, as it does where it wants a certificate of "
                "this node: nats.cert and nats.key"
              : "it hangs up after the TLS handshake, as it does where it does not trust the "
                "certificate of nats.cert"};
}

/// Rewrites "SSL handshake error: 20:unable to get local issuer certificate:depth=0:cert=…" as
/// advice.
std::string tls_text(const std::string& text) {
  const auto has = [&](const char* part) { return text.find(part) != std::string::npos; };
  if (has("hostname mismatch") || has("IP address mismatch"))
    return "its certificate is for another name than the one in nats.url";
  if (has("certificate has expired")) return "its certificate has expired";
  if (has("not yet valid")) return "its certificate is not valid yet; is the clock right?";
  if (has("issuer certificate") || has("self-signed") || has("self signed") || has("first certif"))
    return "its certificate is not trusted; nats.ca must name the authority that signed it";
  return "TLS: " + nats_text(text);
}

std::string refused_text(const NatsConfig& config) {
  if (!config.nkey.empty()) return "it refuses the key of nats.nkey";
  if (!config.credentials.empty()) return "it refuses the file of nats.credentials";
  if (config.url.find('@') != std::string::npos)
    return "it refuses the user, password or token of nats.url";
  return "it asks who we are; nats.url names no user, and there is no nats.nkey or "
         "nats.credentials";
}

}  // namespace

std::string nats_text(std::string text) {
  if (const std::size_t end = text.find("): "); text.starts_with("(") && end != std::string::npos)
    text.erase(0, end + 3);  // "(conn.c:733): ": the location in libnats
  return printable(text);
}

Result<std::vector<std::string>> nats_servers(const std::string& urls) {
  std::vector<std::string> all = split_urls(urls);
  // A malformed URL may contain a part of a password: not shown.
  for (const std::string& url : all)
    if (urls.find('@') != std::string::npos && url.find("://") == std::string::npos)
      return Error{Error::Cause::invalid,
                   "what follows a comma is no NATS server; within a password write it as %2C"};
  for (const std::string& url : all)
    if (auto address = address_of(url); !address) return address.error();
  return all;
}

std::string loggable(const std::string& urls) {
  std::string text;
  for (const std::string& url : split_urls(urls))
    text += (text.empty() ? "" : ",") + without_secrets(url);
  return text;
}

NatsFailure nats_failure(int status, const std::string& text, const NatsConfig& config) {
  using Kind = NatsFailure::Kind;
  switch (status) {
    case NATS_NO_SERVER:
    case NATS_IO_ERROR:
      if (const std::string why = why_unreachable(config.url); !why.empty())
        return {Kind::unreachable, "cannot be reached: " + why};
      return hang_up(config);
    case NATS_TIMEOUT:
      return {Kind::unreachable, "cannot be reached: no answer"};
    case NATS_OK:
    case NATS_CONNECTION_CLOSED:
    case NATS_CONNECTION_DISCONNECTED:
    case NATS_STALE_CONNECTION:
      return {Kind::unreachable, "cannot be reached: the connection broke"};
    case NATS_CONNECTION_AUTH_FAILED:
      return {Kind::refused, refused_text(config)};
    case NATS_SSL_ERROR:
      return {Kind::tls, tls_text(text)};
    case NATS_SECURE_CONNECTION_WANTED:
      return {Kind::tls, "it speaks no TLS; set it up there, or write nats:// for a plain one"};
    case NATS_SECURE_CONNECTION_REQUIRED:
      return {Kind::tls, "it wants TLS; write tls:// in nats.url"};
    case NATS_PROTOCOL_ERROR:
      if (text.find("PONG") != std::string::npos) return hang_up(config);
      [[fallthrough]];
    default:
      return {
          Kind::other,
          "no connection: " +
              nats_text(text.empty() ? natsStatus_GetText(static_cast<natsStatus>(status)) : text)};
  }
}

NatsDenial nats_denial(const std::string& text) {
  NatsDenial denial;
  denial.publishing = text.find("Publish") != std::string::npos;
  const std::size_t open = text.find('"'), close = text.find('"', open + 1);
  if (open == std::string::npos || close == std::string::npos) return denial;
  denial.subject = nats_text(text.substr(open + 1, close - open - 1));
  if (denial.publishing && denial.subject.starts_with("_INBOX."))
    denial.subject.resize(denial.subject.rfind('.') + 1), denial.subject += '*';
  return denial;
}

}  // namespace mr::net
