#include "mr/gateway/access_policy.h"

#include "mr/net/address.h"
#include "mr/net/local_addresses.h"

namespace mr::gateway {
namespace {

constexpr const char* kLoopback[] = {"localhost", "127.0.0.1", "::1"};

bool is_any(const std::string& host) { return host == "0.0.0.0" || host == "::"; }

/// Those addresses of this machine that a socket on the wildcard address `host` listens on.
std::vector<std::string> addresses_of(const std::string& host) {
  std::vector<std::string> out = net::local_addresses();
  if (host == "0.0.0.0")
    std::erase_if(out, [](const auto& a) { return a.find(':') != std::string::npos; });
  return out;
}

/// The host that the gateway listens on; empty: all addresses.
std::string listened_name(const GatewayConfig& config) {
  const auto listens = net::parse_address(config.listen);
  return listens && !is_any(listens->host) ? listens->host : "";
}

/// The host names that the gateway answers for, in the form of WebConfig::hosts.
std::vector<std::string> hosts_of(const GatewayConfig& config) {
  const std::string name = listened_name(config);
  if (!config.hosts.empty() || name.empty() || net::is_loopback(config.listen)) return config.hosts;
  std::vector<std::string> hosts(std::begin(kLoopback), std::end(kLoopback));
  hosts.push_back(name);
  return hosts;
}

/// All host names and addresses by which a viewer may open the gateway.
std::vector<std::string> names_of(const GatewayConfig& config) {
  std::vector<std::string> names = hosts_of(config);
  if (!names.empty()) return names;
  names.assign(std::begin(kLoopback), std::end(kLoopback));
  if (const auto listens = net::parse_address(config.listen); listens && is_any(listens->host))
    for (const std::string& own : addresses_of(listens->host)) names.push_back(own);
  return names;
}

Result<std::optional<net::Certificate>> certificate_of(const GatewayConfig& config,
                                                       const std::filesystem::path& state_folder) {
  if (!config.tls) return std::optional<net::Certificate>();
  auto made = config.tls->cert.empty()
                  ? net::load_or_make_certificate(state_folder, names_of(config), config.hosts)
                  : net::load_certificate(config.tls->cert, config.tls->key);
  if (!made) return Error{made.error().cause, "gateway.tls: " + made.error().message};
  return std::optional(*std::move(made));
}

}  // namespace

Result<AccessPolicy> AccessPolicy::open(const GatewayConfig& config,
                                        const std::filesystem::path& state_folder) {
  const bool is_beyond = !net::is_loopback(config.listen);
  if (is_beyond && !config.open && (!config.tls || config.tokens.empty()))
    return Error{Error::Cause::invalid,
                 "gateway: listening on " + config.listen +
                     " lets other machines in: give it 'tls' and 'tokens', or 'open: true' on a "
                     "network that you trust (docs/security.md)"};
  AccessPolicy policy;
  policy.hosts = hosts_of(config);
  auto certificate = certificate_of(config, state_folder);
  if (!certificate) return certificate.error();
  policy.certificate = *std::move(certificate);
  if (policy.certificate) {
    if (const auto print = net::fingerprint(*policy.certificate))
      policy.notices.push_back("TLS certificate, SHA-256 fingerprint " + *print);
    if (const auto why = net::expiry_warning(*policy.certificate); !why.empty())
      policy.notices.push_back(why);
  }
  if (config.tokens.empty()) return policy;
  const auto text = read_secret(config.tokens);
  if (!text) return Error{text.error().cause, "gateway.tokens: " + text.error().message};
  auto tokens = Tokens::parse(*text);
  if (!tokens)
    return Error{Error::Cause::invalid,
                 "gateway.tokens: " + to_string(config.tokens) + ": " + tokens.error().message};
  policy.tokens = *std::move(tokens);
  return policy;
}

net::WebConfig web_config(const GatewayConfig& config, const AccessPolicy& policy,
                          const std::filesystem::path& page) {
  constexpr int kConnectionsPerViewer = 4;         // a page's files, and the stream
  constexpr std::size_t kMaxMessage = 128u << 10;  // bytes; the longest request is a little shorter
  net::WebConfig web;
  web.listen = config.listen;
  web.root = page;
  web.hosts = policy.hosts;
  web.certificate = policy.certificate;
  web.clients = config.viewers;
  web.clients_per_address = config.viewers_per_address;
  web.connections = kConnectionsPerViewer * config.viewers;
  web.connections_per_address = kConnectionsPerViewer * config.viewers_per_address;
  web.message_bytes = kMaxMessage;
  return web;
}

std::vector<std::string> urls_of(const GatewayConfig& config, int port) {
  std::vector<std::string> hosts = config.hosts;
  if (const std::string name = listened_name(config); hosts.empty() && !name.empty())
    hosts = {name};
  if (const auto listens = net::parse_address(config.listen); hosts.empty() && listens)
    hosts = addresses_of(listens->host);
  if (hosts.empty()) hosts = {kLoopback[1]};
  std::vector<std::string> out;
  for (const std::string& host : hosts)
    out.push_back((config.tls ? "https://" : "http://") +
                  net::to_string({host, std::to_string(port)}));
  return out;
}

}  // namespace mr::gateway
