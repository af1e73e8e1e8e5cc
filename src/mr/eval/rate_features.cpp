#include "mr/eval/rate_features.h"

#include <cstdint>
#include <optional>

#include "mr/codec/control.h"
#include "mr/node/sensor_node.h"
#include "mr/rate/feature_space.h"
#include "mr/rate/features.h"

namespace mr::eval {
namespace {

using runtime::LockstepScene;

/// A sensor's node that sees a burst, and is told that all it sends is shown, as by a merger.
class SensorOfBurst {
 public:
  SensorOfBurst(const Scene& scene, std::size_t index)
      : node_(scene, all_sensors(scene.sensors)[index]), index_(index) {}

  /// The features of the last frame; nothing where there is none. `known`: of the room before the
  /// first one.
  Result<std::optional<rate::SensorFeatures>> see(
      std::span<const LockstepScene::Capture> burst,
      const std::optional<node::SensorLayers::Memory>& known) {
    if (known) node_.recall(*known);
    std::optional<rate::SensorFeatures> out;
    for (const LockstepScene::Capture& capture : burst) {
      if (!capture[index_]) continue;
      const auto surface = node_.reconstruct(*capture[index_]);
      if (!surface) return surface.error();
      if (const auto packet = node_.code(*surface); !packet) return packet.error();
      codec::Control control;
      control.shown = sent_++;
      node_.answer(control);
      const FrameFeatures& found = *surface->features;
      if (const auto values = rate::features_of(found.values)) out = {found.has_color, *values};
    }
    return out;
  }

 private:
  node::SensorNode node_;
  std::size_t index_;
  std::uint64_t sent_ = 0;
};

}  // namespace

Result<std::vector<rate::Feature>> burst_features(const Scene& scene,
                                                  std::span<const LockstepScene::Capture> burst,
                                                  const LockstepScene::Memory& memory) {
  Scene controlled = scene;  // only then do sensors look for features
  controlled.rate.model = RateConfig::Model::ours;
  std::vector<rate::SensorFeatures> sensors;
  for (std::size_t s = 0; s < scene.sensors.size(); ++s) {
    SensorOfBurst sensor(controlled, s);
    // The first time, the still surface is sent that is there the second time.
    if (memory.sensors[s])
      if (const auto seen = sensor.see(burst, memory.sensors[s]); !seen) return seen.error();
    const auto features = sensor.see(burst, memory.sensors[s]);
    if (!features) return features.error();
    if (*features) sensors.push_back(**features);
  }
  return rate::scene_features(sensors);
}

}  // namespace mr::eval
