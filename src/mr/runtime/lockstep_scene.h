#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "mr/core/decoded_scene.h"
#include "mr/core/frame_source.h"
#include "mr/core/result.h"
#include "mr/net/transport.h"
#include "mr/node/client_task.h"
#include "mr/node/merge_task.h"
#include "mr/node/sensor_task.h"
#include "mr/runtime/report.h"
#include "mr/runtime/task_steps.h"
#include "mr/scene/scene.h"

namespace mr::runtime {

/// The cost of one capture. Times are those of the nodes' own calls, without reading or rendering
/// the sensors' pictures and without the client.
struct CaptureCost {
  bool shown = false;  ///< the capture reached the client
  // Sent by the root to the client:
  std::uint64_t mesh_bytes = 0;                   ///< payloads of chunks
  std::uint64_t still_bytes = 0;                  ///< the still surface's part of mesh_bytes
  std::uint64_t plate_bytes = 0;                  ///< the plates' part of texture_bytes
  std::uint64_t texture_bytes = 0;                ///< access units
  std::uint64_t head_bytes = 0;                   ///< the rest of the packet
  std::uint64_t alpha_bytes = 0;                  ///< the alpha planes' part of head_bytes
  bool key_frame = false;                         ///< some texture unit is a key frame
  CodingPlan plan;                                ///< by which the root coded it
  double sensors_cpu_ms = 0, mergers_cpu_ms = 0;  ///< CPU time on all threads
  double critical_path_ms = 0;  ///< slowest node of each layer, each alone, summed; wall clock
};

/// Callbacks of a run; all may be empty.
struct RunListener {
  std::function<void(int frame, int frames, const std::string& node)> progress;
  std::function<void(const std::string& message)> dropped;  ///< one line that names what and where
  std::function<void(int frame, const DecodedScene& scene)> shown{};  ///< decoded by the client
  /// Bytes of one capture that were sent to the client; mesh: all of a packet except textures.
  std::function<void(int frame, std::uint64_t mesh_bytes, std::uint64_t texture_bytes)> sent{};
  std::function<void(int frame, std::span<const std::byte> bytes)> packet{};  ///< the root's
  std::function<void(int frame, const CaptureCost& cost)> captured{};  ///< after everything else
  /// Called before the root draws its atlases.
  std::function<void(int frame, const node::RootAtlas::Drawing& drawing)> drawing{};
  /// A warning about something other than lost data; one line.
  std::function<void(const std::string& message)> warned{};
};

/// The executor in virtual time: a whole scene in one process, in lockstep. Every frame passes
/// through every sensor, every merger and a client, one after another, each with all threads of the
/// caller's arena. No pacing, no deadlines, and no drops except of invalid input. Nodes exchange
/// the same bytes as over a network. Deterministic: the same input gives the same bytes. Devices
/// set the pace: each frame waits for theirs; times count from the first one.
class LockstepScene {
 public:
  /// Opens the scene's sources; a rig is replaced by its sensors. `cache_folder`: cache of rendered
  /// rigs; empty: none.
  static Result<std::unique_ptr<LockstepScene>> open(
      Scene scene, const std::filesystem::path& cache_folder = {});
  ~LockstepScene();

  /// Skips this many frames without reading them; cheap.
  void skip(std::uint64_t frames);

  /// Gives this many frames to the sensors only to learn the room: nothing is reconstructed. Much
  /// cheaper than run().
  Status learn(int frames);

  /// One frame of every sensor; nothing where a source gave none.
  using Capture = std::vector<std::optional<Frame>>;
  /// Reads the next captures of the sources without running them. Fewer if all sources end. Errors:
  /// the first of a source.
  Result<std::vector<Capture>> read(int frames);

  /// The state of the layers, for measuring: to measure several plans from the same state, also in
  /// another LockstepScene of the same sensors.
  struct Memory {
    std::vector<std::optional<node::SensorLayers::Memory>> sensors;
    node::RootAtlas::Memory root;
  };
  Memory memory() const;
  void recall(const Memory& memory);

