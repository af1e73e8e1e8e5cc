#include "mr/eval/rate_features.h"

#include "mr/rate/features.h"

namespace mr::eval {

std::vector<rate::Feature> burst_features(
    const std::vector<std::vector<std::optional<Frame>>>& burst) {
  rate::SceneFeatures sum;
  double sensors = 0;
  const auto& before = burst[burst.size() < 2 ? 0 : burst.size() - 2];
  for (std::size_t s = 0; s < before.size(); ++s) {
    if (!before[s] || !burst.back()[s]) continue;
    const auto one = rate::scene_features(rate::feature_planes(*before[s]),
                                          rate::feature_planes(*burst.back()[s]));
    sum.color_spatial += one.color_spatial, sum.color_temporal += one.color_temporal;
    sum.depth_spatial += one.depth_spatial, sum.depth_temporal += one.depth_temporal;
    ++sensors;
  }
  const double n = sensors > 0 ? sensors : 1;
  return {{"sensors", sensors},
          {"color_spatial", sum.color_spatial / n},
          {"color_temporal", sum.color_temporal / n},
          {"depth_spatial", sum.depth_spatial / n},
          {"depth_temporal", sum.depth_temporal / n}};
}

}  // namespace mr::eval
