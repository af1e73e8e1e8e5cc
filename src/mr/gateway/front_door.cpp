#include "mr/gateway/front_door.h"

#include "mr/net/address.h"
#include "mr/net/local_addresses.h"

namespace mr::gateway {
namespace {

constexpr const char* kLoopback[] = {"localhost", "127.0.0.1", "::1"};

bool is_any(const std::string& host) { return host == "0.0.0.0" || host == "::"; }

/// This machine's addresses that a socket on `host` listens on.
std::vector<std::string> addresses_of(const std::string& host) {
  std::vector<std::string> out = net::local_addresses();
  if (host == "0.0.0.0")
    std::erase_if(out, [](const auto& a) { return a.find(':') != std::string::npos; });
  return out;
}

/// The host that is listened on where it is one name or address.
std::string listened_name(const GatewayConfig& config) {
  const auto listens = net::parse_address(config.listen);
  return listens && !is_any(listens->host) ? listens->host : "";
}

/// What the gateway answers for, as WebConfig::hosts wants it.
std::vector<std::string> hosts_of(const GatewayConfig& config) {
  const std::string name = listened_name(config);
  if (!config.hosts.empty() || name.empty() || net::is_loopback(config.listen)) return config.hosts;
  std::vector<std::string> hosts(std::begin(kLoopback), std::end(kLoopback));
  hosts.push_back(name);
  return hosts;
}

/// All names that somebody may open the gateway by.
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

Result<FrontDoor> FrontDoor::open(const GatewayConfig& config,
                                  const std::filesystem::path& state_folder) {
  const bool is_beyond = !net::is_loopback(config.listen);
  if (is_beyond && !config.open && (!config.tls || config.tokens.empty()))
    return Error{Error::Cause::invalid,
                 "gateway: listening on " + config.listen +
                     " lets other machines in: give it 'tls' and 'tokens', or 'open: true' on a "
                     "network that you trust (docs/security.md)"};
  FrontDoor door;
  door.hosts = hosts_of(config);
  auto certificate = certificate_of(config, state_folder);
  if (!certificate) return certificate.error();
  door.certificate = *std::move(certificate);
  if (door.certificate) {
    if (const auto print = net::fingerprint(*door.certificate))
      door.notices.push_back("TLS certificate, SHA-256 fingerprint " + *print);
    if (const auto why = net::expiry_warning(*door.certificate); !why.empty())
      door.notices.push_back(why);
  }
  if (config.tokens.empty()) return door;
  const auto text = read_secret(config.tokens);
  if (!text) return Error{text.error().cause, "gateway.tokens: " + text.error().message};
  auto tokens = Tokens::parse(*text);
  if (!tokens)
    return Error{Error::Cause::invalid,
                 "gateway.tokens: " + to_string(config.tokens) + ": " + tokens.error().message};
  door.tokens = *std::move(tokens);
  return door;
}

net::WebConfig web_config(const GatewayConfig& config, const FrontDoor& door,
                          const std::filesystem::path& page) {
  constexpr int kConnectionsPerViewer = 4;         // a page's files, and the stream
  constexpr std::size_t kMaxMessage = 128u << 10;  // bytes; the longest request is a little shorter
  net::WebConfig web;
  web.listen = config.listen;
  web.root = page;
  web.hosts = door.hosts;
  web.certificate = door.certificate;
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
