#include "mr/eval/rate_features.h"

#include "mr/rate/feature_space.h"
#include "mr/rate/features.h"

namespace mr::eval {

std::vector<rate::Feature> burst_features(
    const Scene& scene, const std::vector<std::vector<std::optional<Frame>>>& burst) {
  std::vector<rate::SensorFeatures> sensors;
  for (std::size_t s = 0; s < scene.sensors.size(); ++s) {
    rate::FeatureExtractor extractor(scene.sensors[s].precision);
    std::optional<rate::SensorFeatures> last;
    for (const auto& capture : burst)
      if (capture[s]) last = {!capture[s]->color.empty(), extractor.extract(*capture[s])};
    if (last) sensors.push_back(*last);
  }
  return rate::scene_features(sensors);
}

}  // namespace mr::eval
