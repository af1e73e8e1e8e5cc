#include "mr/eval/moments.h"

#include <algorithm>
#include <numeric>

namespace mr::eval {
namespace {

/// How many different captures the sources hold.
int captures_of(const Scene& scene) {
  if (scene.rig) return scene.rig->frames;
  std::size_t most = 1;
  for (const SensorConfig& sensor : scene.sensors)
    most = std::max(most, sensor.source.content().items);
  return static_cast<int>(most);
}

/// Whether sources start again, so that a burst may be longer than they are.
bool loops(const Scene& scene) {
  if (scene.rig) return scene.rig->loop;
  return std::all_of(scene.sensors.begin(), scene.sensors.end(),
                     [](const SensorConfig& sensor) { return sensor.source.content().loops; });
}

}  // namespace

int Moments::later() const {
  const int lacking = warm_up - first.front();
  return lacking > 0 && loop > 0 ? (lacking + loop - 1) / loop * loop : 0;
}

bool is_stateful(const Scene& scene) {
  return scene.pipeline == "meshreduce" && scene.still.layers;
}

Moments spread_moments(const Scene& scene, int moments, int burst) {
  const int captures = captures_of(scene);
  Moments out;
  out.loop = loops(scene) ? captures : 0;
  out.burst = out.loop ? burst : std::min(burst, captures);
  const int last_start = out.loop ? captures - 1 : captures - out.burst;
  // Sources that loop have played before: the first moment may be anywhere.
  const int first_start =
      scene.still.layers && !out.loop ? std::min(kWarmUpCaptures, last_start / 2) : 0;
  const int span = last_start + 1 - first_start;
  const int count = std::clamp((captures - first_start) / out.burst, 1, moments);  // no overlap
  for (int i = 0; i < count; ++i)
    out.first.push_back(first_start + static_cast<int>(static_cast<long long>(i) * span / count));
  out.warm_up = out.loop ? kWarmUpCaptures : first_start;
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

void Rate::add_steady(const std::vector<double>& bytes) {
  if (bytes.empty()) return;
  const double mean =
      std::accumulate(bytes.begin(), bytes.end(), 0.0) / static_cast<double>(bytes.size());
  ++bursts_;
  first_ += mean, following_ += mean;
}

double Rate::mbps(double fps) const {
  if (bursts_ == 0) return 0;
  const double a_second = first_ + (fps - 1) * following_;
  return a_second / bursts_ * 8 / 1e6;
}

}  // namespace mr::eval
