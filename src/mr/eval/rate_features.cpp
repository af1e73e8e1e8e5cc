#include "mr/eval/rate_features.h"

#include "mr/rate/feature_space.h"
#include "mr/rate/features.h"

namespace mr::eval {

std::vector<rate::Feature> burst_features(
    const std::vector<std::vector<std::optional<Frame>>>& burst) {
  std::vector<rate::Feature> out{{"sensors", 0}};
  const std::size_t sensors = burst.front().size();
  for (std::size_t s = 0; s < sensors; ++s) {
    rate::FeatureExtractor extractor;
    rate::SceneFeatures last;
    for (const auto& capture : burst)
      if (capture[s]) last = extractor.extract(*capture[s]);
    const std::vector<rate::Feature> of_sensor = rate::named(last);
    if (s == 0) out.insert(out.end(), of_sensor.begin(), of_sensor.end());
    for (std::size_t i = 0; i < of_sensor.size(); ++i)
      out[i + 1].value =
          (s == 0 ? 0 : out[i + 1].value) + of_sensor[i].value / static_cast<double>(sensors);
  }
  out.front().value = static_cast<double>(sensors);
  return out;
}

}  // namespace mr::eval
