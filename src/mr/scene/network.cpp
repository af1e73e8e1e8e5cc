#include <algorithm>
#include <cctype>

#include "mr/net/address.h"
#include "mr/scene/parts.h"

namespace mr::scene_file {
namespace {

constexpr const char* kSecretKey = "secret";

/// A text that is an address; a wrong one is reported.
bool read_address(MapReader& map, const std::string& key, std::string& out) {
  std::string text;
  if (!map.text(key, text)) return false;
  if (!net::is_address(text)) {
    map.report.problem(map.line(key), key + ": " + in_quotes(text) +
                                          " is no address; write host:port, as in 127.0.0.1:8080");
    return false;
  }
  out = text;
  return true;
}

std::optional<Vec3d> read_place(MapReader& map, const std::string& key) {
  double v[3];
  if (!map.need(key) || !map.numbers(key, {-1e5, 1e5}, v)) return std::nullopt;
  return Vec3d{v[0], v[1], v[2]};
}

void read_start(MapReader& gateway, std::optional<StartConfig>& start) {
  const yaml::Node* node = gateway.find("start");
  if (!node) return;
  MapReader map(gateway.report, *node, "gateway.start");
  const auto eye = read_place(map, "eye");
  const auto look_at = read_place(map, "look_at");
  if (!eye || !look_at) return;
  if (length(*look_at - *eye) < 0.001)
    return map.report.problem(map.line("look_at"),
                              "gateway.start: look_at must be another place than eye");
  start = StartConfig{*eye, *look_at};
}

/// Reads the name of a file of this node; its existence is checked when the node starts.
void read_own_file(MapReader& map, const std::string& key, std::filesystem::path& out) {
  std::string text;
  if (!map.text(key, text)) return;
  if (text.empty()) return map.report.problem(map.line(key), key + " must name a file, not ''");
  out = map.report.resolve(text);
}

void read_nkey(MapReader& nats, NatsConfig& config) {
  const yaml::Node* node = nats.find("nkey");
  if (!node) return;
  MapReader map(nats.report, *node, "nkey");
  if (map.need("public") && map.text("public", config.nkey) &&
      !NatsConfig::is_user_nkey(config.nkey))
    map.report.problem(map.line("public"),
                       "public must be the public NKey of a user, U and 55 more letters or digits");
  if (map.need("seed")) read_own_file(map, "seed", config.nkey_seed);
}

void read_nats(MapReader& top, NatsConfig& config) {
  const yaml::Node* node = top.find("nats");
  if (!node) return;
  MapReader map(top.report, *node, "nats");
  const bool has_url = map.need("url") && map.text("url", config.url);
  read_own_file(map, "ca", config.ca);
  read_own_file(map, "cert", config.certificate);
  read_own_file(map, "key", config.key);
  read_own_file(map, "credentials", config.credentials);
  read_nkey(map, config);
  if (map.has("cert") != map.has("key"))
    map.report.problem(map.line(map.has("cert") ? "cert" : "key"),
                       "nats: cert and key only together; both are PEM files");
  if (map.has("nkey") && map.has("credentials"))
    map.report.problem(map.line("credentials"), "nats: either nkey or credentials, not both");
  if (!has_url || config.url.find("tls://") != std::string::npos) return;
  for (const char* key : {"ca", "cert", "key"})
    if (map.has(key))
      return map.report.problem(
          map.line(key),
          std::string("nats: ") + key + " needs tls:// in the url; nats:// is not encrypted");
}

/// The secret that TCP connections need; the key is no node's.
void read_tcp_secret(MapReader& tcp, const std::vector<std::string>& ids, SecretSource& secret) {
  tcp.find(kSecretKey);
  if (std::find(ids.begin(), ids.end(), kSecretKey) != ids.end())
    return tcp.report.problem(tcp.line(kSecretKey),
                              "tcp: no node of the scene may be named 'secret', which is the key "
                              "of the nodes' shared secret; give it another id");
  yaml::read_secret_source(tcp, kSecretKey, secret);
}

/// `tls: auto` or `tls: {cert: FILE, key: FILE}`.
void read_tls(MapReader& gateway, std::optional<TlsConfig>& tls) {
  const yaml::Node* node = gateway.find("tls");
  if (!node) return;
  if (node->kind == yaml::Node::Kind::scalar) {
    TlsConfig own;
    if (gateway.choice("tls", own, {{"auto", TlsConfig{}}})) tls = own;
    return;
  }
  MapReader map(gateway.report, *node, "gateway.tls");
  std::string cert, key;
  const bool has_both = (map.need("cert") != nullptr) & (map.need("key") != nullptr);
  if (has_both && map.text("cert", cert) & map.text("key", key))
    tls = TlsConfig{map.report.resolve(cert), map.report.resolve(key)};
}

/// A name or number as it stands in a browser's address line, without port and brackets.
bool is_host(const std::string& text) {
  constexpr const char* kName = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789._-";
  constexpr const char* kV6 = "abcdefABCDEF0123456789.:";
  const bool is_v6 = std::count(text.begin(), text.end(), ':') > 1;
  return !text.empty() && text.size() <= 253 &&
         text.find_first_not_of(is_v6 ? kV6 : kName) == std::string::npos;
}

void read_hosts(MapReader& gateway, std::vector<std::string>& hosts) {
  const yaml::Node* node = gateway.find("hosts");
  if (!node) return;
  const auto refuse = [&](int line, const std::string& why) {
    gateway.report.problem(line, "gateway.hosts " + why);
  };
  if (node->kind != yaml::Node::Kind::list || node->items.empty())
    return refuse(node->line, "must be a list of names, as in [room.example.org, 192.168.1.5]");
  for (const yaml::Node& item : node->items) {
    auto name = yaml::read_text(gateway.report, item, "gateway.hosts");
    if (!name) continue;
    if (!is_host(*name)) {
      refuse(item.line, "holds " + in_quotes(*name) + ", which is no name without port");
      continue;
    }
    for (char& c : *name) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    hosts.push_back(*std::move(name));
  }
}

void read_gateway(Report& report, const yaml::Node& node, GatewayConfig& gateway) {
  MapReader map(report, node, "gateway");
  read_address(map, "listen", gateway.listen);
  read_start(map, gateway.start);
  read_tls(map, gateway.tls);
  yaml::read_secret_source(map, "tokens", gateway.tokens);
  read_hosts(map, gateway.hosts);
  map.flag("open", gateway.open);
  map.integer("viewers", gateway.viewers, GatewayConfig::kViewers);
  map.integer("viewers_per_address", gateway.viewers_per_address, GatewayConfig::kViewers);
}

void read_tcp(MapReader& top, Scene& scene) {
  const yaml::Node* node = top.find("tcp");
  if (!node) return;
  MapReader map(top.report, *node, "tcp");
  std::vector<std::string> ids = scene.rig ? scene.rig->sensor_ids() : std::vector<std::string>{};
  for (const SensorConfig& sensor : scene.sensors) ids.push_back(sensor.id);
  for (const MergerConfig& merger : scene.mergers) ids.push_back(merger.id);
  read_tcp_secret(map, ids, scene.network.tcp_secret);
  for (const yaml::Key& key : node->keys) {
    if (key.name == kSecretKey) continue;
    if (std::find(ids.begin(), ids.end(), key.name) != ids.end()) continue;
    map.find(key.name);
    map.report.problem(key.line, "tcp: " + in_quotes(key.name) + " is no sensor and no merger" +
                                     did_you_mean(key.name, ids));
  }
  for (const std::string& id : ids) {
    std::string address;
    if (id != kSecretKey && map.has(id) && read_address(map, id, address))
      scene.network.tcp[id] = address;
  }
}

}  // namespace

void read_background(MapReader& top, std::optional<BackgroundConfig>& background) {
  const yaml::Node* node = top.find("background");
  if (!node) return;
  MapReader map(top.report, *node, "background");
  BackgroundConfig config;
  std::string model;
  if (map.need("model") && map.text("model", model)) {
    config.model = map.report.resolve(model);
    std::error_code failed;
    if (const auto problems = config.problems(); !problems.empty())
      map.report.problem(map.line("model"), problems.front());
    else if (!map.report.spend_files(1) || !std::filesystem::is_regular_file(config.model, failed))
      map.report.problem(map.line("model"), "model: no file " + in_quotes(config.model.string()));
  }
  if (const yaml::Node* pose = map.find("T_world_model"))
    if (const auto T = read_pose(map.report, *pose, "T_world_model")) config.T_world_model = *T;
  background = config;
}

void read_network(MapReader& top, Scene& scene) {
  if (const yaml::Node* node = top.find("gateway")) {
    read_gateway(top.report, *node, scene.gateway.emplace());
  }
  read_nats(top, scene.network.nats);
  read_tcp(top, scene);
}

}  // namespace mr::scene_file
