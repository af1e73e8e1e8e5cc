#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <stop_token>

#include "mr/core/frame_source.h"

namespace mr::node {

/// Plays recorded or rendered frames as a sensor would take them: by the wall clock, newest only.
/// Endless sources of all processes run in step; others start when they are opened.
class LiveSource {
 public:
  LiveSource(std::unique_ptr<FrameSource> source, double fps);

  /// Takes a frame that is not the newest; returns whether it wants more of them.
  using Watch = std::function<bool(Frame)>;

  /// The newest frame that was not given out yet; waits for the next one where there is none. Of
  /// the frames in between a few go to `watch`, oldest first, as long as it wants them; the others
  /// are skipped. As FrameSource::next(); nothing also when stop is asked for.
  Result<std::optional<Frame>> newest(const std::stop_token& stop, const Watch& watch = {});

  /// Frames that nobody had time for, those watched included.
  std::uint64_t skipped() const { return skipped_; }

 private:
  TimePoint time_of(std::uint64_t index) const;
  std::uint64_t index_at(TimePoint now) const;
  void skip_to(std::uint64_t index, const Watch& watch);

  std::unique_ptr<FrameSource> source_;
  double fps_;
  TimePoint start_;         ///< when its frame 0 is taken
  std::uint64_t next_ = 0;  ///< index of the source's next frame
  std::uint64_t skipped_ = 0;
};

/// Waits until a time by the wall clock; false when stop was asked for before.
bool wait_until(const std::stop_token& stop, TimePoint time);

}  // namespace mr::node
