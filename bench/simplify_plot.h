#pragma once

#include <string>

#include "report.h"

namespace mr::bench {

/// Error against time, by contender, for the shares of the report's first input, as SVG: RMS and
/// worst, the larger of both ways.
std::string plot_simplify(const Report& report);

}  // namespace mr::bench
