#include "mr/runtime/live_scene.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "mr/core/trace.h"
#include "mr/gateway/access_policy.h"
#include "mr/node/coalesce_packets.h"
#include "mr/node/merge_task.h"
#include "mr/node/sensor_task.h"
#include "mr/node/sources.h"
#include "mr/rate/models.h"
#include "mr/runtime/live_frames.h"
#include "mr/runtime/monitor.h"
#include "mr/runtime/paced_frames.h"
#include "mr/runtime/report.h"

namespace mr::runtime {
namespace {

constexpr const char* kGateway = gateway::Gateway::kName;

std::string joined(const std::vector<std::string>& words) {
  std::string out;
  for (const std::string& word : words) out += (out.empty() ? "" : ", ") + word;
  return out;
}

std::vector<SensorId> sensors_among(const Scene& scene, const std::vector<std::string>& names) {
  std::vector<SensorId> out = all_sensors(scene.sensors);
  std::erase_if(out, [&](SensorId id) {
    return std::find(names.begin(), names.end(), scene.sensor(id).id) == names.end();
  });
  return out;
}

/// Threads per sensor: the sensors of one process run concurrently and share its cores.
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

LiveScene::LiveScene(Scene scene, LiveOptions options)
    : scene_(std::make_unique<const Scene>(std::move(scene))), options_(std::move(options)) {}

/// Nodes are removed from nodes_ before they end, so that concurrent calls of stats() do not query
/// them.
LiveScene::~LiveScene() {
  std::vector<std::unique_ptr<TaskThreads>> nodes;
  {
    const std::lock_guard lock(mutex_);
    nodes.swap(nodes_);
  }
}

Result<std::unique_ptr<LiveScene>> LiveScene::start(Scene given, const LiveOptions& options) {
  auto opened = node::prepare_scene(std::move(given));
  if (!opened) return opened.error();
  std::unique_ptr<LiveScene> live(new LiveScene(*std::move(opened), options));
  const Scene& scene = *live->scene_;
  const std::vector<std::string> known = node_names(scene);
  for (const std::string& name : options.nodes)
    if (std::ranges::find(known, name) == known.end())
      return Error{Error::Cause::not_found, "scene '" + scene.id + "' has no node '" + name +
                                                "'; its nodes are " + joined(known)};

  if (const Status open = live->open_transport(); !open) return open.error();
  if (const Status served = live->serve_figures(); !served) return served.error();
  // Consumers first, so that they receive their producers' first packets.
  const auto& names = live->is_whole() ? known : options.nodes;
  const auto is_wanted = [&](const std::string& name) {
    return std::ranges::find(names, name) != names.end();
  };
  if (is_wanted(kGateway))
    if (const Status started = live->start_gateway(); !started) return started.error();
  for (auto merger = scene.mergers.rbegin(); merger != scene.mergers.rend(); ++merger)
    if (is_wanted(merger->id))
      if (const Status started = live->start_merger(*merger); !started) return started.error();
  live->start_sensors(sensors_among(scene, names));
  live->started_ = std::chrono::steady_clock::now();
  return live;
}

node::NodeLog LiveScene::log_of(const std::string& node) const {
  const auto write = [log = options_.log, node](LogLevel level, const std::string& text) {
    log({level, node, text});
  };
  return {.write = write, .dropped = [write](const std::string& place, const Error& error) {
            write(LogLevel::warning, place + ": " + error.message);
          }};
}

Status LiveScene::open_transport() {
  net::TransportLimits limits;
  limits.log = [log = options_.log](const std::string& line) {
    log({LogLevel::warning, "network", line});
  };
  if (is_whole()) {
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
  // The root's rungs come from where it is.
  std::map<std::string, std::string> addresses = network.tcp;
  if (const auto root = addresses.find(scene_->mergers.back().id); root != addresses.end())
    for (const std::string& rung : node::rung_names(*scene_)) addresses[rung] = root->second;
  auto made =
      use_nats ? net::make_nats_transport(network.nats, scene_->id, limits, node::coalesce_packets)
               : net::make_tcp_transport(addresses, node::coalesce_packets, limits, secret);
  if (!made) return made.error();
  transport_ = *std::move(made);
  return {};
}

Status LiveScene::serve_figures() {
  if (options_.metrics.empty()) return {};
  auto monitor = serve_monitor(options_.metrics, [this] { return figures(); });
  if (!monitor) return monitor.error();
  monitor_ = *std::move(monitor);
  return {};
}

/// If all nodes run in this process, each processes one packet at a time.
TaskThreads::Config LiveScene::threads_config() const {
  TaskThreads::Config config;
  config.threads = options_.threads > 0 ? options_.threads : scene_->threads;
  config.shares_machine = is_whole();
  config.packets_ahead = is_whole() ? 1 : 2;
  return config;
}

Status LiveScene::start_merger(const MergerConfig& merger) {
  // In a scene of several processes, some may never have been started.
  constexpr Duration kStart = std::chrono::seconds(5);
  node::MergeTask::Options options;
  options.clock = node::NodeClock::live();
  options.still_work = node::StillWork::beside;
  options.measures_links = !is_whole();
  if (!is_whole()) options.inputs_since = node::wall_time() + kStart;
  const node::NodeLog log = log_of(merger.id);
  if (&merger == &scene_->mergers.back()) {
    auto opened =
        node::open_background(*scene_, [&](const std::string& notice) { log.info(notice); });
    if (!opened) return opened.error();
    options.background = *std::move(opened);
    auto model =
        rate::open_model(scene_->rate, [&](const std::string& notice) { log.warn(notice); });
    if (!model) return model.error();
    options.rate_model = *std::move(model);
  }
  add(std::make_unique<node::MergeTask>(*scene_, merger, log, std::move(options)),
      threads_config());
  return {};
}

Status LiveScene::start_gateway() {
  const GatewayConfig config = scene_->gateway.value_or(GatewayConfig{});
  const node::NodeLog log = log_of(kGateway);
  const auto& state = options_.state_folder;
  auto policy = gateway::AccessPolicy::open(config, state.empty() ? "" : state / scene_->id);
  if (!policy) return policy.error();
  for (const std::string& notice : policy->notices) log.info(notice);
  auto task = std::make_unique<gateway::Gateway>(
      *scene_, log,
      gateway::Gateway::Options{.tokens = std::move(policy->tokens),
                                .expects_root = !is_whole(),
                                .has_ended = [this] { return ended_ >= scene_->sensors.size(); }});
  const auto monitor = std::make_shared<Monitor>([this] { return figures(); });
  auto web = net::WebServer::listen(
      gateway::web_config(config, *policy, options_.page),
      [monitor, gateway = task.get()](const std::string& path, const net::Visitor& visitor) {
        return monitor->page(path, gateway->may_read_figures(visitor, node::wall_time()));
      });
  if (!web) return web.error();
  web_ = *std::move(web);
  urls_ = gateway::urls_of(config, web_->port());
  task->attach(*web_, node::wall_time);
  TaskThreads::Config threads = threads_config();
  threads.makes_packets = threads.folds = false;  // viewers have queues of their own
  threads.longest_wait = std::chrono::milliseconds(100);
  add(std::move(task), std::move(threads));
  return {};
}

/// Devices set the pace themselves; recordings and rendered pictures are paced.
std::unique_ptr<node::FrameInput> LiveScene::input_of(std::unique_ptr<FrameSource> source,
                                                      const node::Clock& clock) const {
  if (source->is_live()) return std::make_unique<LiveFrames>(std::move(source), clock);
  return std::make_unique<PacedFrames>(std::move(source), scene_->fps, clock);
}

void LiveScene::start_sensors(const std::vector<SensorId>& sensors) {
  auto sources = node::open_sources(*scene_, sensors, options_.cache_folder, options_.rendering);
  TaskThreads::Config config = threads_config();
  config.threads = threads_each(config.threads, sensors.size());
  config.gives_way = is_whole();
  config.ended = [this] { ++ended_; };
  for (std::size_t i = 0; i < sensors.size(); ++i)
    add(std::make_unique<node::SensorTask>(*scene_, sensors[i],
                                           input_of(std::move(sources[i]), config.clock),
                                           log_of(scene_->sensor(sensors[i]).id),
                                           node::NodeClock::live(), node::StillWork::beside),
        config);
}

void LiveScene::add(std::unique_ptr<node::Task> task, TaskThreads::Config config) {
  const node::NodeLog log = log_of(task->id());
  auto threads =
      std::make_unique<TaskThreads>(std::move(task), *transport_, log, std::move(config));
  const std::lock_guard lock(mutex_);
  nodes_.push_back(std::move(threads));
}

Status LiveScene::set_plan(const ScenePlan& plan) {
  const auto control = codec::plan_control(plan);
  if (!control) return control.error();
  transport_->request(scene_->mergers.back().id, net::as_message(codec::encode_control(*control)));
  return {};
}

std::vector<node::NodeStats> LiveScene::stats() const {
  std::vector<node::NodeStats> out;
  const std::lock_guard lock(mutex_);
  for (const auto& node : nodes_) out.push_back(node->stats());
  return out;
}

/// The nodes' stats; transport drops are added to those of the first node.
std::vector<node::NodeStats> LiveScene::figures() const {
  auto all = stats();
  if (!all.empty()) all.front().drops.merge(transport_drops());
  return all;
}

double LiveScene::seconds() const {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - started_).count();
}

std::string to_json(const LiveScene& live) {
  using Json = nlohmann::ordered_json;
  const double seconds = live.seconds();
  const auto rounded = [](double v) { return std::round(v * 1000) / 1000; };
  Json nodes = Json::object();
  for (const node::NodeStats& node : live.stats()) {
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

}  // namespace mr::runtime
