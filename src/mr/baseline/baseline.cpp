#include "mr/baseline/baseline.h"

#include <algorithm>

#include "mr/baseline/systems.h"

namespace mr::baseline {

Result<std::unique_ptr<Baseline>> make_baseline(const Scene& scene) {
  if (std::none_of(scene.sensors.begin(), scene.sensors.end(),
                   [](const SensorConfig& sensor) { return sensor.color_camera.has_value(); }))
    return Error{Error::Cause::empty, "scene '" + scene.id + "': no sensor has colour"};
  if (scene.pipeline == "holoportation") return make_holoportation(scene);
  if (scene.pipeline == "holoportation++") return make_holoportation_plus(scene);
  if (scene.pipeline == "points") return make_points(scene);
  if (scene.pipeline == "rgbd") return make_rgbd(scene);
  return Error{Error::Cause::unsupported, "pipeline '" + scene.pipeline + "' is no baseline"};
}

DecodedScene join(Geometry geometry, Texture texture, TimePoint captured_at) {
  DecodedScene scene;
  scene.captured_at = captured_at;
  scene.sources = std::move(geometry.sources);
  // The texture's views say where their pictures lie; what has no picture cannot be shown.
  scene.views = std::move(texture.views);
  scene.chunks = std::move(geometry.chunks);
  scene.textures = std::move(texture.pictures);
  return scene;
}

}  // namespace mr::baseline
