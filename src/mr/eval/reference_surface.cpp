#include "mr/eval/reference_surface.h"

#include <fmt/format.h>

#include <map>
#include <optional>
#include <string>
#include <utility>

#include "mr/eval/read_mesh.h"
#include "mr/eval/reference.h"
#include "mr/eval/sensor_coverage.h"
#include "mr/node/capture.h"
#include "mr/synth/rig_errors.h"
#include "mr/synth/truth.h"
#include "mr/yaml/files.h"

namespace mr::eval {
namespace {

/// "truth/%06d.ply" with a number, beside the scene file; nothing where it is no such pattern.
std::optional<std::filesystem::path> truth_file(const Scene& scene, int number) {
  const auto pattern = yaml::parse_pattern(scene.truth->mesh);
  if (!pattern) return std::nullopt;
  return scene.file.parent_path() / pattern->name(number);
}

}  // namespace

Error no_such_capture(const Scene& scene, int capture) {
  return {Error::Cause::empty,
          fmt::format("frame {} of scene '{}' did not come through", capture, scene.id)};
}

bool has_true_surface(const Scene& scene) { return known_rig(scene) || scene.truth; }

TrueSurfaces::TrueSurfaces(const Scene& scene) : scene_(scene) {}
TrueSurfaces::~TrueSurfaces() = default;

Result<Mesh> TrueSurfaces::at(int capture) {
  const int item = truth_frame(scene_, capture);
  if (const RigConfig* rig = known_rig(scene_)) {
    if (!truth_) truth_ = std::make_unique<synth::Truth>(*rig, scene_.fps);
    return truth_->surface(static_cast<std::uint64_t>(item)).mesh;
  }
  const auto file = truth_file(scene_, item);
  if (!file)
    return Error{Error::Cause::invalid, "truth.mesh must hold " + std::string(yaml::kPatternRule) +
                                            ", not '" + scene_.truth->mesh + "'"};
  return read_ply(*file);
}

Result<Mesh> true_surface(const Scene& scene, int capture) {
  return TrueSurfaces(scene).at(capture);
}

Result<std::vector<Frame>> read_capture(const Scene& scene, int capture,
                                        const std::filesystem::path& rig_cache,
                                        const std::function<void(const std::string&)>& dropped) {
  node::CaptureReader reader(scene, rig_cache);
  reader.skip(static_cast<std::uint64_t>(capture));
  auto frames = reader.next([&](SensorId, const Error& error) { dropped(error.message); });
  if (!frames || frames->empty()) return no_such_capture(scene, capture);
  return *std::move(frames);
}

std::vector<SensorFrustum> delivered_frustums(const Scene& scene, std::span<const Frame> capture,
                                              bool exact) {
  std::map<std::string, Pose> poses;
  if (const RigConfig* rig = exact ? known_rig(scene) : nullptr)
    for (const SensorConfig& sensor : synth::exact_sensors(*rig))
      poses[sensor.id] = sensor.T_world_depth.front();
  std::vector<SensorFrustum> out;
  for (const Frame& frame : capture) {
    const SensorConfig& sensor = scene.sensor(frame.sensor);
    const auto known = poses.find(sensor.id);
    out.push_back({undistorted_whole(sensor.depth_camera),
                   known != poses.end() ? known->second : frame.T_world_depth, sensor.depth_near_m,
                   sensor.depth_far_m});
  }
  return out;
}

Mesh shown_surface(const DecodedScene& decoded) {
  Mesh out;
  for (const auto& chunk : decoded.chunks) append(out, chunk->mesh);
  return out;
}

}  // namespace mr::eval
