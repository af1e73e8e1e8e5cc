#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "mr/core/log.h"
#include "mr/core/result.h"
#include "mr/net/web_server.h"
#include "mr/node/task.h"

namespace mr::runtime {

/// The state of this process's nodes.
struct Health {
  enum class Status {
    ok,
    degraded,  ///< some input is missing
    down       ///< no input delivers anything
  };
  Status status = Status::ok;
  std::vector<std::string> missing;  ///< inputs and sensors, each once, sorted
};
Health health_of(const std::vector<node::NodeStats>& nodes);

/// {"status": "ok" | "degraded" | "down", "missing": ["cam-1"], "nodes": {"root": {"packets": 7}}};
/// without `in_detail` only the status.
std::string health_json(const std::vector<node::NodeStats>& nodes, bool in_detail);

/// The figures in Prometheus' text format: packets, bytes, stages, drops by cause, inputs alive,
/// clocks, viewers, this process.
std::string metrics_text(const std::vector<node::NodeStats>& nodes);

/// The pages at /healthz and /metrics. They are generated at most four times a second and cached,
/// as generating them blocks on busy nodes. Thread-safe.
class Monitor {
 public:
  explicit Monitor(std::function<std::vector<node::NodeStats>()> stats)
      : stats_(std::move(stats)) {}

  /// Nothing for other paths. A visitor who may not read figures gets only the status (/healthz) or
  /// 401 (/metrics).
  std::optional<net::WebPage> page(const std::string& path, bool may_read_figures);

 private:
  struct Pages {
    bool is_down = false;
    std::string status, health, metrics;
  };
  const Pages& pages();

  std::function<std::vector<node::NodeStats>()> stats_;
  std::mutex mutex_;
  Pages pages_;
  std::optional<std::chrono::steady_clock::time_point> made_;
};

/// Serves only these two pages, for a process without a gateway. Errors as WebServer::listen().
Result<std::unique_ptr<net::WebServer>> serve_monitor(
    const std::string& listen, std::function<std::vector<node::NodeStats>()> stats);

}  // namespace mr::runtime
