#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "mr/core/log.h"
#include "mr/core/result.h"
#include "mr/net/web_server.h"
#include "mr/node/live_node.h"

namespace mr::node {

/// How the nodes of this process are.
struct Health {
  enum class Status {
    ok,
    degraded,  ///< some input is missing
    down       ///< nothing comes at all
  };
  Status status = Status::ok;
  std::vector<std::string> missing;  ///< inputs and sensors, each once, sorted
};
Health health_of(const std::vector<LiveStats>& nodes);

/// {"status": "ok" | "degraded" | "down", "missing": ["cam-1"], "nodes": {"root": {"packets": 7}}};
/// without `in_detail` the status alone.
std::string health_json(const std::vector<LiveStats>& nodes, bool in_detail);

/// The figures in Prometheus' text format: packets, bytes, stages, drops by cause, inputs alive,
/// clocks, viewers, this process.
std::string metrics_text(const std::vector<LiveStats>& nodes);

/// The page at /healthz or /metrics; nothing for another path. Who has no right to look gets the
/// bare status (of /healthz) or 401.
std::optional<net::WebPage> monitor_page(const std::string& path, bool may_look,
                                         const std::function<std::vector<LiveStats>()>& stats);

/// Serves these two pages alone, for a process without a gateway. io, invalid: see WebServer.
Result<std::unique_ptr<net::WebServer>> serve_monitor(
    const std::string& listen, std::function<std::vector<LiveStats>()> stats);

}  // namespace mr::node
