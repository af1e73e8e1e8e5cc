#include "mr/core/trace.h"

#include <algorithm>
#include <cmath>

namespace mr {

double percentile(std::vector<double> samples, double p) {
  if (samples.empty()) return 0;
  std::sort(samples.begin(), samples.end());
  const double at = std::clamp(p, 0.0, 1.0) * static_cast<double>(samples.size() - 1);
  const auto low = static_cast<std::size_t>(at);
  const std::size_t high = std::min(low + 1, samples.size() - 1);
  return samples[low] + (at - std::floor(at)) * (samples[high] - samples[low]);
}

}  // namespace mr
