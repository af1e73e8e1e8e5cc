#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "mr/codec/head.h"
#include "mr/core/mesh.h"
#include "mr/core/result.h"
#include "mr/core/trace.h"
#include "mr/kit/part.h"
#include "mr/merge/overlap/free_space_carver.h"
#include "mr/node/calibration_check.h"
#include "mr/node/chunk_publisher.h"
#include "mr/node/input_synchronizer.h"
#include "mr/node/node_clock.h"
#include "mr/node/plans.h"
#include "mr/node/root_atlas.h"
#include "mr/node/side_job.h"
#include "mr/node/still_merger.h"
#include "mr/node/surface_joiner.h"
#include "mr/scene/scene.h"

namespace mr::node {

/// A merging server (paper 3.2, 3.3). Takes packets of sensors or of other mergers, and gives
/// packets of the same form: one surface without overlap, seams closed, every triangle labelled
/// with a view. The root decimates and composes one texture atlas; an inner merger hands its
/// children's texture streams on untouched, so that pictures are coded twice at most however many
/// layers there are. inputs() and merge() may be used by two threads, so that one tick is received
/// while another is merged; answer() by any.
class MergeNode {
 public:
  /// The scene must outlive the node.
  MergeNode(const Scene& scene, const MergerConfig& merger, bool is_root, NodeClock clock = {},
            StillWork still_work = StillWork::at_once);

  /// Chunks of the scene's background model, for the root. Before the first merge().
  void set_background(std::vector<EncodedChunk> chunks) {
    publisher_.add_background(std::move(chunks));
  }

  const std::string& id() const { return merger_.id; }
  const MergerConfig& config() const { return merger_; }

  InputSynchronizer& inputs() { return synchronizer_; }
  const InputSynchronizer& inputs() const { return synchronizer_; }

  /// The bytes of the merged packet. After an Error the inputs should send key frames, as units
  /// that were to be handed on are lost. `halfway` is called when the stages that use every core
  /// are over: on one machine, the inputs' next frames fit in from there.
  Result<std::vector<std::byte>> merge(const CaptureSet& captures,
                                       const std::function<void()>& halfway = {});

  /// Chunks that a receiver asked for; empty when there are none. Wishes for key frames and for a
  /// whole head are noted, what it shows of the still surface, and its plan for the next ticks.
  std::vector<std::byte> answer(const codec::Control& control);
  /// null when it is not live any more. Any thread.
  std::shared_ptr<const EncodedChunk> find(const ChunkKey& key) const {
    return publisher_.find(key);
  }
  /// Streams of which key frames were asked for that the inputs have to give. Forgets them.
  std::vector<StreamId> take_key_frame_wishes();

  /// Inputs whose still surface is shown as their packet with that sequence had it. Forgets them.
  std::vector<std::pair<std::size_t, std::uint64_t>> take_shown();

  /// The newest merged surface, before coding: what moves, then what stays. Nothing before the
  /// first.
  std::optional<Mesh> surface() const;
  /// Whether the last merge found the inputs' geometry unchanged and kept its surface.
  bool reused() const { return reused_; }

  /// Called in merge() of the root, before its pictures are drawn; for measuring.
  using DrawingListener = std::function<void(const RootAtlas::Drawing& drawing)>;
  void set_drawing_listener(DrawingListener listener) { drawing_listener_ = std::move(listener); }

  /// How well the inputs fit, and a line when one does not.
  CalibrationCheck& calibration() { return calibration_; }

  Trace& trace() { return trace_; }
  const Trace& trace() const { return trace_; }

 private:
  /// The merged moving surface, and what it was made from.
  struct Surface {
    std::vector<DecodedScene> scenes;  // one layer, without textures
    Decimation decimation;
    Mesh mesh;  // labelled, on the lattice
    float error_m = 0;
  };
  using Parts = std::vector<kit::Part>;
  using Sequences = std::map<std::size_t, std::uint64_t>;  // by input
  /// Views and sources as merge.refine corrected them.
  struct Places {
    std::vector<View> views;
    std::vector<SourceInfo> sources;
  };

  /// A job's, beside the ticks or within one.
  struct StillMade {
    Result<StillMerger::Made> made;
    std::optional<Sequences> inputs;  // whose still surfaces it shows, where some are new
  };

  Packet head(const CaptureSet& captures, const CodingPlan& plan) const;
  Status merge_surfaces(const CaptureSet& captures, const Decimation& decimation,
                        const std::function<void()>& halfway);
  void correct(const CaptureSet& captures, bool look, Parts& parts);
  void look_at_plates(const CaptureSet& captures, const Parts& moving);
  Status bring_still(std::optional<StillMerger::Inputs> inputs, const Decimation& decimation,
                     const Parts& moving);
  Status show(StillMade still);
  Status merge_moving(std::vector<DecodedScene> scenes, const Parts& parts,
                      const Decimation& decimation, const std::function<void()>& halfway);
  Mesh label_moving(const Mesh& mesh, float error_m) const;
  Status add_textures(const CaptureSet& captures, Packet& packet);
  void add_marks(const CaptureSet& captures, TimePoint started, Packet& packet) const;

  const Scene* scene_;
  MergerConfig merger_;
  bool is_root_;
  NodeClock clock_;
  CurrentPlan plan_;
  InputSynchronizer synchronizer_;
  ChunkPublisher publisher_;
  RootAtlas atlas_;
  codec::HeadWriter writer_;
  CalibrationCheck calibration_;
  Trace trace_;
  SurfaceJoiner joiner_;  ///< of what moves
  StillMerger still_merger_;
  StillWork still_work_;
  std::optional<std::vector<DecodedScene>> still_scenes_;  ///< that it was last given
  Decimation still_decimation_;                            ///< of these
  ShownStill still_;                                       ///< no mesh: there is none yet
  std::optional<Surface> moving_;  ///< reused while the inputs' geometry stays
  merge::FreeSpaceCarver empty_;
  double emptied_m2_ = 0;  ///< since the still surface was last begun
  Sequences taken_;        ///< newest of each input
  Sequences untold_;       ///< whose still surface is merged, but not shown as a whole yet
  Places places_;
  std::atomic<bool> reused_ = false;
  std::mutex wishes_mutex_;
  std::set<StreamId> key_frame_wishes_;
  Sequences shown_;  ///< still surfaces that are shown, and whose inputs were not told
  std::deque<std::pair<std::uint64_t, Sequences>> in_packets_;  ///< own sequence, what it brought
  std::uint64_t sequence_ = 0;
  DrawingListener drawing_listener_;
  SideJob<StillMade> still_job_;  ///< last: it uses what is above
};

}  // namespace mr::node
