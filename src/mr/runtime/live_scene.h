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

#include "mr/core/frame_source.h"
#include "mr/core/log.h"
#include "mr/core/result.h"
#include "mr/gateway/gateway.h"
#include "mr/net/transport.h"
#include "mr/net/web_server.h"
#include "mr/node/frame_input.h"
#include "mr/runtime/task_threads.h"
#include "mr/scene/scene.h"

namespace mr::runtime {

struct LiveOptions {
  /// The nodes to run in this process: sensors, mergers, "gateway". Empty: all of them, connected
  /// in-process; else connected by NATS or TCP, as the scene says.
  std::vector<std::string> nodes;
  std::filesystem::path page;          ///< folder of the built viewer, for the gateway
  std::filesystem::path cache_folder;  ///< cache of rendered rigs; empty: none
  int threads = 0;                     ///< per node stage; 0: as the scene says
  std::filesystem::path state_folder;  ///< for state kept between runs; empty: none is kept
  std::string metrics;                 ///< host:port of a server for /metrics and /healthz
  Log log = [](const LogLine&) {};
  std::function<void(int done, int of)> rendering;  ///< progress of rendering a rig
};

/// Some or all nodes of a scene, running on threads until destroyed.
class LiveScene {
 public:
  /// Errors: not_found: the scene has no node of this name. invalid: several processes, but neither
  /// NATS nor TCP in the scene. io: the gateway cannot listen on its address.
  static Result<std::unique_ptr<LiveScene>> start(Scene scene, const LiveOptions& options);
  ~LiveScene();

  const Scene& scene() const { return *scene_; }
  /// URLs of the viewer, the most useful first; empty: the gateway does not run in this process.
  const std::vector<std::string>& urls() const { return urls_; }
  std::vector<node::NodeStats> stats() const;
  /// Packets lost or folded between nodes since the start, by cause.
  std::map<std::string, std::uint64_t> transport_drops() const { return transport_->drops(); }
  double seconds() const;

  /// Requests that the root, in whatever process it runs, and all nodes below it use this plan. The
  /// message may be lost: repeat the call until packets carry the plan. Error
  /// invalid: the first of the plan's problems().
  Status set_plan(const ScenePlan& plan);

 private:
  LiveScene(Scene scene, LiveOptions options);
  bool is_whole() const { return options_.nodes.empty(); }
  node::NodeLog log_of(const std::string& node) const;
  Status open_transport();
  Status serve_figures();
  TaskThreads::Config threads_config() const;
  Status start_merger(const MergerConfig& merger);
  Status start_gateway();
  std::unique_ptr<node::FrameInput> input_of(std::unique_ptr<FrameSource> source,
                                             const node::Clock& clock) const;
  void start_sensors(const std::vector<SensorId>& sensors);
  void add(std::unique_ptr<node::Task> task, TaskThreads::Config config);
  std::vector<node::NodeStats> figures() const;

  std::unique_ptr<const Scene> scene_;  // nodes point to it
  LiveOptions options_;
  std::atomic<std::size_t> ended_ = 0;  ///< sensors of this process whose recordings have ended
  std::unique_ptr<net::Transport> transport_;
  mutable std::mutex mutex_;             // guards nodes_, while nodes start and end
  std::unique_ptr<net::WebServer> web_;  ///< the gateway's; must outlive the gateway
  std::vector<std::unique_ptr<TaskThreads>> nodes_;
  std::vector<std::string> urls_;
  std::chrono::steady_clock::time_point started_ = std::chrono::steady_clock::now();
  std::unique_ptr<net::WebServer> monitor_;  // last: it queries the nodes
};

/// The names of all nodes of a scene, children before parents; the gateway is last.
std::vector<std::string> node_names(const Scene& scene);

/// The JSON that `meshreduce run --report` writes after a live run.
std::string to_json(const LiveScene& live);

}  // namespace mr::runtime
