#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "mr/codec/stream_receiver.h"
#include "mr/core/mesh.h"
#include "mr/core/packet.h"
#include "mr/core/result.h"
#include "mr/core/trace.h"
#include "mr/node/aligner.h"
#include "mr/scene/scene.h"

namespace mr::node {

/// What is merged in one tick. Mergers that share the space bring the same sensors: then `views`,
/// `sources` and `units` are those of the first input that brings them.
struct CaptureSet {
  TimePoint tick{};
  std::vector<DecodedScene> scenes;
  std::vector<View> views;                 ///< of all, by id, streams as the children have them
  std::vector<SourceInfo> sources;         ///< of all, by sensor
  std::vector<TextureUnit> units;          ///< to hand on; empty where textures are composed anew
  std::vector<AlphaPlane> alpha;           ///< of the captures, by stream; to hand on, as `units`
  std::vector<FrameFeatures> features;     ///< of the captures, by sensor
  std::map<std::string, TimePoint> marks;  ///< the latest of each stage below
  /// Inputs of which something new was taken, with its sequence: to be acknowledged.
  std::vector<std::pair<std::size_t, std::uint64_t>> taken;
};

/// The alpha planes of all pictures; where two inputs have one, that of the first.
AlphaByStream alpha_of(const CaptureSet& captures);

/// The triangles of the cubes that lie in a region, by their centroids; views are kept. Of two
/// regions side by side, each triangle is inside one.
Mesh inside(const Mesh& mesh, const Box3d& region, double chunk_m);

/// The receiving half of a merger: decodes its inputs' packets, asks for what is missing, and
/// brings captures together by time. An input whose newest packet is incomplete is shown as it was
/// last whole. A merger with a region takes the chunks in it and in one cube around it, so that at
/// its border it decides from the same surface as its neighbour. No socket, thread or clock inside;
/// decodes in the caller's arena.
class InputSynchronizer {
 public:
  /// `hand_on`: keep the inputs' texture units for the next merger. The scene must outlive this.
  InputSynchronizer(const Scene& scene, const MergerConfig& merger, bool hand_on);

  /// Takes one packet of an input. What was wrong inside it is counted in drops(); an Error means
  /// that the whole packet was refused.
  Status receive(std::size_t input, std::span<const std::byte> bytes, TimePoint now);
  Status receive(std::size_t input, Packet packet, TimePoint now);

  /// Takes an input's answer to a request.
  void take_answer(std::size_t input, std::span<const std::byte> answer, TimePoint now);

  /// What the inputs should be asked now, one request each at most.
  std::vector<std::pair<std::size_t, codec::Control>> requests(TimePoint now);

  /// The next pictures of all streams should be key frames.
  void ask_key_frames();
  /// Those of some streams, of whatever input has them.
  void ask_key_frames(std::span<const StreamId> streams);

  bool ready(TimePoint now) const { return aligner_.ready(now).has_value(); }

  /// When the newest whole capture of an input was made; nothing before the first.
  std::optional<TimePoint> newest(std::size_t input) const;
  /// When an input had finished its newest packet, by our clock; nothing: it does not say so.
  std::optional<TimePoint> sent_at(std::size_t input) const;
  /// The sensors that an input may speak for.
  const std::set<SensorId>& sensors_of(std::size_t input) const { return inputs_[input].sensors; }
  /// How far an input's clock is ahead of ours: its times are taken back by that.
  void set_clock_offset(std::size_t input, Duration ahead) { inputs_[input].clock_ahead = ahead; }

  const codec::Receiver& receiver(std::size_t input) const {
    return inputs_[input].stream.decoded();
  }

  /// What can be merged now, if a tick is ready. empty: there is no live input.
  Result<std::optional<CaptureSet>> next_set(TimePoint now);

  /// When next_set() should be tried again though nothing arrives.
  std::optional<TimePoint> due() const { return aligner_.due(); }

  const Trace& trace() const { return trace_; }
  const DropCounter& drops() const { return drops_; }
  void set_drop_listener(DropCounter::Listener listener) {
    drops_.set_listener(std::move(listener));
  }

 private:
  struct Unit {  // waits to be handed on with the capture that it belongs to
    TimePoint captured_at;
    TextureUnit unit;
  };
  struct Input {
    Input(const Scene& scene, std::string name, std::set<SensorId> below)
        : id(std::move(name)), sensors(std::move(below)), stream(scene.lattice, scene.id, id) {}
    std::string id;
    std::set<SensorId> sensors;  // that this input may speak for
    codec::StreamReceiver stream;
    std::optional<DecodedScene> whole;  // newest capture that was complete
    std::vector<Unit> units;
    std::vector<AlphaPlane> alpha, whole_alpha;  // of the newest packet, of `whole`
    std::vector<FrameFeatures> features;         // of the newest packet that had some
    std::map<std::string, TimePoint> marks;
    std::optional<std::uint64_t> taken;  // sequence of `whole`, until a set with it was given
    std::set<StreamId> streams;          // of the newest packet's views
    Duration clock_ahead{};
  };

  std::string link(const Input& input) const { return input.id + " → " + merger_.id; }
  Status check_sender(const Input& input, const Packet& packet) const;
  /// Counts a packet as lost; returns the error with both ends' names.
  Error drop(const Input& from, const Error& why);
  void keep_region(Packet& packet) const;
  void keep_units(Input& input, Packet& packet);
  void settle(std::size_t input, TimePoint now);
  void add(std::size_t input, CaptureSet& out);
  void hand_on_units(std::size_t input, const std::set<StreamId>& given, CaptureSet& out);

  const Scene* scene_;
  MergerConfig merger_;
  bool hand_on_;
  std::vector<Input> inputs_;
  Aligner aligner_;
  std::map<StreamId, std::size_t> stream_from_;  // the input whose units are handed on
  double decode_ms_ = 0;
  Trace trace_;
  DropCounter drops_;
};

}  // namespace mr::node
