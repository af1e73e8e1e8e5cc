#include <sys/resource.h>
#include <unistd.h>

#include <utility>

#include "mr/core/parallel.h"
#include "mr/node/live_node.h"

namespace mr::node {

LiveSensor::LiveSensor(const LiveContext& context, std::uint32_t sensor,
                       std::unique_ptr<FrameSource> source)
    : context_(context),
      node_(*context.scene, sensor, NodeClock::live(), StillWork::beside),
      source_(std::move(source), context.scene->fps),
      credit_(context.frames_ahead) {
  drops_.set_listener([this](const std::string& place, const Error& error) {
    context_.warn(node_.id(), place + ": " + error.message);
  });
  service_ = context_.transport->serve(
      node_.id(), [this](std::span<const std::byte> question) { return answer(question); });
  reconstructs_ = std::jthread([this](const std::stop_token& stop) { reconstruct_frames(stop); });
  codes_ = std::jthread([this](const std::stop_token& stop) { code_frames(stop); });
}

namespace {

/// On one machine, what is furthest on its way goes first: merging before the next frame.
void give_way(const LiveContext& context) {
  constexpr int kNice = 5;
  if (context.frames_ahead == 1) ::setpriority(PRIO_PROCESS, static_cast<id_t>(::gettid()), kNice);
}

std::string said_of_stamps(Duration shift) {
  if (shift == Duration{}) return "its captures are stamped by the right time again";
  return "its captures are stamped " + said_of_clock(-shift) +
         " this computer's clock; corrected. Synchronise the clocks (PTP, NTP), or set "
         "clock_offset_ms";
}

}  // namespace

void LiveSensor::reconstruct_frames(const std::stop_token& stop) {
  give_way(context_);
  Arena arena(context_.threads);
  bool was_empty = false;  // an empty volume is news once
  const auto watch = [&](Frame frame) {
    bool more = false;
    arena.run([&] { more = node_.watch(std::move(frame)); });
    return more;
  };
  while (credit_.begin(stop)) {
    auto frame = source_.newest(stop, watch);
    skipped_ = source_.skipped();
    if (stop.stop_requested()) return;
    if (frame && *frame) newest_ns_ = wall_time().time_since_epoch().count();
    if (frame && !*frame) {
      ++*context_.ended;
      return context_.tell(node_.id(), "its recording ended");
    }
    std::optional<SensorNode::Reconstructed> surface;
    Error error = frame ? Error{} : frame.error();
    if (frame) correct_stamp(**frame);
    if (frame)
      arena.run([&] {
        auto made = node_.reconstruct(**std::move(frame));
        made ? void(surface = *std::move(made)) : void(error = made.error());
      });
    if (!surface) {
      drops_.count(node_.id(), error);
      credit_.end(false);
      continue;
    }
    const bool is_empty = node_.is_empty(*surface);
    if (is_empty && !std::exchange(was_empty, true))
      context_.warn(node_.id(), node_.no_surface(surface->frame).message);
    was_empty = is_empty;
    if (surface->began_anew) context_.warn(node_.id(), node_.pushed(surface->frame));
    if (!reconstructed_.put(stop, *std::move(surface))) return;
  }
}

/// A sensor whose clock is off would be left out, as if its captures were old.
void LiveSensor::correct_stamp(Frame& frame) {
  const Duration before = stamp_shift_;
  stamp_shift_ = stamps_.shift(frame.exposure_end, wall_time());
  if (stamp_shift_ != before) context_.warn(node_.id(), said_of_stamps(stamp_shift_));
  if (stamp_shift_ == Duration{}) return;
  frame.exposure_start += stamp_shift_;
  frame.exposure_end += stamp_shift_;
  ++restamped_;
}

void LiveSensor::code_frames(const std::stop_token& stop) {
  give_way(context_);
  Arena arena(context_.threads);
  while (auto surface = reconstructed_.take(stop)) {
    Result<std::vector<std::byte>> bytes = std::vector<std::byte>{};
    arena.run([&] { bytes = node_.code(*surface); });
    if (bytes) {
      ++frames_;
      bytes_ += bytes->size();
      credit_.end(true);
      context_.transport->publish(
          node_.id(), std::make_shared<const std::vector<std::byte>>(*std::move(bytes)));
    } else {
      credit_.end(false);
      drops_.count(node_.id(), bytes.error());
    }
  }
}

net::Message LiveSensor::answer(std::span<const std::byte> question) {
  return answer_request(question, node_, credit_, limits_, drops_);
}

LiveStats LiveSensor::stats() const {
  constexpr Duration kSilent = std::chrono::seconds(3);
  LiveStats out{node_.id(), frames_, drops_.by_cause(), node_.trace().stages(), bytes_};
  out.is_silent = wall_time() - TimePoint(Duration(newest_ns_)) > kSilent;
  if (const auto refused = limits_.refused(); refused > 0)
    out.drops["requests to " + node_.id() + ": too soon after others"] = refused;
  if (restamped_ > 0) out.drops[node_.id() + ": captures stamped by a wrong clock"] = restamped_;
  if (skipped_ > 0) out.drops[node_.id() + ": raw frames that it had no time for"] = skipped_;
  return out;
}

}  // namespace mr::node
