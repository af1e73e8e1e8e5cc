#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "mr/codec/head.h"
#include "mr/codec/receiver.h"
#include "mr/core/decoded_scene.h"
#include "mr/core/frame_source.h"
#include "mr/core/result.h"
#include "mr/core/scene.h"
#include "mr/node/merge_node.h"
#include "mr/node/report.h"
#include "mr/node/sensor_node.h"

namespace mr::node {

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
  std::function<void(int frame, const RootAtlas::Drawing& drawing)> drawing{};
  /// What people should look at though nothing was lost; one line.
  std::function<void(const std::string& message)> warned{};
};

/// The whole scene in one process, in lockstep: every frame goes through every sensor node, every
/// merger and a client, one after another, each with all threads of the caller's arena. No pacing,
/// no deadline, no drops but those of broken input. Nodes exchange the same bytes as over a
/// network.
class Pipeline {
 public:
  /// Opens the scene's sources; a rig is turned into its sensors. `cache_folder`: of rendered rigs;
  /// empty: none.
  static Result<std::unique_ptr<Pipeline>> open(Scene scene,
                                                const std::filesystem::path& cache_folder = {});

  /// Goes on as if so many more frames had been captured; cheap.
  void skip(std::uint64_t frames);

  /// The next capture has key frames of some of the root's streams, as if a client had asked.
  void ask_key_frames(std::vector<std::uint32_t> streams);

  /// Runs until `frames` were captured or all sources ended. empty: no frame reached the client.
  Result<RunReport> run(int frames, const RunListener& listener = {});

  /// The newest capture as a client has it; nothing before the first.
  const std::optional<DecodedScene>& decoded() const { return decoded_; }
  /// The root's newest packet, in bytes that can be read without any other; empty before the first.
  std::vector<std::byte> last_packet() const;
  /// The same without pictures, but with the payloads of all its chunks.
  std::vector<std::byte> last_mesh() const;
  /// The root's newest merged surface, labelled, before coding; nothing before the first.
  std::optional<Mesh> surface() const;
  const Scene& scene() const { return *scene_; }

 private:
  /// Where a node's packets go: an input of a merger.
  struct Edge {
    MergeNode* merger = nullptr;
    std::size_t input = 0;
  };
  struct Measured;

  Pipeline(std::unique_ptr<Scene> scene, const std::filesystem::path& cache_folder);
  std::vector<Edge> edges_from(const std::string& id);
  using Progress = std::function<void(const std::string& node)>;
  std::vector<std::byte> ask(const std::string& id, const codec::Request& request);
  void serve(MergeNode& merger, TimePoint now);
  void take_answer(const std::vector<std::byte>& answer);
  bool capture(std::vector<std::optional<Frame>>& frames);
  void run_frame(std::vector<std::optional<Frame>> frames, Measured& measured,
                 const Progress& progress);
  Result<std::vector<std::byte>> sense(SensorNode& sensor, Frame frame, const Measured& measured);
  void run_merger(MergeNode& merger, TimePoint now, Measured& measured);
  void lose(const std::string& id, const Error& error, Measured& measured);
  void deliver(const std::string& from, const std::vector<std::byte>& bytes, TimePoint now,
               Measured& measured);
  void show(const std::vector<std::byte>& bytes, Measured& measured);
  std::map<std::string, std::uint64_t> all_drops() const;
  double critical_path_ms(const std::map<std::string, double>& node_ms) const;
  double throughput_fps(const Measured& measured) const;
  RunReport report(const Measured& measured, double seconds) const;

  std::unique_ptr<Scene> scene_;  // nodes point to it
  std::vector<std::unique_ptr<FrameSource>> sources_;
  std::vector<std::unique_ptr<SensorNode>> sensors_;
  std::vector<std::unique_ptr<MergeNode>> mergers_;
  codec::HeadReader client_heads_;
  codec::Receiver client_;
  std::optional<DecodedScene> decoded_;
  std::optional<Packet> last_packet_;
  DropCounter drops_;
};

}  // namespace mr::node
