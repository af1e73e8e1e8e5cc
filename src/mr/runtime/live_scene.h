#pragma once

#include <atomic>
#include <chrono>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "mr/core/log.h"
#include "mr/core/result.h"
#include "mr/gateway/gateway.h"
#include "mr/net/transport.h"
#include "mr/net/web_server.h"
#include "mr/runtime/task_threads.h"
#include "mr/scene/scene.h"

namespace mr::runtime {

struct LiveOptions {
  /// Which nodes to run here: sensors, mergers, "gateway". Empty: all of them, joined in this
  /// process; else by NATS or TCP, as the scene says.
  std::vector<std::string> nodes;
  std::filesystem::path page;          ///< folder of the built viewer, for the gateway
  std::filesystem::path cache_folder;  ///< of rendered rigs; empty: none
  int threads = 0;                     ///< of each stage; 0: as the scene says
  std::filesystem::path state_folder;  ///< for what is kept between runs; empty: nowhere
  std::string metrics;                 ///< host:port of /metrics and /healthz beside the gateway's
  Log log = [](const LogLine&) {};
  std::function<void(int done, int of)> rendering;  ///< a rig's pictures on their way to the cache
};

/// Some or all nodes of a scene, running on threads until destroyed.
class LiveScene {
 public:
  /// not_found: the scene has no node of such a name. invalid: several processes, but neither NATS
  /// nor TCP in the scene. io: the gateway's address cannot be listened on.
  static Result<std::unique_ptr<LiveScene>> start(Scene scene, const LiveOptions& options);
  ~LiveScene();

  const Scene& scene() const { return *scene_; }
  /// What people open in a browser, the likeliest first; empty where the gateway does not run here.
  const std::vector<std::string>& urls() const { return urls_; }
  std::vector<node::NodeStats> stats() const;
  /// Lost or folded between nodes since the start.
  std::map<std::string, std::uint64_t> transport_drops() const { return transport_->drops(); }
  double seconds() const;

  /// Asks the root, in whatever process it runs, that it and all below code by this plan. Word may
  /// be lost: say it again where a packet does not tell it. Its problems() must be none.
  void set_plan(const ScenePlan& plan);

 private:
  LiveScene(Scene scene, LiveOptions options);
  bool is_whole() const { return options_.nodes.empty(); }
  node::NodeLog log_of(const std::string& node) const;
  Status open_transport();
  Status serve_figures();
  TaskThreads::Config threads_config() const;
  Status start_merger(const MergerConfig& merger);
  Status start_gateway();
  void start_sensors(const std::vector<SensorId>& sensors);
  void add(std::unique_ptr<node::Task> task, TaskThreads::Config config);
  std::vector<node::NodeStats> figures() const;

  std::unique_ptr<const Scene> scene_;  // nodes point to it
  LiveOptions options_;
  std::atomic<std::size_t> ended_ = 0;  ///< sensors of this process whose recordings have ended
  std::unique_ptr<net::Transport> transport_;
  mutable std::mutex mutex_;             // of nodes_, while they start and end
  std::unique_ptr<net::WebServer> web_;  ///< the gateway's; it outlives what sends by it
  std::vector<std::unique_ptr<TaskThreads>> nodes_;
  std::vector<std::string> urls_;
  std::chrono::steady_clock::time_point started_ = std::chrono::steady_clock::now();
  std::unique_ptr<net::WebServer> monitor_;  // last: it asks the nodes
};

/// The names of all nodes of a scene, children before parents; the gateway is last.
std::vector<std::string> node_names(const Scene& scene);

/// What `meshreduce run --report` writes after a live run.
std::string to_json(const LiveScene& live);

}  // namespace mr::runtime
