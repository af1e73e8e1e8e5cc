#pragma once

#include <atomic>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "mr/node/clock_offset.h"
#include "mr/node/merge_node.h"
#include "mr/node/presence.h"
#include "mr/node/rungs.h"
#include "mr/node/task.h"
#include "mr/rate/grid.h"
#include "mr/rate/link_budget.h"

namespace mr::node {

/// The task of a merging server: receives its inputs' packets, requests missing data, monitors the
/// presence and the clocks of its inputs, and merges captures of one tick into one packet. First
/// half: synchronising captures; second half: merging them.
class MergeTask final : public Task {
 public:
  struct Options {
    NodeClock clock = {};
    StillWork still_work = StillWork::at_once;
    std::vector<EncodedChunk> background = {};           ///< chunks of the scene's background model
    std::shared_ptr<const rate::Model> rate_model = {};  ///< of the root; null: plans are fixed
    /// Links from the inputs are measured by times of arrival; else there are none to measure.
    bool measures_links = false;
    /// From then on, inputs that have never delivered are reported missing.
    std::optional<TimePoint> inputs_since = {};
  };
  /// The scene must outlive the task.
  MergeTask(const Scene& scene, const MergerConfig& merger, NodeLog log, Options options);

  const std::string& id() const override { return node_.id(); }
  std::vector<std::string> inputs() const override { return node_.config().inputs; }
  std::vector<Ask> step(const Arrivals& arrivals, TimePoint now) override;
  Bytes answer(const codec::Control& request, TimePoint now) override;
  bool is_ready(TimePoint now) override { return node_.inputs().ready(now); }
  std::optional<TimePoint> due() const override { return node_.inputs().due(); }
  std::unique_ptr<Work> begin(TimePoint now) override;
  std::vector<Ask> taken(const Work& work) const override;
  std::optional<Bytes> finish(Work& work, const std::function<void()>& first_part_done) override;
  std::vector<std::string> rungs() const override {
    return rungs_ ? rungs_->names() : std::vector<std::string>();
  }
  Bytes answer_rung(std::size_t rung, const codec::Control& request, TimePoint now) override;
  std::vector<std::pair<std::size_t, Bytes>> finish_rungs(Work& work, TimePoint now) override;
  NodeStats stats(TimePoint now) const override;

  MergeNode& node() { return node_; }
  const MergeNode& node() const { return node_; }

 private:
  struct Tick;
  void take_answer(const Arrivals::Answer& answer);
  void pass_plan(TimePoint now, std::vector<Ask>& asks);
  void watch_inputs(Duration busy, TimePoint now);
  void pass_on(const ScenePlan& plan);
  void watch_link(std::size_t input, std::size_t bytes, TimePoint now);
  ScenePlan limited(ScenePlan plan) const;

  bool is_root_;
  MergeNode node_;
  NodeLog log_;
  mutable std::mutex watch_mutex_;  ///< guards the next two
  Presence presence_;
  std::vector<ClockOffset> clocks_;  ///< [inputs]
  std::optional<TimePoint> clocks_asked_, plan_passed_;
  std::mutex plan_mutex_;
  std::optional<ScenePlan> plan_;    ///< received, or chosen; passed on to the inputs
  std::optional<ScenePlan> passed_;  ///< as it was: coarser where links are narrow
  bool measures_links_;
  double coarsest_m_;                    ///< error of decimation, see rate::coarsest_error_m()
  std::vector<rate::LinkBudget> links_;  ///< [inputs]
  std::unique_ptr<Rungs> rungs_;         ///< null: one stream
  Clock now_;                            ///< null in virtual time
  Duration took_{};                      ///< the newest finish()
  std::atomic<std::uint64_t> retimed_ = 0;
  std::atomic<bool> key_frames_wanted_ = false;  ///< a tick failed: units to forward were lost
  DropCounter drops_;
};

}  // namespace mr::node
