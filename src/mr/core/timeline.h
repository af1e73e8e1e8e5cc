#pragma once

#include <cmath>
#include <cstdint>
#include <optional>
#include <string>

#include "mr/core/frame.h"

namespace mr {

/// The clock of a recording. Sources of one domain share a clock: their times can be compared.
struct SourceClock {
  std::string domain;               ///< such as a device's serial number, or "unix"
  TimePoint first{};                ///< captured_at() of the first frame
  std::optional<TimePoint> last{};  ///< of the last frame; nothing: not known without reading all
  friend bool operator==(const SourceClock&, const SourceClock&) = default;
};

/// How a source's own times lie on the scene's clock, whose frame i is captured at i / fps:
/// scene time = own time - start.
struct Timeline {
  double fps = 30;    ///< of the scene
  TimePoint start{};  ///< own time at which the scene begins
  Duration length{};  ///< after which a looping source starts again; 0: at its own end
  friend bool operator==(const Timeline&, const Timeline&) = default;

  /// From the scene's beginning to its frame `index`.
  Duration time_of(std::uint64_t index) const {
    return Duration(std::llround(static_cast<double>(index) * 1e9 / fps));
  }
  Duration period() const { return time_of(1); }
};

}  // namespace mr
