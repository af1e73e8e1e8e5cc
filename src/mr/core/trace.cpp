#include "mr/core/trace.h"

#include <algorithm>
#include <cmath>
#include <ctime>

namespace mr {

double process_cpu_ms() {
  timespec now{};
  ::clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) * 1e3 + static_cast<double>(now.tv_nsec) * 1e-6;
}

void Trace::add(const std::string& stage, double ms) {
  const std::lock_guard lock(mutex_);
  Ring& ring = stages_[stage];
  if (ring.ms.size() < kKept) return ring.ms.push_back(ms);
  ring.ms[ring.next] = ms;
  ring.next = (ring.next + 1) % kKept;
}

std::map<std::string, std::vector<double>> Trace::stages() const {
  const std::lock_guard lock(mutex_);
  std::map<std::string, std::vector<double>> out;
  for (const auto& [stage, ring] : stages_) {
    std::vector<double>& ms = out[stage] = ring.ms;
    std::rotate(ms.begin(), ms.begin() + static_cast<std::ptrdiff_t>(ring.next), ms.end());
  }
  return out;
}

double percentile(std::vector<double> samples, double p) {
  if (samples.empty()) return 0;
  std::sort(samples.begin(), samples.end());
  const double at = std::clamp(p, 0.0, 1.0) * static_cast<double>(samples.size() - 1);
  const auto low = static_cast<std::size_t>(at);
  const std::size_t high = std::min(low + 1, samples.size() - 1);
  return samples[low] + (at - std::floor(at)) * (samples[high] - samples[low]);
}

}  // namespace mr
