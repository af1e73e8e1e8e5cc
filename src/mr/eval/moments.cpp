#include "mr/eval/moments.h"

#include <algorithm>
#include <numeric>
#include <variant>

namespace mr::eval {
namespace {

/// How many different captures the sources hold.
int captures_of(const Scene& scene) {
  if (scene.rig) return scene.rig->frames;
  std::size_t most = 1;
  for (const SensorConfig& sensor : scene.sensors)
    if (const auto* images = std::get_if<RgbdImagesSource>(&sensor.source))
      most = std::max(most, images->depth.size());
  return static_cast<int>(most);
}

/// Whether sources start again, so that a burst may be longer than they are.
bool loops(const Scene& scene) {
  if (scene.rig) return scene.rig->loop;
  return std::all_of(scene.sensors.begin(), scene.sensors.end(), [](const SensorConfig& sensor) {
    const auto* images = std::get_if<RgbdImagesSource>(&sensor.source);
    return images && images->loop;
  });
}

}  // namespace

Moments spread_moments(const Scene& scene, int moments, int burst) {
  const int captures = captures_of(scene);
  Moments out;
  out.burst = loops(scene) ? burst : std::min(burst, captures);
  const int last_start = loops(scene) ? captures - 1 : captures - out.burst;
  const int count = std::clamp(captures / out.burst, 1, moments);  // that do not overlap
  for (int i = 0; i < count; ++i)
    out.first.push_back(static_cast<int>(static_cast<long long>(i) * (last_start + 1) / count));
  return out;
}

void Rate::add_burst(const std::vector<double>& bytes) {
  if (bytes.empty()) return;
  ++bursts_;
  first_ += bytes.front();
  if (bytes.size() == 1) {
    following_ += bytes.front();
    return;
  }
  following_ +=
      std::accumulate(bytes.begin() + 1, bytes.end(), 0.0) / static_cast<double>(bytes.size() - 1);
}

double Rate::mbps(double fps) const {
  if (bursts_ == 0) return 0;
  const double a_second = first_ + (fps - 1) * following_;
  return a_second / bursts_ * 8 / 1e6;
}

}  // namespace mr::eval
