#include <optional>
#include <utility>

#include "mr/sensor/rgbd_images.h"
#include "mr/yaml/files.h"

namespace mr::sensor {
namespace {

using yaml::MapReader;

void read_files(MapReader& map, const std::string& key, RgbdImagesSource& out) {
  yaml::Report& report = map.report;
  std::optional<yaml::FileList> depth, color;
  if (const yaml::Node* node = map.need("depth")) depth = yaml::read_files(report, *node, "depth");
  if (const yaml::Node* node = map.find("color")) color = yaml::read_files(report, *node, "color");
  if (depth && color && depth->paths.size() != color->paths.size())
    report.problem(map.line("color"),
                   "color names " + std::to_string(color->paths.size()) + " files and depth " +
                       std::to_string(depth->paths.size()) + "; they must be as many");
  if (depth) yaml::report_unusable(report, *depth, key + ".depth");
  if (color) yaml::report_unusable(report, *color, key + ".color");
  if (color) out.color = std::move(color->paths);
  if (depth) out.depth = std::move(depth->paths);
}

void read_invalid_counts(MapReader& map, std::vector<std::uint16_t>& out) {
  const yaml::Node* node = map.find("invalid");
  if (!node) return;
  const auto add = [&](const yaml::Node& item) {
    const auto value = yaml::read_number(map.report, item, "invalid", {0, 65535});
    if (value && *value != static_cast<std::uint16_t>(*value))
      map.report.problem(item.line, "invalid must be whole numbers");
    if (value) out.push_back(static_cast<std::uint16_t>(*value));
  };
  out.clear();
  if (node->kind == yaml::Node::Kind::list)
    for (const yaml::Node& item : node->items) add(item);
  else
    add(*node);
}

}  // namespace

SourceKeys read_rgbd_images(MapReader& map, const std::string& key) {
  RgbdImagesSource images;
  read_files(map, key, images);
  map.number("depth_unit_m", images.depth_unit_m, RgbdImagesSource::kDepthUnit_m);
  read_invalid_counts(map, images.invalid);
  map.flag("loop", images.loop);
  return {std::move(images), map.has("color")};
}

}  // namespace mr::sensor
