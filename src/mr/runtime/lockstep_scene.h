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

/// What one capture took. Time of nodes is that of their own calls: neither what reads or renders
/// the sensors' pictures nor what the client does.
struct CaptureCost {
  bool shown = false;  ///< it reached the client
  // What the root sent to the client:
  std::uint64_t mesh_bytes = 0;                   ///< payloads of chunks
  std::uint64_t plate_bytes = 0;                  ///< of texture_bytes, those of plates
  std::uint64_t texture_bytes = 0;                ///< access units
  std::uint64_t head_bytes = 0;                   ///< the rest of the packet
  bool key_frame = false;                         ///< some picture is coded for itself
  double sensors_cpu_ms = 0, mergers_cpu_ms = 0;  ///< processor time on all threads
  double critical_path_ms = 0;  ///< slowest node of each layer, each alone, summed; wall clock
};

/// What a run tells while it goes on; all may be empty.
struct RunListener {
  std::function<void(int frame, int frames, const std::string& node)> progress;
  std::function<void(const std::string& message)> dropped;  ///< one line that names what and where
  std::function<void(int frame, const DecodedScene& scene)> shown{};  ///< what a client has of it
  /// Bytes of one capture that went to the client; mesh: all of a packet but its pictures.
  std::function<void(int frame, std::uint64_t mesh_bytes, std::uint64_t texture_bytes)> sent{};
  std::function<void(int frame, std::span<const std::byte> bytes)> packet{};  ///< of the root
  std::function<void(int frame, const CaptureCost& cost)> captured{};         ///< once all is done
  /// What the root is about to draw.
  std::function<void(int frame, const node::RootAtlas::Drawing& drawing)> drawing{};
  /// What people should look at though nothing was lost; one line.
  std::function<void(const std::string& message)> warned{};
};

/// The executor in virtual time: a whole scene in one process, in lockstep. Every frame goes
/// through every sensor, every merger and a client, one after another, each with all threads of the
/// caller's arena. No pacing, no deadline, no drops but those of broken input. Nodes exchange the
/// same bytes as over a network. Same input, same bytes.
class LockstepScene {
 public:
  /// Opens the scene's sources; a rig is turned into its sensors. `cache_folder`: of rendered rigs;
  /// empty: none.
  static Result<std::unique_ptr<LockstepScene>> open(
      Scene scene, const std::filesystem::path& cache_folder = {});
  ~LockstepScene();

  /// Goes on as if so many more frames had been captured; cheap.
  void skip(std::uint64_t frames);

  /// The next capture has key frames of some of the root's streams, as if a client had asked.
  void ask_key_frames(std::vector<StreamId> streams);

  /// From the next capture on all nodes code by this plan (the sensors from the one after it): as
  /// if whoever controls the rate had given it to the root. Its problems() must be none.
  void set_plan(const ScenePlan& plan);

  /// Runs until `frames` were captured or all sources ended. empty: no frame reached the client.
  Result<RunReport> run(int frames, const RunListener& listener = {});

  /// The newest capture as a client has it; nothing before the first.
  const std::optional<DecodedScene>& decoded() const { return decoded_; }
  /// The root's newest packet, in bytes that can be read without any other; empty before the first.
  std::vector<std::byte> last_packet() const;
  /// The same without pictures, but with the payloads of all its chunks.
  std::vector<std::byte> last_mesh() const;
  /// The root's newest merged surface, labelled, before coding; nothing before the first.
  std::optional<Mesh> surface() const { return root().node().surface(); }
  const Scene& scene() const { return *scene_; }

 private:
  class GivenFrame;
  struct Measured;
  /// A node and what runs it.
  template <typename T>
  struct Member {
    std::unique_ptr<T> task;
    std::unique_ptr<TaskSteps> steps;
  };

  LockstepScene(std::unique_ptr<Scene> scene, std::vector<EncodedChunk> background,
                const std::filesystem::path& cache_folder);
  node::NodeLog log_of(const std::string& id);
  template <typename T>
  Member<T> member(std::unique_ptr<T> task);
  node::MergeTask& root() const { return *mergers_.back().task; }
  bool capture();
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

  std::unique_ptr<Scene> scene_;           // nodes point to it
  const RunListener* listener_ = nullptr;  ///< of the run under way
  TimePoint now_{};
  DropCounter drops_;
  std::unique_ptr<net::Transport> transport_;
  std::vector<std::unique_ptr<FrameSource>> sources_;
  std::vector<GivenFrame*> frames_;  ///< of the sensors' tasks, which own them
  std::vector<Member<node::SensorTask>> sensors_;
  std::vector<Member<node::MergeTask>> mergers_;  ///< children before parents
  Member<node::ClientTask> client_;
  std::uint64_t root_bytes_ = 0;        ///< of the packet on its way to the client
  std::optional<std::uint64_t> shown_;  ///< sequence of the packet that the client showed last
  std::optional<DecodedScene> decoded_;
};

}  // namespace mr::runtime
