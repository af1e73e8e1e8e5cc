#include "mr/node/capture.h"

#include <utility>

#include "mr/fusion/clean_depth.h"
#include "mr/node/sources.h"
#include "mr/sensor/floor.h"

namespace mr::node {

CaptureReader::CaptureReader(const Scene& scene, const std::filesystem::path& cache_folder) {
  const std::vector<SensorId> all = all_sensors(scene.sensors);
  sources_ = open_sources(scene, all, cache_folder);
  for (const SensorId id : all) registrations_.emplace_back(scene.sensor(id), id);
}

std::optional<std::vector<Frame>> CaptureReader::next(
    const std::function<void(SensorId, const Error&)>& dropped) {
  std::vector<Frame> frames;
  bool any = false;
  for (std::size_t i = 0; i < sources_.size(); ++i) {
    auto frame = sources_[i]->next();
    any |= !frame || frame->has_value();
    if (!frame && dropped) dropped(sensor_at(i), frame.error());
    if (frame && *frame) frames.push_back(registrations_[i].undistort(**std::move(frame)));
  }
  return any ? std::optional(std::move(frames)) : std::nullopt;
}

void CaptureReader::skip(std::uint64_t frames) {
  for (const auto& source : sources_) source->skip(frames);
}

ImageDepth prepare_depth(const Scene& scene, const Camera& camera, const Frame& frame,
                         int readings) {
  ImageDepth depth = fusion::clean_depth(frame.depth, camera, scene.sensor(frame.sensor).precision,
                                         scene.fusion.clean, readings);
  if (scene.floor) sensor::remove_floor(depth, camera, frame.T_world_depth, *scene.floor, scene.up);
  return depth;
}

}  // namespace mr::node
