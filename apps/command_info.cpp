#include <fmt/format.h>

#include <memory>
#include <nlohmann/json.hpp>

#include "commands.h"
#include "mr/synth/room.h"
#include "output.h"

namespace mr::apps {
namespace {

struct InfoOptions {
  std::filesystem::path scene;
  std::vector<std::string> set;
  bool json = false;
};

std::string source_name(const SensorConfig& sensor) {
  return std::holds_alternative<SyntheticSource>(sensor.source) ? "synthetic" : "rgbd-images";
}

/// Number of frames before the source ends or repeats; 0: endless.
std::size_t item_count(const SensorConfig& sensor) {
  const auto* images = std::get_if<RgbdImagesSource>(&sensor.source);
  return images ? images->depth.size() : 0;
}

std::string size_of(const Camera& camera) {
  return fmt::format("{}x{}", camera.width, camera.height);
}

nlohmann::ordered_json as_json(const Scene& scene) {
  nlohmann::ordered_json out{{"scene", scene.id},
                             {"fps", scene.fps},
                             {"voxel_m", scene.voxel_m},
                             {"sensors", nlohmann::ordered_json::array()},
                             {"mergers", nlohmann::ordered_json::array()}};
  for (const SensorConfig& s : scene.sensors) {
    const Vec3d at = s.T_world_depth.front().translation;
    out["sensors"].push_back(
        {{"id", s.id},
         {"source", source_name(s)},
         {"items", item_count(s)},
         {"depth", {s.depth_camera.width, s.depth_camera.height}},
         {"color", s.color_camera
                       ? nlohmann::ordered_json{s.color_camera->width, s.color_camera->height}
                       : nlohmann::ordered_json()},
         {"position_m", {at.x, at.y, at.z}},
         {"moving", s.T_world_depth.size() > 1}});
  }
  for (const MergerConfig& m : scene.mergers)
    out["mergers"].push_back({{"id", m.id}, {"inputs", m.inputs}, {"deadline_ms", m.deadline_ms}});
  return out;
}

std::string as_text(const Scene& scene) {
  std::string out =
      fmt::format("scene {}: {} sensors, {} mergers, {} fps, {} mm voxels\n", scene.id,
                  scene.sensors.size(), scene.mergers.size(), scene.fps, scene.voxel_m * 1000);
  for (const SensorConfig& s : scene.sensors) {
    const Vec3d at = s.T_world_depth.front().translation;
    out += fmt::format(
        "  sensor {:<12} {:<12} {:>4} items  depth {:<9} color {:<9} at ({:.2f}, {:.2f}, {:.2f}) "
        "m{}\n",
        s.id, source_name(s), item_count(s), size_of(s.depth_camera),
        s.color_camera ? size_of(*s.color_camera) : "none", at.x, at.y, at.z,
        s.T_world_depth.size() > 1 ? ", moving" : "");
  }
  for (const MergerConfig& m : scene.mergers)
    out += fmt::format("  merger {:<12} from {}, waits {} ms\n", m.id, fmt::join(m.inputs, " "),
                       m.deadline_ms);
  return out;
}

int info(const InfoOptions& options) {
  auto scene = load_or_tell(options.scene, options.set);
  if (!scene) return 1;
  if (scene->rig) scene->sensors = synth::rig_sensors(*scene->rig);
  fmt::print("{}", options.json ? as_json(*scene).dump(2) + "\n" : as_text(*scene));
  return 0;
}

}  // namespace

void add_info(CLI::App& app, int& exit_code) {
  auto options = std::make_shared<InfoOptions>();
  CLI::App* command = app.add_subcommand("info", "Check a scene file and tell what it holds");
  command->add_option("FILE", options->scene, "Scene file (YAML)")->required();
  add_set_option(*command, options->set);
  command->add_flag("--json", options->json, "Print as JSON");
  command->footer("Example:\n  meshreduce info examples/red-kitchen.yaml");
  command->callback([options, &exit_code] { exit_code = info(*options); });
}

}  // namespace mr::apps
