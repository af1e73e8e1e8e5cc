#include "mr/node/sources.h"

#include "mr/codec/background_chunks.h"
#include "mr/core/assert.h"
#include "mr/model/background.h"
#include "mr/sensor/source_registry.h"
#include "mr/sensor/timelines.h"
#include "mr/synth/room.h"

namespace mr::node {

std::vector<std::unique_ptr<FrameSource>> open_sources(
    const Scene& scene, std::span<const SensorId> wanted, const std::filesystem::path& cache_folder,
    std::function<void(int done, int of)> rendering) {
  if (scene.rig)
    return synth::open_rig(*scene.rig, scene.sensors, wanted, scene.fps,
                           {cache_folder, std::move(rendering)});
  const std::vector<Timeline> timelines = sensor::timelines(scene.sensors, scene.fps);
  std::vector<std::unique_ptr<FrameSource>> out;
  for (const SensorId id : wanted) {
    const SensorConfig& sensor = scene.sensor(id);
    const sensor::SourceType* type = sensor::find_source_type(sensor.source.type());
    MR_ASSERT(type != nullptr);
    out.push_back(type->open(sensor, id, timelines[index_of(id)]));
  }
  return out;
}

Result<std::vector<EncodedChunk>> open_background(
    const Scene& scene, const std::function<void(const std::string&)>& notice) {
  if (!scene.background) return std::vector<EncodedChunk>{};
  // Colours are per vertex, so the mesh is as fine as the voxels.
  const auto mesh = model::load_background(*scene.background, scene.lattice, scene.voxel_m, notice);
  if (!mesh) return mesh.error();
  auto chunks = codec::encode_background(*mesh, scene.lattice, scene.fusion.chunk_m);
  if (!chunks)
    return Error{chunks.error().cause,
                 scene.background->model.string() + ": " + chunks.error().message};
  return chunks;
}

Result<Scene> prepare_scene(Scene scene) {
  if ((!scene.rig && scene.sensors.empty()) || scene.mergers.empty())
    return Error{Error::Cause::empty, "scene '" + scene.id + "' has no sensors"};
  const auto problems = scene.problems();
  if (!problems.empty())
    return Error{Error::Cause::invalid,
                 "scene '" + scene.id + "': " + problems.front() +
                     (problems.size() == 1
                          ? ""
                          : " (and " + std::to_string(problems.size() - 1) + " more problems)")};
  if (scene.rig && scene.sensors.empty()) scene.sensors = synth::rig_sensors(*scene.rig);
  return scene;
}

}  // namespace mr::node
