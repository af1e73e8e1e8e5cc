#include "mr/sensor/recorded_frames.h"

#include <fmt/format.h>

#include <cmath>
#include <utility>

namespace mr::sensor {
namespace {

using Capture = RecordingReader::Capture;

/// Captures farther ahead than this are reached by seeking, nearer ones by reading on.
constexpr Duration kSeek = std::chrono::seconds(2);
constexpr Duration kMostGap = std::chrono::minutes(10);  // in a recording

double seconds(Duration d) { return std::chrono::duration<double>(d).count(); }

Duration nanoseconds(double ns) { return Duration(std::llround(ns)); }

/// The largest multiple of `length` that is at most `time`.
Duration round_of(Duration time, Duration length) {
  const auto rounds = time / length - (time % length < Duration{} ? 1 : 0);
  return rounds * length;
}

}  // namespace

void add_recorded_color(Result<ImageRgb> color, const std::filesystem::path& file,
                        const std::string& sensor, Frame& frame) {
  if (color)
    frame.color = *std::move(color);
  else
    frame.color_lost =
        Error{color.error().cause, file.string() + ": colour: " + color.error().message +
                                       " (of sensor '" + sensor + "')"};
}

std::size_t item_at(TimePoint at, std::optional<TimePoint> first, Duration period) {
  const Duration since = at - first.value_or(at) + period / 2;
  return static_cast<std::size_t>(std::max<std::int64_t>(0, since / period));
}

std::size_t captures_of(std::optional<TimePoint> first, std::optional<TimePoint> last,
                        Duration period) {
  constexpr std::int64_t kMostCaptures = 100'000'000;  // five weeks at 30 a second
  MR_ASSERT(period > Duration{});
  if (!first || !last || *last < *first) return 0;
  const std::int64_t captures = (*last - *first + period / 2) / period + 1;
  return captures <= kMostCaptures ? static_cast<std::size_t>(captures) : 0;
}

RecordedFrames::RecordedFrames(std::unique_ptr<RecordingReader> reader, const SensorConfig& sensor,
                               SensorId id, const Timeline& timeline)
    : reader_(std::move(reader)),
      sensor_(sensor),
      id_(id),
      timeline_(timeline),
      loops_(sensor.source.content().loops),
      length_(timeline.length) {
  MR_ASSERT(timeline.fps > 0);
}

Duration RecordedFrames::scene_time(TimePoint own) const {
  const auto ns = static_cast<double>((own - timeline_.start).count());
  return own - timeline_.start +
         nanoseconds(ns * sensor_.clock_drift_ppm * 1e-6 + sensor_.clock_offset_ms * 1e6);
}

TimePoint RecordedFrames::own_time(Duration scene_time) const {
  const Duration since = scene_time - nanoseconds(sensor_.clock_offset_ms * 1e6);
  const auto ns = static_cast<double>(since.count());
  const double drift = sensor_.clock_drift_ppm * 1e-6;
  return timeline_.start + since - nanoseconds(ns * drift / (1 + drift));
}

Result<std::optional<Frame>> RecordedFrames::next() {
  const std::uint64_t index = index_++;
  const Duration tick = timeline_.time_of(index), half = timeline_.period() / 2;
  // A recording whose length is not known begins now, rather than being read for it.
  if (loops_ && length_ == Duration{} && !last_) round_ = tick;
  if (const Status went = go_to_round(tick); !went) return went.error();
  auto found = first_from(own_time(tick - round_ - half));
  if (found && !*found && loops_) found = ended(tick);
  if (!found) return found.error();
  if (!*found) return std::optional<Frame>();
  if (round_ + scene_time((*found)->at) >= tick + half)
    return Error{Error::Cause::empty,
                 fmt::format("sensor '{}': no capture near {:.3f} s (frame {})", sensor_.id,
                             seconds(tick - round_), index)};
  return take(**found, index);
}

/// Starts again where the recording loops and this round is over.
Status RecordedFrames::go_to_round(Duration tick) {
  if (!loops_ || length_ == Duration{}) return {};
  const Duration offset = nanoseconds(sensor_.clock_offset_ms * 1e6);
  const Duration round = round_of(tick - offset + timeline_.period() / 2, length_);
  if (round == round_) return {};
  round_ = round, last_.reset();
  failed_ = false;
  return reader_->seek(own_time(tick - round_));
}

/// The reader's next capture; nothing after an error, which is told once.
Result<std::optional<Capture>> RecordedFrames::peek() {
  if (failed_) return std::optional<Capture>();
  auto capture = reader_->peek();
  failed_ = !capture;
  return capture;
}

/// Whether a time stamp is so late that it must be damaged: waiting for it would hide what follows.
/// The second of two that agree is believed.
bool RecordedFrames::is_astray(TimePoint at) {
  const TimePoint before = last_.value_or(timeline_.start);
  const bool is_late = at - before > kMostGap;
  if (!is_late || (astray_ && at - *astray_ <= kMostGap && *astray_ <= at)) {
    astray_.reset();
    return false;
  }
  astray_ = at;
  return true;
}

/// The first capture at `own` or later.
Result<std::optional<Capture>> RecordedFrames::first_from(TimePoint own) {
  bool sought = false;
  while (true) {
    auto capture = peek();
    if (!capture || !*capture) return capture;
    if (is_astray((*capture)->at)) {
      reader_->drop();
      return Error{Error::Cause::corrupt,
                   fmt::format("sensor '{}': a capture that is stamped {:.0f} s after the one "
                               "before is left out",
                               sensor_.id, seconds((*capture)->at - last_.value_or(own)))};
    }
    last_ = std::max(last_.value_or((*capture)->at), (*capture)->at);  // some stamps are damaged
    if ((*capture)->at >= own) return capture;
    if (!sought && own - *last_ > kSeek) {
      if (const Status went = reader_->seek(own); !went) return went.error();
      sought = true;
    } else {
      reader_->drop();
    }
  }
}

/// The recording's end in a round whose length was not known: goes on with the next round.
Result<std::optional<Capture>> RecordedFrames::ended(Duration tick) {
  if (length_ == Duration{} && last_)
    length_ = std::max(*last_ - timeline_.start, Duration{}) + timeline_.period();
  if (length_ == Duration{}) return std::optional<Capture>();  // it holds nothing
  if (const Status went = go_to_round(tick); !went) return went.error();
  auto found = first_from(own_time(tick - round_ - timeline_.period() / 2));
  if (found && !*found)
    return Error{Error::Cause::empty,
                 fmt::format("sensor '{}': no capture at the end of its recording", sensor_.id)};
  return found;
}

Result<std::optional<Frame>> RecordedFrames::take(const Capture& capture, std::uint64_t index) {
  auto frame = reader_->take();
  if (!frame) return frame.error();
  auto pose = sensor_.pose_of(capture.item, capture.at);
  if (!pose)
    return Error{pose.error().cause, pose.error().message + " (frame " + std::to_string(index) +
                                         " of sensor '" + sensor_.id + "' is lost)"};
  const Duration shift = round_ + scene_time(capture.at) - capture.at.time_since_epoch();
  frame->sensor = id_;
  frame->index = index;
  frame->exposure_start += shift, frame->exposure_end += shift;
  frame->T_world_depth = *pose;
  return std::optional<Frame>(*std::move(frame));
}

}  // namespace mr::sensor
