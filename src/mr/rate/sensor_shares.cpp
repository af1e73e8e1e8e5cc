#include "mr/rate/sensor_shares.h"

#include <algorithm>

namespace mr::rate {

void SensorShares::note(const std::map<SensorId, Triangles>& capture) {
  constexpr int kDecideEvery = 30;  // captures; means are over as many
  constexpr double kWeight = 1.0 / kDecideEvery;
  for (const auto& [id, triangles] : capture) sensors_.try_emplace(id, Sensor{triangles, 0});
  for (auto& [id, sensor] : sensors_) {
    const auto found = capture.find(id);
    const Triangles now = found == capture.end() ? Triangles{} : found->second;
    sensor.mean.delivered += kWeight * (now.delivered - sensor.mean.delivered);
    sensor.mean.shown += kWeight * (now.shown - sensor.mean.shown);
  }
  if (++captures_ % kDecideEvery == 0) decide();
}

/// One step at a time. Who was made coarser needs more to be finer again, so that steps do not go
/// to and fro.
void SensorShares::decide() {
  constexpr double kFewest = 50;            // triangles, else there is nothing to save
  constexpr double kBelow[] = {0.5, 0.25};  // of the best sensor's share: one step, two
  constexpr double kHysteresis = 1.3;
  const auto share = [](const Sensor& s) {
    return s.mean.delivered > kFewest ? s.mean.shown / s.mean.delivered : 1;
  };
  double best = 0;
  for (const auto& [id, sensor] : sensors_)
    if (sensor.mean.delivered > kFewest) best = std::max(best, share(sensor));
  for (auto& [id, sensor] : sensors_) {
    const double relative = best > 0 ? share(sensor) / best : 1;
    const auto step_at = [&](double of) { return (of < kBelow[0]) + (of < kBelow[1]); };
    if (step_at(relative) > sensor.step)
      ++sensor.step;
    else if (step_at(relative / kHysteresis) < sensor.step)
      --sensor.step;
  }
}

double SensorShares::coarser(SensorId sensor) const {
  const auto found = sensors_.find(sensor);
  return found == sensors_.end() ? 1 : kSteps[found->second.step];
}

}  // namespace mr::rate