  /// Requests key frames of some of the root's streams in the next capture, as a client does.
  void ask_key_frames(std::vector<StreamId> streams);

  /// Sends a plan to the root, as a rate controller does. The mergers use it from the next capture
  /// on, the sensors from the one after that. Error invalid: the first of the plan's problems().
  Status set_plan(const ScenePlan& plan);

  /// Sets the rate that the root aims at from the next capture on, as viewers do; above 0. Without
  /// effect where the scene's rate.model is fixed.
  void set_target(double mbps);

  /// Runs until `frames` were captured or all sources ended. Error empty: no frame reached the
  /// client.
  Result<RunReport> run(int frames, const RunListener& listener = {});
  /// Runs these captures in place of the sources', as if they followed the last one.
  Result<RunReport> run(std::span<const Capture> captures, const RunListener& listener = {});

  /// The newest capture as decoded by the client; nothing before the first.
  const std::optional<DecodedScene>& decoded() const { return decoded_; }
  /// The root's newest packet, self-contained: decodable without earlier ones; empty before the
  /// first.
  std::vector<std::byte> last_packet() const;
  /// The same without textures, with the payloads of all its chunks.
  std::vector<std::byte> last_mesh() const;
  /// The root's newest merged surface, labelled, before encoding; nothing before the first.
  std::optional<Mesh> surface() const { return root().node().surface(); }
  const Scene& scene() const { return *scene_; }

 private:
  class GivenFrame;
  struct Measured;
  /// A node and its executor.
  template <typename T>
  struct Member {
    std::unique_ptr<T> task;
    std::unique_ptr<TaskSteps> steps;
  };

  LockstepScene(std::unique_ptr<Scene> scene, std::vector<EncodedChunk> background,
                std::shared_ptr<const rate::Model> rate_model,
                const std::filesystem::path& cache_folder);
  node::NodeLog log_of(const std::string& id);
  template <typename T>
  Member<T> member(std::unique_ptr<T> task);
  node::MergeTask& root() const { return *mergers_.back().task; }
  Result<RunReport> run(int frames, const std::function<bool(int)>& capture,
                        const RunListener& listener);
  bool capture();
  bool give(const Capture& capture, Duration later);
  void lay_on_scene(Result<std::optional<Frame>>& captured);
  void run_frame(Measured& measured, const std::function<void(const std::string&)>& progress);
  void run_sensor(std::size_t sensor, Measured& measured);
  void run_merger(Member<node::MergeTask>& merger, Measured& measured);
  void make_packet(const node::Task& task, TaskSteps& steps, Measured& measured);
  void show(Measured& measured);
  void count_bytes(const Packet& packet, std::uint64_t bytes, Measured& measured) const;
  std::map<std::string, std::uint64_t> all_drops() const;
  double critical_path_ms(const std::map<std::string, double>& node_ms) const;
  double throughput_fps(const Measured& measured) const;
  RunReport report(const Measured& measured, double seconds) const;

  std::unique_ptr<Scene> scene_;  // nodes point to it
  std::string model_unusable_;    ///< why the scene's model file is not used; told once
  TimePoint last_capture_{};
  const RunListener* listener_ = nullptr;  ///< of the current run
  TimePoint now_{};
  DropCounter drops_;
  std::unique_ptr<net::Transport> transport_;
  std::vector<std::unique_ptr<FrameSource>> sources_;
  std::optional<TimePoint> live_start_;  ///< time of day of the first frame of a device
  std::vector<GivenFrame*> frames_;      ///< owned by the sensors' tasks
  std::vector<Member<node::SensorTask>> sensors_;
  std::vector<Member<node::MergeTask>> mergers_;  ///< children before parents
  Member<node::ClientTask> client_;
  std::uint64_t root_bytes_ = 0;        ///< size of the packet sent to the client
  std::optional<std::uint64_t> shown_;  ///< sequence of the last packet shown
  std::optional<DecodedScene> decoded_;
};

}  // namespace mr::runtime
