#include "mr/runtime/monitor.h"

#include <prometheus/metric_family.h>
#include <prometheus/text_serializer.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <nlohmann/json.hpp>
#include <set>

#include "mr/core/trace.h"

namespace mr::runtime {
namespace {

using prometheus::ClientMetric;
using prometheus::MetricFamily;
using prometheus::MetricType;
using Labels = std::vector<ClientMetric::Label>;

constexpr std::size_t kNewest = 300;  // samples of a stage for its percentiles

const char* name_of(Health::Status status) {
  constexpr const char* kNames[] = {"ok", "degraded", "down"};
  return kNames[static_cast<int>(status)];
}

/// Families of metrics, in the order in which they first appear.
class Metrics {
 public:
  Metrics& family(const std::string& name, const std::string& help, MetricType type) {
    const char* unit = type == MetricType::Counter ? "_total" : "";
    families_.push_back({"meshreduce_" + name + unit, help, type, {}});
    return *this;
  }
  /// Adds a sample to the family named last.
  void add(Labels labels, double value) {
    MetricFamily& family = families_.back();
    ClientMetric& metric = family.metric.emplace_back();
    metric.label = std::move(labels);
    if (family.type == MetricType::Counter)
      metric.counter.value = value;
    else
      metric.gauge.value = value;
  }
  std::string text() const { return prometheus::TextSerializer().Serialize(families_); }

