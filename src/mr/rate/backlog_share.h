#pragma once

#include <span>

#include "mr/rate/rate_distortion.h"

namespace mr::rate {

inline constexpr double kUsualBacklogShare = 0.35;
inline constexpr double kLeastBacklogShare = 0.1, kMostBacklogShare = 0.65;

/// The share of a rate that a backlog gets, so that as little quality as possible is lost until all
/// of it is sent. Now the picture lacks `lacking` (of SSIM), and with a share s the moving surface
/// and the live tiles lose `loss(s)`: what their settings `points` (not empty) lose with the rest
/// of the rate. The best share is that of least (loss(s) + lacking) / s, whatever comes later: so
/// says the Hamilton-Jacobi-Bellman equation of min over s(t) of the integral of loss(s) +
/// lacking(b), where the backlog b falls by s mbps.
double share_until_sent(std::span<const RatePoint> points, double mbps, double lacking);

}  // namespace mr::rate
