#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "mr/core/image.h"
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
  std::optional<double> ssim;  ///< masked, of what a client shows; where views are compared
};

struct RateRun {
  rate::Trace trace;  ///< of the target
  int seconds = 30;
  std::size_t views = 0;  ///< so many viewpoints are compared with the reference, every second
  /// The pictures of a second, [views]; may be empty.
  std::function<Status(int second, const std::vector<ImageRgb>& pictures)> pictures{};
};

/// Runs a prepared scene in lockstep under its rate control, from the first capture on. Error
/// invalid: the scene's rate.model is fixed.
Result<std::vector<RateSecond>> run_rate(const Scene& scene, const RateRun& run,
                                         const QualityConfig& config);

}  // namespace mr::eval
