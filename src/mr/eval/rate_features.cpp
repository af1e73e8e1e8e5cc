#include "mr/eval/rate_features.h"

#include <algorithm>

#include "mr/rate/feature_space.h"
#include "mr/rate/features.h"

namespace mr::eval {

std::vector<rate::Feature> burst_features(
    const Scene& scene, const std::vector<std::vector<std::optional<Frame>>>& burst) {
  std::vector<rate::Feature> out = rate::named({});
  double sensors = 0, with_color = 0;
  for (std::size_t s = 0; s < scene.sensors.size(); ++s) {
    rate::FeatureExtractor extractor(scene.sensors[s].precision);
    std::optional<rate::SceneFeatures> last;
    bool has_color = false;
    for (const auto& capture : burst)
      if (capture[s]) {
        last = extractor.extract(*capture[s]);
        has_color = !capture[s]->color.empty();
      }
    if (!last) continue;
    ++sensors, with_color += has_color;
    const std::vector<rate::Feature> one = rate::named(*last);
    for (std::size_t i = 0; i < out.size(); ++i) out[i].value += one[i].value;
  }
  for (rate::Feature& feature : out)
    feature.value /= std::max(feature.name.starts_with("color") ? with_color : sensors, 1.0);
  out.push_back({"sensors", sensors});
  return out;
}

}  // namespace mr::eval
