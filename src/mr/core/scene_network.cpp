#include <algorithm>
#include <charconv>

#include "mr/core/scene_parts.h"

namespace mr::scene_file {
namespace {

/// "host:port", "[v6]:port".
bool is_address(const std::string& text) {
  const std::size_t colon = text.rfind(':');
  if (colon == std::string::npos || colon == 0) return false;
  int port = -1;
  const char *begin = text.data() + colon + 1, *end = text.data() + text.size();
  const auto [stop, failed] = std::from_chars(begin, end, port);
  return failed == std::errc() && stop == end && port >= 0 && port <= 65535;
}

/// A text that is an address; a wrong one is reported.
bool read_address(MapReader& map, const std::string& key, std::string& out) {
  std::string text;
  if (!map.text(key, text)) return false;
  if (!is_address(text)) {
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
  const YamlNode* node = gateway.find("start");
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

void read_tcp(MapReader& top, Scene& scene) {
  const YamlNode* node = top.find("tcp");
  if (!node) return;
  MapReader map(top.report, *node, "tcp");
  std::vector<std::string> ids = scene.rig ? scene.rig->sensor_ids() : std::vector<std::string>{};
  for (const SensorConfig& sensor : scene.sensors) ids.push_back(sensor.id);
  for (const MergerConfig& merger : scene.mergers) ids.push_back(merger.id);
  for (const YamlKey& key : node->keys) {
    if (std::find(ids.begin(), ids.end(), key.name) != ids.end()) continue;
    map.find(key.name);
    map.report.problem(key.line, "tcp: " + in_quotes(key.name) + " is no sensor and no merger" +
                                     did_you_mean(key.name, ids));
  }
  for (const std::string& id : ids) {
    std::string address;
    if (map.has(id) && read_address(map, id, address)) scene.network.tcp[id] = address;
  }
}

}  // namespace

void read_background(MapReader& top, std::optional<BackgroundConfig>& background) {
  const YamlNode* node = top.find("background");
  if (!node) return;
  MapReader map(top.report, *node, "background");
  BackgroundConfig config;
  std::string model;
  if (map.need("model") && map.text("model", model)) {
    config.model = map.report.resolve(model);
    std::error_code failed;
    if (config.model.extension() != ".glb")
      map.report.problem(map.line("model"), "model must be a binary glTF file (.glb)");
    else if (!map.report.spend_files(1) || !std::filesystem::is_regular_file(config.model, failed))
      map.report.problem(map.line("model"), "model: no file " + in_quotes(config.model.string()));
  }
  if (const YamlNode* pose = map.find("T_world_model"))
    if (const auto T = read_pose(map.report, *pose, "T_world_model")) config.T_world_model = *T;
  background = config;
}

void read_network(MapReader& top, Scene& scene) {
  if (const YamlNode* node = top.find("gateway")) {
    MapReader map(top.report, *node, "gateway");
    scene.gateway.emplace();
    read_address(map, "listen", scene.gateway->listen);
    read_start(map, scene.gateway->start);
  }
  if (const YamlNode* node = top.find("nats")) {
    MapReader map(top.report, *node, "nats");
    if (map.need("url")) map.text("url", scene.network.nats_url);
  }
  read_tcp(top, scene);
}

}  // namespace mr::scene_file
