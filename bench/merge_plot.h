#pragma once

#include <string>

#include "report.h"

namespace mr::bench {

/// The paper's Fig. 15 as SVG: time and memory against the number of sensors, and the paper's own
/// figures. Of the scale experiment's cases.
std::string plot_merge(const Report& report);

}  // namespace mr::bench
