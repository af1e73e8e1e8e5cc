#pragma once

#include <atomic>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "mr/node/frame_input.h"
#include "mr/node/sensor_node.h"
#include "mr/node/stamp_check.h"
#include "mr/node/task.h"

namespace mr::node {

/// The task of a sensor: takes captures, corrects their timestamps, and makes a packet of each.
/// First half: reconstruction; second half: encoding.
class SensorTask final : public Task {
 public:
  /// The scene must outlive the task.
  SensorTask(const Scene& scene, SensorId sensor, std::unique_ptr<FrameInput> input, NodeLog log,
             NodeClock clock = {}, StillWork still_work = StillWork::at_once);

  const std::string& id() const override { return node_.id(); }
  std::vector<Ask> step(const Arrivals&, TimePoint) override { return {}; }
  Bytes answer(const codec::Control& request, TimePoint now) override;
  bool is_ready(TimePoint now) override { return !ended_ && input_->is_ready(now); }
  std::optional<TimePoint> due() const override { return ended_ ? std::nullopt : input_->due(); }
  std::unique_ptr<Work> begin(TimePoint now) override;
  std::optional<Bytes> finish(Work& work, const std::function<void()>& first_part_done) override;
  bool has_ended() const override { return ended_; }
  void wake_by(std::function<void()> wake) override { input_->wake_by(std::move(wake)); }
  NodeStats stats(TimePoint now) const override;

  SensorNode& node() { return node_; }
  const SensorNode& node() const { return node_; }
  const Trace& trace() const { return node_.trace(); }

 private:
  struct Surface;
  void correct_stamp(Frame& frame, TimePoint read_at);
  void log_events(const SensorNode::Reconstructed& surface);

  SensorNode node_;
  std::unique_ptr<FrameInput> input_;
  NodeLog log_;
  StampCheck stamps_;
  Duration stamp_shift_{};
  bool was_empty_ = false;  ///< an empty volume is reported once
  std::atomic<bool> ended_ = false;
  std::atomic<std::int64_t> newest_ns_ = 0;  ///< time at which the newest capture was read; 0: none
  std::atomic<std::uint64_t> restamped_ = 0;
  DropCounter drops_;
};

}  // namespace mr::node
