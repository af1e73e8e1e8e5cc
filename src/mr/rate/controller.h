#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <vector>

#include "mr/rate/backlog_share.h"
#include "mr/rate/grid.h"
#include "mr/rate/model.h"
#include "mr/rate/observation.h"
#include "mr/rate/room.h"
#include "mr/rate/setting.h"

namespace mr::rate {

/// What the controller decides before a capture is merged.
struct CapturePlan {
  Setting setting;         ///< its QP is not decided yet
  bool key_frame = false;  ///< the live tiles have another scale, and so will be key frames
  bool skipped = false;    ///< the capture is not sent: even the least quality does not fit
  double refinement = 0;   ///< bytes that the still surface and plates may take at least
};

/// What is known of a capture once its mesh is coded and its pictures are drawn.
struct CaptureState {
  double geometry = 0;  ///< bytes: moving chunks and the head
  double backlog = 0;   ///< bytes of it, as it is now
  bool key_frame = false;
};

/// What the controller decides for the rest of the capture.
struct CaptureBudget {
  int qp = 0;                  ///< of the live tiles
  double refinement = 0;       ///< bytes that the still surface and plates may take
  bool is_purse_full = false;  ///< no more is saved for them: a piece that needs more does not fit
};

/// What one capture came to, as sent.
struct CaptureBytes {
  double geometry = 0;  ///< moving chunks and the head
  double texture = 0;   ///< live tiles
  bool key_frame = false;
  double refinement = 0;  ///< still chunks and plates
};

/// The control loop of one stream. In: a target, features, and what every capture really took. Out:
/// a plan for every capture, in two steps: begin() before it is merged, and code() before its
/// pictures are coded. Then follows sent(); after a skipped one, sent({}) alone.
///
/// - A model chooses decimation, texture scale and quantiser for the target: at once when the
///   target changes, else every kDecideEvery captures, and keeps what it has unless the change is
///   worth it, so that pictures do not pump.
/// - Around that, every capture's own quantiser keeps the stream within its budget: over some
///   captures as near to the target as quantisers allow, over every second below kMostInASecond of
///   it, key frames included.
/// - Still surface and plates wait in a backlog. They get what the moving surface leaves, and at
///   least the share of the target that the model gives them, spread over the captures. What they
///   do not take at once, since pictures come in one piece, is kept for them.
/// - Where the coarsest setting does not fit, captures are left out.
///
/// Time is counted in captures; no socket, no thread, no clock.
class Controller {
 public:
  static constexpr double kMostInASecond = 1.08;

  /// `model` must not be null. `target_mbps`: see set_target().
  Controller(std::shared_ptr<const Model> model, bool layers, double fps, double target_mbps);

  /// From the next capture on. Not finite or not positive: the least that can be sent.
  void set_target(double mbps);
  double target_mbps() const { return target_mbps_; }
  /// The lattice in force, as its bits.
  void set_lattice(int bits);
  /// What the quality of what moves weighs (Observation::moving_weight); 0 until then.
  void set_moving_weight(double weight) { observed_.moving_weight = weight; }
  void set_features(std::vector<Feature> features);
  /// How many captures a second there are; above 0. Models go by the scene's nominal rate.
  void set_fps(double fps);
  /// No setting may have a lower error from now on, up to the coarsest: finer meshes would take too
  /// long.
  void set_least_error(double voxels);
  /// No setting may have a higher error: captures are left out before.
  void set_coarsest_error(double voxels);

  /// The plan of the next capture. `backlog`: what waits before it; `extra`: bytes that this one
  /// takes beside what others take.
  CapturePlan begin(const Backlog& backlog, double extra = 0);
  CaptureBudget code(const CaptureState& capture);
  /// The most bytes that are saved for one piece of the backlog.
  double largest_piece() const;
  /// What the capture took; of a skipped one, nothing.
  void sent(const CaptureBytes& bytes);
  /// In place of sent(): nothing came of the capture.
  void give_up();

  /// The setting around which quantisers move.
  const Setting& setting() const { return setting_; }
  /// What the backlog gets of the target, at least; 0: there is none.
  double backlog_share() const { return backlog_share_; }
  /// Whether the target cannot be met: even the coarsest quantiser of the setting in force needs
  /// more, key frames aside.
  bool is_best_effort() const { return is_best_effort_; }

 private:
  double bytes_of(double mbps) const { return mbps * 1e6 / 8 / fps_; }
  double mbps_of(double bytes) const { return bytes * 8e-6 * fps_; }
  double mbps_at(int qp) const;
  bool is_idle(double mbps) const;
  bool has_ample(double mbps) const;
  void note_produced();
  void share_out(const Backlog& waiting);
  void limit_purse();
  void decide(double for_setting_mbps);
  bool has_scene_changed() const;
  int qp_of_rest() const;
  void save_for_backlog(double backlog, double unused);
  bool is_worth_it(const Setting& wanted, double budget_mbps) const;
  double expected_geometry(const Setting& setting) const;
  double expected_texture(const Setting& setting) const;
  void take(const Setting& setting);
  double within_limits(double error_voxels) const;
  void keep_within_limits();
  double texture_at(int qp, bool key_frame) const;
  double allowed() const;
  double for_backlog(double backlog) const;
  double purse_room(double backlog) const;
  double left() const;

  std::shared_ptr<const Model> model_;
  double nominal_fps_, fps_, target_mbps_ = 0;
  Observation observed_;
  Setting setting_ = {};
  bool has_chosen_ = false, target_changed_ = true, is_best_effort_ = false;
  int since_sent_ = 0, since_decision_ = 0, since_change_ = 0;
  int direction_ = 0;        ///< of the last change: 1 finer, -1 coarser
  double first_needed_ = 0;  ///< bytes: of the setting in force, as first measured; 0: not yet
  double backlog_share_ = 0;
  // Of the setting in force, means over the last captures:
  double geometry_ = 0, texture_ = 0, key_ = 0;  ///< bytes of a capture; texture at setting_.qp
  std::uint64_t sent_ = 0;                       ///< captures in all
  int captures_ = 0, textures_ = 0;              ///< in these means; without key frames
  int at_finest_ = 0;                            ///< captures in a row with the finest quantiser
  bool key_frame_needed_ = false;  ///< the scale changed, and no key frame was sent since
  CapturePlan planned_;
  CaptureBudget budget_;
  struct Spent {
    double bytes = 0, share = 0;  ///< of a capture, and what its target gave it
  };
  std::deque<Spent> second_;  ///< the captures of the last second, without the next one
  double credit_ = 0;         ///< bytes that were not used
  double purse_ = 0;          ///< bytes that are kept for the backlog, none of credit_
};

}  // namespace mr::rate
