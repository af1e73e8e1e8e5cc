#pragma once

#include <deque>
#include <optional>

#include "mr/sensor/realsense/recording.h"

namespace mr::sensor {

/// A depth picture and the colour picture nearest to it in time, if there is one within half a
/// period (of the slower stream).
struct RealSenseCapture {
  RealSensePicture depth;
  std::optional<RealSensePicture> color;
};

/// Gives each depth picture of a recording its colour picture. A colour picture may serve several
/// depth pictures, where these come more often.
class RealSenseCaptures {
 public:
  RealSenseCaptures(RealSenseRecording recording, bool with_color);

  const RealSenseHeader& header() const { return recording_.header(); }
  /// The next capture; nothing at the end. Error: as RealSenseRecording::next(); what was read
  /// before comes first.
  Result<std::optional<RealSenseCapture>> next();
  Status seek(TimePoint at);

 private:
  Status read_ahead();
  bool is_decided() const;
  std::optional<RealSensePicture> nearest_color(TimePoint at);

  RealSenseRecording recording_;
  bool with_color_;
  Duration longest_period_;
  std::deque<RealSensePicture> color_, depth_;
  std::size_t waiting_bytes_ = 0;
  bool ended_ = false;
  std::optional<Error> error_;  ///< after which there is nothing
};

}  // namespace mr::sensor
