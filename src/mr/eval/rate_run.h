#pragma once

#include <vector>

#include "mr/core/result.h"
#include "mr/eval/quality.h"
#include "mr/rate/simulation.h"
#include "mr/scene/scene.h"

namespace mr::eval {

/// One second of a scene's stream under rate control.
struct RateSecond {
  double target_mbps = 0, mbps = 0;
  double refinement_mbps = 0;  ///< still surface and plates: part of mbps
  double worst_mbps = 0;       ///< of the seconds that end within this one
  int left_out = 0;            ///< captures
  int key_frames = 0;
  int qp = 0;               ///< of the second's last capture, as all below
  double error_voxels = 0;  ///< of decimating what moves
  double scale = 1;
  std::size_t still_chunks = 0;
};

/// Runs a scene in lockstep under its rate control, as the target follows a trace, from the first
/// capture on. Error invalid: the scene's rate.model is fixed.
Result<std::vector<RateSecond>> run_rate(const Scene& scene, const rate::Trace& trace, int seconds,
                                         const QualityConfig& config);

}  // namespace mr::eval
