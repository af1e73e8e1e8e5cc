#pragma once

#include <atomic>
#include <cstdint>
#include <memory>

#include "mr/core/frame_source.h"
#include "mr/node/frame_input.h"
#include "mr/node/node_clock.h"

namespace mr::runtime {

/// Plays recorded or rendered frames in real time, as a live sensor delivers them: newest only.
/// Endless sources are synchronised by the wall clock over all processes; others start when opened.
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
  TimePoint start_;         ///< time of frame 0
  std::uint64_t next_ = 0;  ///< index of the source's next frame
  std::atomic<std::uint64_t> skipped_ = 0;
};

}  // namespace mr::runtime
