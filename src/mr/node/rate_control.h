#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <deque>
#include <memory>
#include <optional>
#include <vector>

#include "mr/core/coding_plan.h"
#include "mr/core/packet.h"
#include "mr/node/allowance.h"
#include "mr/node/input_synchronizer.h"
#include "mr/rate/controller.h"
#include "mr/rate/model.h"
#include "mr/rate/sensor_shares.h"
#include "mr/rate/time_budget.h"
#include "mr/scene/scene.h"

namespace mr::node {

/// Rate control of the root (paper 4; docs/rate-control.md): leads a rate::Controller through its
/// ticks. Each tick begin(), code() and sent(), or give_up(); a tick that is left out, begin()
/// alone. On one thread, but for set_target().
class RateControl {
 public:
  /// `model` must not be null. The scene must outlive this.
  RateControl(const Scene& scene, std::shared_ptr<const rate::Model> model);

  /// The rate wanted from the next tick on, at most the scene's rate.target_mbps. Any thread.
  void set_target(double mbps) { target_mbps_ = mbps; }

  /// Before a tick is merged: puts decimation and texture scale into the root's plan. `waiting`:
  /// still surface and plates; `whole_head`: the packet's head will contain a base. False: the tick
  /// is not to be sent.
  bool begin(const CaptureSet& captures, const rate::Backlog& waiting, bool whole_head,
             CodingPlan& root);
  /// What plates may take in this tick; `may_refine`: no still surface waits.
  PlateLimits plate_limits(bool may_refine) const;

  struct Budget {
    int texture_qp = 0;
    Allowance refinement;  ///< still surface and plates
  };
  /// Once the moving surface is coded, which takes `moving_bytes`, and the pictures are drawn.
  Budget code(double moving_bytes, double waiting, bool key_frame);
  /// The tick's packet, which takes `bytes`.
  void sent(const Packet& packet, std::size_t bytes);
  /// In place of sent(): nothing came of the tick.
  void give_up() { controller_.give_up(); }
  /// What came of the inputs' surfaces: the moving surface as shown.
  void note_surface(const CaptureSet& captures, const Mesh& moving);
  /// How long the nodes took for the tick: this one, mergers below and the coding of sensors by
  /// their marks.
  void note_time(const CaptureSet& captures, Duration own);

  /// The plan of all nodes, if it is another than when this was last asked.
  std::optional<ScenePlan> take_plan();

 private:
  /// What the tick's head is expected to take.
  double head_bytes() const {
    return is_whole_head_ ? std::max(whole_head_bytes_, head_bytes_) : head_bytes_;
  }
  void note_pace(TimePoint tick);
  void note_features(const std::vector<FrameFeatures>& frames);

  const Scene* scene_;
  rate::Controller controller_;
  std::atomic<double> target_mbps_;
  rate::CapturePlan planned_;
  std::deque<TimePoint> ticks_;  ///< of about the last second
  // Of the newest head without a base and with one, less what names new still surface.
  double head_bytes_ = 0, whole_head_bytes_ = 0;
  bool is_whole_head_ = false;  ///< of this tick's packet
  rate::TimeBudget time_;
  rate::SensorShares shares_;
  std::optional<ScenePlan> passed_;  ///< that was taken last
};

}  // namespace mr::node