 private:
  std::vector<MetricFamily> families_;
};

void add_stages(Metrics& metrics, const std::vector<node::NodeStats>& nodes) {
  metrics.family("stage_seconds", "Time that a stage takes a capture, of the last 300.",
                 MetricType::Gauge);
  for (const node::NodeStats& node : nodes)
    for (const auto& [stage, ms] : node.stages_ms) {
      const auto newest = static_cast<std::ptrdiff_t>(std::min(ms.size(), kNewest));
      const std::vector<double> last(ms.end() - newest, ms.end());
      for (const auto& [label, p] : {std::pair("50", 0.5), std::pair("95", 0.95)})
        metrics.add({{"node", node.id}, {"stage", stage}, {"percentile", label}},
                    percentile(last, p) / 1e3);
    }
}

void add_viewers(Metrics& metrics, const node::NodeStats::Viewers& viewers) {
  metrics.family("viewers", "Viewers that are connected.", MetricType::Gauge)
      .add({}, static_cast<double>(viewers.watching));
  metrics.family("viewer_sent_bytes", "Bytes that went to viewers.", MetricType::Counter)
      .add({}, static_cast<double>(viewers.sent_bytes));
  metrics.family("viewer_unread_bytes", "Bytes that wait for viewers.", MetricType::Gauge)
      .add({}, static_cast<double>(viewers.unread_bytes));
}

double resident_bytes() {
  std::ifstream statm("/proc/self/statm");
  double all = 0, resident = 0;
  statm >> all >> resident;
  return resident * static_cast<double>(::sysconf(_SC_PAGESIZE));
}

void add_process(Metrics& metrics) {
  metrics.family("cpu_seconds", "Processor time of this process.", MetricType::Counter)
      .add({}, process_cpu_ms() / 1e3);
  metrics.family("resident_bytes", "Memory of this process.", MetricType::Gauge)
      .add({}, resident_bytes());
}

}  // namespace

Health health_of(const std::vector<node::NodeStats>& nodes) {
  Health health;
  std::set<std::string> missing;
  bool is_down = !nodes.empty();
  for (const node::NodeStats& node : nodes) {
    is_down &= node.is_silent;
    if (node.viewers && node.is_silent) health.status = Health::Status::down;
    if (!node.viewers && node.is_silent) missing.insert(node.id);
    for (const auto& [input, is_there] : node.inputs)
      if (!is_there) missing.insert(input);
  }
  health.missing.assign(missing.begin(), missing.end());
  if (is_down) health.status = Health::Status::down;
  if (!missing.empty()) health.status = std::max(health.status, Health::Status::degraded);
  return health;
}

std::string health_json(const std::vector<node::NodeStats>& nodes, bool in_detail) {
  using Json = nlohmann::ordered_json;
  const Health health = health_of(nodes);
  Json out{{"status", name_of(health.status)}};
  if (in_detail) {
    out["missing"] = health.missing;
    for (const node::NodeStats& node : nodes) {
      out["nodes"][node.id] = {{"packets", node.frames}};
      if (node.viewers) out["nodes"][node.id]["viewers"] = node.viewers->watching;
    }
  }
  return out.dump() + "\n";
}

std::string metrics_text(const std::vector<node::NodeStats>& nodes) {
  Metrics metrics;
  metrics.family("packets", "Packets that a node sent; of the gateway, that it took.",
                 MetricType::Counter);
  for (const node::NodeStats& node : nodes)
    metrics.add({{"node", node.id}}, static_cast<double>(node.frames));
  metrics.family("packet_bytes", "Bytes of these packets.", MetricType::Counter);
  for (const node::NodeStats& node : nodes)
    metrics.add({{"node", node.id}}, static_cast<double>(node.bytes));
  add_stages(metrics, nodes);
  metrics.family("drops", "What was lost, refused or folded, by cause.", MetricType::Counter);
  for (const node::NodeStats& node : nodes)
    for (const auto& [cause, times] : node.drops)
      metrics.add({{"node", node.id}, {"cause", cause}}, static_cast<double>(times));
  metrics.family("input_up", "Whether a node's input, or a sensor of the scene, brings captures.",
                 MetricType::Gauge);
  for (const node::NodeStats& node : nodes)
    for (const auto& [input, is_there] : node.inputs)
      metrics.add({{"node", node.id}, {"input", input}}, is_there ? 1 : 0);
  metrics.family("clock_offset_seconds", "How far an input's clock is ahead of the node's.",
                 MetricType::Gauge);
  for (const node::NodeStats& node : nodes)
    for (const auto& [input, seconds] : node.clock_offsets_s)
      metrics.add({{"node", node.id}, {"input", input}}, seconds);
  for (const node::NodeStats& node : nodes)
    if (node.viewers) add_viewers(metrics, *node.viewers);
  add_process(metrics);
  return metrics.text();
}

const Monitor::Pages& Monitor::pages() {
  constexpr std::chrono::milliseconds kFresh{250};
  const auto now = std::chrono::steady_clock::now();
  if (made_ && now - *made_ < kFresh) return pages_;
  const std::vector<node::NodeStats> nodes = stats_();
  pages_ = {health_of(nodes).status == Health::Status::down, health_json(nodes, false),
            health_json(nodes, true), metrics_text(nodes)};
  made_ = now;
  return pages_;
}

std::optional<net::WebPage> Monitor::page(const std::string& path, bool may_read_figures) {
  const std::lock_guard lock(mutex_);
  if (path == "/healthz")
    return net::WebPage{pages().is_down ? 503 : 200, "application/json",
                        may_read_figures ? pages().health : pages().status};
  if (path != "/metrics") return std::nullopt;
  if (!may_read_figures) return net::WebPage{.status = 401, .text = "a token is needed\n"};
  return net::WebPage{200, "text/plain; version=0.0.4; charset=utf-8", pages().metrics};
}

Result<std::unique_ptr<net::WebServer>> serve_monitor(
    const std::string& listen, std::function<std::vector<node::NodeStats>()> stats) {
  net::WebConfig config;
  config.listen = listen;
  auto server = net::WebServer::listen(
      config,
      [monitor = std::make_shared<Monitor>(std::move(stats))](
          const std::string& path, const net::Visitor&) { return monitor->page(path, true); });
  if (!server) return server.error();
  (*server)->run({.opened = {},
                  .received = [](net::ViewerId, std::span<const std::byte>, bool) { return false; },
                  .writable = {},
                  .closed = {}});
  return server;
}

}  // namespace mr::runtime
