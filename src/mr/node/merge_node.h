#pragma once

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "mr/atlas/layout.h"
#include "mr/codec/receiver.h"
#include "mr/core/result.h"
#include "mr/core/scene.h"
#include "mr/core/trace.h"
#include "mr/node/aligner.h"
#include "mr/node/chunk_publisher.h"
#include "mr/node/texture_stream.h"

namespace mr::node {

/// A merging server (paper 3.2, 3.3). Takes packets of sensors or of other mergers, and gives
/// packets of the same form: one surface without overlap, seams closed, every triangle labelled
/// with a view. The root decimates and composes one texture atlas; an inner merger hands its
/// children's texture streams on untouched, so that pictures are coded twice at most however many
/// layers there are. Single-threaded object; its stages use the caller's arena.
class MergeNode {
 public:
  /// What a merger asks of its inputs.
  struct Upstream {
    /// A chunk that is missing; null when the input cannot give it.
    std::function<std::shared_ptr<const EncodedChunk>(std::size_t input, const ChunkKey&)> chunk;
    /// A key frame on all its texture streams, after a loss.
    std::function<void(std::size_t input)> key_frame;
  };

  /// The scene must outlive the node.
  MergeNode(const Scene& scene, const MergerConfig& merger, bool is_root, Upstream upstream);

  const std::string& id() const { return merger_.id; }
  const MergerConfig& config() const { return merger_; }

  /// Takes one packet of an input. What was wrong inside it is counted in drops(); an Error means
  /// that the whole packet was refused.
  Status receive(std::size_t input, std::span<const std::byte> bytes, TimePoint now);

  /// The bytes of the next merged packet, if a tick is ready. empty: there is no live input.
  Result<std::optional<std::vector<std::byte>>> merge(TimePoint now);

  std::shared_ptr<const EncodedChunk> find(const ChunkKey& key) const {
    return publisher_.find(key);
  }
  /// The next packet's textures will be key frames; an inner merger hands the wish on.
  void ask_key_frame();

  /// Whether the last merge found the inputs' geometry unchanged and kept its surface.
  bool reused() const { return reused_; }

  const Trace& trace() const { return trace_; }
  const DropCounter& drops() const { return drops_; }
  void set_drop_listener(DropCounter::Listener listener) {
    drops_.set_listener(std::move(listener));
  }

 private:
  struct Input {
    std::string id;
    std::set<std::uint32_t> sensors;  // that this input may speak for
    codec::Receiver receiver;
    std::vector<TextureUnit> units;  // to hand on
  };
  struct Gathered {  // what is merged in one tick
    std::vector<DecodedScene> scenes;
    std::vector<View> views;  // of all, by id, streams as the children have them
    std::vector<SourceInfo> sources;
  };
  struct Surface {
    Mesh mesh;  // labelled, on the lattice
    float error_m = 0;
  };

  Status check_sender(const Input& input, const Packet& packet) const;
  void give_up_units();
  Result<std::vector<std::byte>> merge_tick(TimePoint tick);
  Result<Gathered> gather(TimePoint tick);
  Result<Surface> merge_surfaces(const Gathered& gathered);
  Status add_textures(const Gathered& gathered, const Mesh& mesh, Packet& packet);
  Status compose_atlas(const Gathered& gathered, const Mesh& mesh, Packet& packet);
  void hand_on_streams(const Gathered& gathered, Packet& packet);

  const Scene* scene_;
  MergerConfig merger_;
  bool is_root_;
  Upstream upstream_;
  std::vector<Input> inputs_;
  Aligner aligner_;
  ChunkPublisher publisher_;
  TextureStream texture_;
  atlas::Layout layout_;
  std::optional<std::pair<Gathered, Surface>> last_;  // reused while the inputs' geometry stays
  bool reused_ = false;
  double decode_ms_ = 0;
  std::uint64_t sequence_ = 0;
  Trace trace_;
  DropCounter drops_;
};

}  // namespace mr::node
