#pragma once

#include <vector>

#include "mr/rate/setting.h"
#include "mr/rate/sweep.h"

namespace mr::rate {

/// A setting with what it costs and gives.
struct RatePoint {
  Setting setting;
  double mbps = 0, ssim = 0;
};

/// All settings whose quality was measured.
std::vector<RatePoint> measured_points(const Sweep& sweep);

/// The upper convex hull of quality over bitrate (points that time-sharing between others does not
/// dominate), by rising bitrate.
std::vector<RatePoint> convex_hull(std::vector<RatePoint> points);

/// The quality of a hull at a bitrate, linear between its points; below the first, that of the
/// first, and beyond the last, that of the last. The hull must not be empty.
double hull_ssim(const std::vector<RatePoint>& hull, double mbps);

}  // namespace mr::rate
