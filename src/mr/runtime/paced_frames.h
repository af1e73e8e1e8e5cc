#pragma once

#include <atomic>
#include <cstdint>
#include <memory>

#include "mr/core/frame_source.h"
#include "mr/node/frame_input.h"
#include "mr/node/node_clock.h"

namespace mr::runtime {

/// Plays recorded or rendered frames as a sensor would take them: by the clock, newest only.
/// Endless sources of all processes run in step; others start when they are opened.
class PacedFrames final : public node::FrameInput {
 public:
  PacedFrames(std::unique_ptr<FrameSource> source, double fps, node::Clock clock);

  bool is_ready(TimePoint now) override;
  std::optional<TimePoint> due() const override { return time_of(next_); }
  Result<std::optional<Captured>> next(TimePoint now, const Watch& watch) override;
  std::uint64_t skipped() const override { return skipped_; }

 private:
  Duration period() const { return time_of(1) - time_of(0); }
  TimePoint time_of(std::uint64_t index) const;
  std::uint64_t index_at(TimePoint now) const;
  void skip_to(std::uint64_t index, const Watch& watch);

  std::unique_ptr<FrameSource> source_;
  double fps_;
  node::Clock clock_;
  TimePoint start_;         ///< when its frame 0 is taken
  std::uint64_t next_ = 0;  ///< index of the source's next frame
  std::atomic<std::uint64_t> skipped_ = 0;
};

}  // namespace mr::runtime
