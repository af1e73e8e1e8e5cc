#include <fmt/format.h>
#include <fmt/ranges.h>

#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "commands.h"
#include "mr/kit/v4l2_camera.h"
#include "mr/sensor/k4a/calibration_check.h"
#include "mr/sensor/k4a/k4a_source.h"

namespace mr::apps {
namespace {

using Json = nlohmann::ordered_json;

struct DevicesOptions {
  std::string depth_mode = "nfov", color = "1080p";
  bool json = false;
};

/// The lines of a scene file for a device; empty where it does not tell its calibration.
std::string scene_lines(const sensor::K4aDeviceInfo& device, std::size_t number,
                        const DevicesOptions& options) {
  if (!device.calibration) return {};
  sensor::K4aSource source;
  source.serial = device.serial;
  source.depth_mode = *sensor::k4a_depth_mode(options.depth_mode);
  source.color = *sensor::k4a_color(options.color);
  while (source.fps > 5 && !source.problems().empty()) source.fps = source.fps == 30 ? 15 : 5;
  const auto lines =
      sensor::k4a_sensor_yaml("cam-" + std::to_string(number), source, *device.calibration);
  return lines ? *lines : "# " + lines.error().message + "\n";
}

Json k4a_json(const Result<std::vector<sensor::K4aDeviceInfo>>& found,
              const DevicesOptions& options) {
  if (!found) return {{"built", false}, {"problem", found.error().message}};
  Json devices = Json::array();
  for (std::size_t i = 0; i < found->size(); ++i) {
    const sensor::K4aDeviceInfo& d = (*found)[i];
    devices.push_back({{"device", i},
                       {"serial", d.serial},
                       {"color_firmware", d.color_firmware},
                       {"depth_firmware", d.depth_firmware},
                       {"sync_in", d.sync_in},
                       {"sync_out", d.sync_out},
                       {"problem", d.problem.empty() ? Json() : Json(d.problem)},
                       {"scene", scene_lines(d, i, options)}});
  }
  return {{"built", true}, {"devices", std::move(devices)}};
}

Json v4l2_json(const std::vector<kit::V4l2Device>& found) {
  Json out = Json::array();
  for (const kit::V4l2Device& d : found)
    out.push_back({{"path", d.path}, {"name", d.name}, {"formats", d.formats}});
  return out;
}

std::string k4a_text(const Result<std::vector<sensor::K4aDeviceInfo>>& found,
                     const DevicesOptions& options) {
  if (!found) return fmt::format("# k4a: {}\n", found.error().message);
  if (found->empty()) return "# k4a: no device is plugged in\n";
  std::string out;
  for (std::size_t i = 0; i < found->size(); ++i) {
    const sensor::K4aDeviceInfo& d = (*found)[i];
    out += fmt::format("# k4a device {}: ", i);
    if (!d.serial.empty())
      out += fmt::format("serial {}, firmware {} (colour) {} (depth), sync in {}, sync out {}\n",
                         d.serial, d.color_firmware, d.depth_firmware,
                         d.sync_in ? "plugged" : "free", d.sync_out ? "plugged" : "free");
    if (!d.problem.empty())
      out += fmt::format("{}{}\n", d.serial.empty() ? "" : "#   ! ", d.problem);
    out += scene_lines(d, i, options);
  }
  return out;
}

std::string v4l2_text(const std::vector<kit::V4l2Device>& found) {
  if (found.empty()) return "# v4l2: no camera in /dev/video*\n";
  std::string out;
  for (const kit::V4l2Device& d : found)
    out += fmt::format("# v4l2 {}: {}; {}\n", d.path, d.name, fmt::join(d.formats, "; "));
  return out;
}

int devices(const DevicesOptions& options) {
  const auto k4a = sensor::find_k4a_devices();
  const auto v4l2 = kit::find_v4l2_cameras();
  if (options.json) {
    const Json all{{"k4a", k4a_json(k4a, options)}, {"v4l2", v4l2_json(v4l2)}};
    fmt::print("{}\n", all.dump(2, ' ', false, Json::error_handler_t::replace));
  } else {
    fmt::print("{}{}", k4a_text(k4a, options), v4l2_text(v4l2));
  }
  return 0;
}

}  // namespace

void add_devices(CLI::App& app, int& exit_code) {
  auto options = std::make_shared<DevicesOptions>();
  CLI::App* command = app.add_subcommand(
      "devices", "List the cameras of this computer, with their lines of a scene file");
  command
      ->add_option("--depth-mode", options->depth_mode, "Of depth cameras: their lines are for it")
      ->check(CLI::IsMember({"nfov", "nfov_binned", "wfov", "wfov_binned"}))
      ->capture_default_str();
  command->add_option("--color", options->color, "The same of their colour cameras")
      ->check(CLI::IsMember({"off", "720p", "1080p", "1440p", "1536p", "2160p", "3072p"}))
      ->capture_default_str();
  command->add_flag("--json", options->json, "Print as JSON");
  command->footer(
      "T_world_depth, where a camera stands, is left to be added to each sensor.\n"
      "Example:\n  meshreduce devices --depth-mode wfov_binned --color 720p");
  command->callback([options, &exit_code] { exit_code = devices(*options); });
}

}  // namespace mr::apps
