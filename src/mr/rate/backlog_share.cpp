#include "mr/rate/backlog_share.h"

#include <algorithm>

#include "mr/rate/swept_surface.h"

namespace mr::rate {
namespace {

constexpr double kStep = 0.05;
constexpr double kStaleLoss = 0.3;  // of SSIM, were all captures left out

/// Quality with a rate. Below the least one, captures are left out.
double quality(std::span<const RatePoint> points, double mbps) {
  const RatePoint best = best_within(points, mbps);
  return best.ssim - (best.mbps > mbps ? kStaleLoss * (1 - mbps / best.mbps) : 0);
}

}  // namespace

double share_until_sent(std::span<const RatePoint> points, double mbps, double lacking) {
  const double all = quality(points, mbps);
  double best = kLeastBacklogShare, least = 0;
  for (double share = kLeastBacklogShare; share < kMostBacklogShare + kStep / 2; share += kStep) {
    const double lost = (all - quality(points, (1 - share) * mbps) + lacking) / share;
    if (share == kLeastBacklogShare || lost < least) best = share, least = lost;
  }
  return best;
}

}  // namespace mr::rate
