#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
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
#include "mr/node/calibration_check.h"
#include "mr/node/chunk_publisher.h"
#include "mr/node/input_synchronizer.h"
#include "mr/node/layers.h"
#include "mr/node/moving_layer.h"
#include "mr/node/node_clock.h"
#include "mr/node/plans.h"
#include "mr/node/rate_control.h"
#include "mr/node/root_atlas.h"
#include "mr/node/still_layer.h"
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

  /// From then on a model chooses plans, for the root. Not null. Before the first merge().
  void control_rate(std::shared_ptr<const rate::Model> model) {
    rate_ = std::make_unique<RateControl>(*scene_, std::move(model));
    writer_.bring_once();
  }
  /// The plan of all nodes that rate control has chosen, if it changed. After a merge().
  std::optional<ScenePlan> take_plan() { return rate_ ? rate_->take_plan() : std::nullopt; }

  const std::string& id() const { return merger_.id; }
  const MergerConfig& config() const { return merger_; }

  InputSynchronizer& inputs() { return synchronizer_; }
  const InputSynchronizer& inputs() const { return synchronizer_; }

  /// The bytes of the merged packet; over_budget: rate control leaves the tick out. After another
  /// Error the inputs should send key frames, as units
  /// that were to be handed on are lost. `on_cores_free` is called when the stages that use every
  /// core are over: on one machine, the inputs' next frames fit in from there.
  Result<std::vector<std::byte>> merge(const CaptureSet& captures,
                                       const std::function<void()>& on_cores_free = {});

  /// Chunks that a receiver asked for; empty when there are none. Wishes for key frames and for a
  /// whole head are noted, what it shows of the still surface, and its plan for the next ticks.
  std::vector<std::byte> answer(const codec::Control& control);
  /// None when it is not live any more. Any thread.
  std::optional<EncodedChunk> find(const ChunkKey& key) const { return publisher_.find(key); }
  /// Streams of which key frames were asked for that the inputs have to give. Forgets them.
  std::vector<StreamId> take_wanted_key_frames();

  /// Inputs whose still surface is shown as their packet with that sequence had it. Forgets them.
  std::vector<std::pair<std::size_t, std::uint64_t>> take_shown() {
    return still_.receipts().take();
  }

  /// The newest merged surface, before coding: what moves, then what stays. Nothing before the
  /// first.
  std::optional<Mesh> surface() const;
  /// Whether the last merge found the inputs' geometry unchanged and kept its surface.
  bool reused() const { return reused_; }

  /// Called in merge() of the root, before its pictures are drawn; for measuring.
  using DrawingListener = std::function<void(const RootAtlas::Drawing& drawing)>;
  void set_drawing_listener(DrawingListener listener) { drawing_listener_ = std::move(listener); }

  RootAtlas& atlas() { return atlas_; }
  const RootAtlas& atlas() const { return atlas_; }
  /// What the root knows about the cameras' colours; empty below it.
  std::vector<CameraColor> colors() const { return atlas_.colors().findings(*scene_); }
  double misplaced_px() const { return atlas_.colors().misplaced_px(); }

  /// How well the inputs fit, and a line when one does not.
  CalibrationCheck& calibration() { return calibration_; }

  Trace& trace() { return trace_; }
  const Trace& trace() const { return trace_; }

 private:
  Packet head(const CaptureSet& captures, const CodingPlan& plan) const;
  Status update_layers(const CaptureSet& captures, const Decimation& decimation,
                       const std::function<void()>& on_cores_free);
  bool correct_poses(const CaptureSet& captures, bool measure, std::vector<kit::Part>& parts);
  void update_plates(const CaptureSet& captures, const std::vector<kit::Part>& moving);
  void add_sources(Packet& packet) const;
  rate::Backlog backlog() const;
  Result<std::vector<std::byte>> send(const CaptureSet& captures, const CodingPlan& plan,
                                      TimePoint started);
  Result<std::optional<RootAtlas::Drawn>> draw(const CaptureSet& captures, const Packet& packet);
  Status code(const CaptureSet& captures, Packet& packet);
  Status code_pictures(const CaptureSet& captures, std::optional<RootAtlas::Drawn> drawn,
                       Packet& packet);
  void add_marks(const CaptureSet& captures, TimePoint started, Packet& packet) const;

  const Scene* scene_;
  MergerConfig merger_;
  bool is_root_;
  NodeClock clock_;
  CurrentPlan plan_;
  Decimation still_decimation_;  ///< as the scene says: plans vary that of the moving surface
  InputSynchronizer synchronizer_;
  CalibrationCheck calibration_;
  CorrectedPoses poses_;  ///< of the newest tick
  Trace trace_;
  ChunkPublisher publisher_;
  RootAtlas atlas_;
  MovingLayer moving_;
  StillLayer still_;
  std::unique_ptr<RateControl> rate_;  ///< null: plans are fixed
  codec::HeadWriter writer_;
  std::atomic<std::uint64_t> sequence_ = 0;
  std::atomic<bool> reused_ = false;
  bool is_moving_new_ = false;  ///< and not published yet
  std::mutex key_frames_mutex_;
  std::set<StreamId> key_frames_wanted_;
  DrawingListener drawing_listener_;
};

}  // namespace mr::node
