#pragma once

#include <deque>
#include <optional>

#include "mr/sensor/azure_kinect/recording.h"

namespace mr::sensor {

/// Pictures of one device that belong together; one of them may be missing.
struct KinectCapture {
  std::optional<KinectBlock> color, depth;

  /// Device time: of depth, without it of colour.
  TimePoint at() const { return depth ? depth->at : color->at; }
};

/// Groups the blocks of a recording into captures, as the SDK does: each track is shifted by the
/// sync delay, the earliest block begins a capture, and the other track's belongs to it if it
/// begins less than half a period later. Infrared and IMU are left out.
class KinectCaptures {
 public:
  explicit KinectCaptures(KinectRecording recording);

  const KinectHeader& header() const { return recording_.header(); }
  /// The next capture; nothing at the end. Error: as KinectRecording::next(); what was read before
  /// comes first.
  Result<std::optional<KinectCapture>> next();
  Status seek(TimePoint at);

 private:
  using Queue = std::deque<KinectBlock>;

  Status read_ahead();
  TimePoint shifted(KinectTrack track, TimePoint at) const;

  KinectRecording recording_;
  Queue color_, depth_;
  std::optional<TimePoint> newest_;  ///< shifted time of the newest block that was read
  bool ended_ = false;
  std::optional<Error> error_;  ///< after which there is nothing
};

}  // namespace mr::sensor
