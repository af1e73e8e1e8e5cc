#pragma once

#include <vector>

#include "mr/rate/rate_distortion.h"

namespace mr::rate {

/// So many rates, spaced evenly on a logarithmic axis.
std::vector<double> log_spaced(double low, double high, int count);

/// Rates from the hull's lowest to that at which it has 99 % of its range of quality.
std::vector<double> targets_of(const std::vector<RatePoint>& hull, int count);

}  // namespace mr::rate
