#include <optional>
#include <utility>

#include "mr/sensor/folders/text_lines.h"
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

/// A file of one time in seconds a line, the first word of it; one for each item.
void read_times(MapReader& map, RgbdImagesSource& out) {
  const yaml::Node* node = map.find("times");
  if (!node) return;
  const auto list = yaml::read_one_file(map.report, *node, "times");
  if (!list || !list->unusable.empty()) return;
  const auto refuse = [&](const std::string& why) {
    map.report.problem(node->line, "times: " + why);
  };
  const auto text = read_text_file(list->paths.front());
  if (!text) return refuse(text.error().message);
  TextLines lines(*text);
  std::vector<TimePoint> times;
  while (lines.next()) {
    const std::string line =
        list->paths.front().string() + ": line " + std::to_string(lines.number());
    const auto time = time_of_seconds(lines.words().front());
    if (!time) return refuse(line + " must begin with a time in seconds");
    if (!times.empty() && *time <= times.back())
      return refuse(line + " must be later than the one before");
    times.push_back(*time);
  }
  if (times.size() != out.depth.size() && !out.depth.empty())
    return refuse(list->paths.front().string() + " holds " + std::to_string(times.size()) +
                  " times for " + std::to_string(out.depth.size()) +
                  " items; they must be as many");
  out.times = std::move(times);
}

}  // namespace

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

SourceKeys read_rgbd_images(MapReader& map, const std::string& key) {
  RgbdImagesSource images;
  read_files(map, key, images);
  map.number("depth_unit_m", images.depth_unit_m, RgbdImagesSource::kDepthUnit_m);
  read_invalid_counts(map, images.invalid);
  map.flag("loop", images.loop);
  read_times(map, images);
  return {std::move(images), map.has("color")};
}

}  // namespace mr::sensor
