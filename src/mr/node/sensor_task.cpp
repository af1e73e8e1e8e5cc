#include "mr/node/sensor_task.h"

#include <utility>

#include "mr/core/frame_source.h"
#include "mr/node/clock_offset.h"

namespace mr::node {

struct SensorTask::Surface final : Work {
  explicit Surface(SensorNode::Reconstructed of) : made(std::move(of)) {}
  SensorNode::Reconstructed made;
};

SensorTask::SensorTask(const Scene& scene, SensorId sensor, std::unique_ptr<FrameInput> input,
                       NodeLog log, NodeClock clock, StillWork still_work)
    : node_(scene, sensor, std::move(clock), still_work),
      input_(std::move(input)),
      log_(std::move(log)) {
  drops_.set_listener(log_.dropped);
}

Task::Bytes SensorTask::answer(const codec::Control& request, TimePoint) {
  return node_.answer(request);
}

std::unique_ptr<Task::Work> SensorTask::begin(TimePoint now) {
  auto captured = input_->next(now, [this](Frame frame) { return node_.watch(std::move(frame)); });
  if (!captured) {
    if (!is_gap(captured.error())) drops_.count(id(), captured.error());
    return nullptr;
  }
  if (!*captured) {
    ended_ = true;
    log_.info("its recording ended");
    return nullptr;
  }
  auto& [frame, read_at] = **captured;
  if (frame.color_lost) drops_.count(id(), *frame.color_lost);
  newest_ns_ = read_at.time_since_epoch().count();
  correct_stamp(frame, read_at);
  auto surface = node_.reconstruct(std::move(frame));
  if (!surface) {
    drops_.count(id(), surface.error());
    return nullptr;
  }
  log_events(*surface);
  return std::make_unique<Surface>(*std::move(surface));
}

void SensorTask::log_events(const SensorNode::Reconstructed& surface) {
  const bool is_empty = node_.is_empty(surface);
  if (is_empty) drops_.count(id(), node_.no_surface(surface.frame), !was_empty_);
  was_empty_ = is_empty;
  if (surface.still.began_anew) log_.warn(node_.pushed(surface.frame));
}

/// Corrects the timestamps of a sensor whose clock is wrong: mergers would drop its captures as too
/// old.
void SensorTask::correct_stamp(Frame& frame, TimePoint read_at) {
  const Duration before = stamp_shift_;
  stamp_shift_ = stamps_.shift(frame.exposure_end, read_at);
  if (stamp_shift_ != before)
    log_.warn(stamp_shift_ == Duration{}
                  ? "its captures are stamped by the right time again"
                  : "its captures are stamped " + clock_offset_text(-stamp_shift_) +
                        " this computer's clock; corrected. Synchronise the clocks (PTP, NTP), or "
                        "set clock_offset_ms");
  if (stamp_shift_ == Duration{}) return;
  frame.exposure_start += stamp_shift_;
  frame.exposure_end += stamp_shift_;
  ++restamped_;
}

std::optional<Task::Bytes> SensorTask::finish(Work& work, const std::function<void()>&) {
  auto bytes = node_.code(static_cast<Surface&>(work).made);
  if (bytes) return *std::move(bytes);
  drops_.count(id(), bytes.error());
  return std::nullopt;
}

NodeStats SensorTask::stats(TimePoint now) const {
  constexpr Duration kSilent = std::chrono::seconds(3);
  NodeStats out{.id = id(), .drops = drops_.by_cause(), .stages_ms = node_.trace().stages()};
  out.is_silent = now - TimePoint(Duration(newest_ns_)) > kSilent;
  if (restamped_ > 0) out.drops[id() + ": captures stamped by a wrong clock"] = restamped_;
  if (const auto skipped = input_->skipped(); skipped > 0)
    out.drops[id() + ": raw frames that it had no time for"] = skipped;
  return out;
}

}  // namespace mr::node
