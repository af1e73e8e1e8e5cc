#include "mr/node/live_scene.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "mr/core/trace.h"
#include "mr/node/coalesce_packets.h"
#include "mr/node/front_door.h"
#include "mr/node/gateway.h"
#include "mr/node/monitor.h"
#include "mr/node/report.h"
#include "mr/node/sources.h"

namespace mr::node {
namespace {

constexpr const char* kGateway = "gateway";

std::string joined(const std::vector<std::string>& words) {
  std::string out;
  for (const std::string& word : words) out += (out.empty() ? "" : ", ") + word;
  return out;
}

std::vector<std::uint32_t> sensors_among(const Scene& scene,
                                         const std::vector<std::string>& names) {
  std::vector<std::uint32_t> out;
  for (std::uint32_t i = 0; i < scene.sensors.size(); ++i)
    if (std::find(names.begin(), names.end(), scene.sensors[i].id) != names.end()) out.push_back(i);
  return out;
}

/// Sensors of one process work at the same time: more threads than cores would only take turns.
int threads_each(int threads, std::size_t sensors) {
  const int all = threads > 0 ? threads : static_cast<int>(std::thread::hardware_concurrency());
  return std::max(1, all / static_cast<int>(std::max<std::size_t>(sensors, 1)));
}

}  // namespace

std::vector<std::string> node_names(const Scene& scene) {
  std::vector<std::string> names;
  for (const SensorConfig& sensor : scene.sensors) names.push_back(sensor.id);
  for (const MergerConfig& merger : scene.mergers) names.push_back(merger.id);
  names.push_back(kGateway);
  return names;
}

LiveScene::LiveScene(Scene scene) : scene_(std::make_unique<const Scene>(std::move(scene))) {}

/// Whoever asks for figures meanwhile is told of no node: none of them is asked while it ends.
LiveScene::~LiveScene() {
  std::vector<std::unique_ptr<LiveNode>> nodes;
  const std::lock_guard lock(mutex_);
  nodes.swap(nodes_);
}

Result<std::unique_ptr<LiveScene>> LiveScene::start(Scene given, const LiveOptions& options) {
  auto opened = prepare_scene(std::move(given));
  if (!opened) return opened.error();
  Scene scene = *std::move(opened);
  const std::vector<std::string> known = node_names(scene);
  for (const std::string& name : options.nodes)
    if (std::find(known.begin(), known.end(), name) == known.end())
      return Error{Error::Cause::not_found, "scene '" + scene.id + "' has no node '" + name +
                                                "'; its nodes are " + joined(known)};

  std::unique_ptr<LiveScene> live(new LiveScene(std::move(scene)));
  if (const Status open = live->open_transport(options); !open) return open.error();
  const LiveContext context = live->context(options);
  if (!options.metrics.empty()) {
    auto monitor = serve_monitor(options.metrics, context.stats);
    if (!monitor) return monitor.error();
    live->monitor_ = *std::move(monitor);
  }
  // Consumers first, so that they see their producers' first packets.
  const auto& names = options.nodes.empty() ? known : options.nodes;
  const auto sensors = sensors_among(*live->scene_, names);
  for (auto name = names.rbegin(); name != names.rend(); ++name)
    if (const Status started = live->start_node(*name, context, options); !started)
      return started.error();
  auto sources = open_sources(*live->scene_, sensors, options.cache_folder, options.rendering);
  LiveContext shared = context;
  shared.threads = threads_each(context.threads, sensors.size());
  for (std::size_t i = 0; i < sensors.size(); ++i)
    live->add(std::make_unique<LiveSensor>(shared, sensors[i], std::move(sources[i])));
  live->started_ = std::chrono::steady_clock::now();
  return live;
}

LiveContext LiveScene::context(const LiveOptions& options) const {
  LiveContext context;
  context.scene = scene_.get();
  context.transport = transport_.get();
  context.threads = options.threads > 0 ? options.threads : scene_->threads;
  context.frames_ahead = options.nodes.empty() ? 1 : 2;
  context.log = options.log;
  context.stats = [this] {
    auto all = stats();
    if (!all.empty()) all.front().drops.merge(transport_drops());
    return all;
  };
  context.state_folder = options.state_folder;
  return context;
}

Status LiveScene::open_transport(const LiveOptions& options) {
  net::TransportLimits limits;
  limits.log = [log = options.log](const std::string& line) {
    log({LogLevel::warning, "network", line});
  };
  if (options.nodes.empty()) {
    transport_ = net::make_in_process_transport();
    return {};
  }
  const NetworkConfig& network = scene_->network;
  if (network.nats.url.empty() && network.tcp.empty())
    return Error{Error::Cause::invalid,
                 "nodes in processes of their own need 'nats: {url: …}' or 'tcp: {NODE: host:port, "
                 "…}' in the scene file"};
  const bool use_nats = !network.nats.url.empty();
  std::string secret;
  if (!use_nats && !network.tcp_secret.empty()) {
    auto read = read_secret(network.tcp_secret);
    if (!read) return Error{read.error().cause, "tcp.secret: " + read.error().message};
    secret = *std::move(read);
  }
  auto made = use_nats
                  ? net::make_nats_transport(network.nats, scene_->id, limits, coalesce_packets)
                  : net::make_tcp_transport(network.tcp, coalesce_packets, limits, secret);
  if (!made) return made.error();
  transport_ = *std::move(made);
  return {};
}

Status LiveScene::start_node(const std::string& name, const LiveContext& context,
                             const LiveOptions& options) {
  for (const MergerConfig& merger : scene_->mergers) {
    if (merger.id != name) continue;
    std::vector<EncodedChunk> background;
    if (&merger == &scene_->mergers.back()) {
      auto opened = open_background(
          *scene_, [&](const std::string& notice) { context.tell(merger.id, notice); });
      if (!opened) return opened.error();
      background = *std::move(opened);
    }
    add(std::make_unique<LiveMerger>(context, merger, std::move(background)));
  }
  if (name != kGateway) return {};
  const GatewayConfig config = scene_->gateway.value_or(GatewayConfig{});
  auto gateway = Gateway::start(context, config, options.page);
  if (!gateway) return gateway.error();
  urls_ = urls_of(config, (*gateway)->port());
  add(*std::move(gateway));
  return {};
}

void LiveScene::add(std::unique_ptr<LiveNode> node) {
  const std::lock_guard lock(mutex_);
  nodes_.push_back(std::move(node));
}

std::vector<LiveStats> LiveScene::stats() const {
  std::vector<LiveStats> out;
  const std::lock_guard lock(mutex_);
  for (const auto& node : nodes_) out.push_back(node->stats());
  return out;
}

double LiveScene::seconds() const {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - started_).count();
}

std::string to_json(const LiveScene& live) {
  using Json = nlohmann::ordered_json;
  const double seconds = live.seconds();
  const auto rounded = [](double v) { return std::round(v * 1000) / 1000; };
  Json nodes = Json::object();
  for (const LiveStats& node : live.stats()) {
    Json stages = Json::object();
    for (const auto& [stage, ms] : node.stages_ms)
      stages[stage] = {{"p50_ms", rounded(percentile(ms, 0.5))},
                       {"p95_ms", rounded(percentile(ms, 0.95))}};
    nodes[node.id] = {{"frames", node.frames},
                      {"fps", rounded(static_cast<double>(node.frames) / seconds)},
                      {"drops", node.drops},
                      {"stages", stages}};
  }
  return Json{{"scene", live.scene().id},
              {"preset", Json::parse(preset_of(live.scene()))},
              {"seconds", rounded(seconds)},
              {"peak_rss_mb", rounded(peak_rss_mb())},
              {"nodes", nodes},
              {"transport_drops", live.transport_drops()}}
             .dump(2) +
         "\n";
}

}  // namespace mr::node
