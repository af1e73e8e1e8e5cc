#include "mr/sensor/lidar_360/source.h"

#include <utility>

namespace mr::sensor {
namespace {

class Lidar360 final : public FrameSource {
 public:
  Lidar360(std::unique_ptr<FrameSource> lidar, const PanoramaConfig& color, Duration round)
      : lidar_(std::move(lidar)), panorama_(color), round_(round) {}

  Result<std::optional<Frame>> next() override {
    auto frame = lidar_->next();
    if (!frame || !*frame) return frame;
    auto color = panorama_.at(time_of((*frame)->captured_at()));
    if (color)
      (*frame)->color = *std::move(color);
    else
      (*frame)->color_lost = color.error();
    return frame;
  }

  void skip(std::uint64_t frames) override { lidar_->skip(frames); }
  bool endless() const override { return lidar_->endless(); }
  bool is_live() const override { return lidar_->is_live(); }

 private:
  /// The camera's time. It begins with every round of a LiDAR recording; where rounds are not
  /// known, and live, with the first frame.
  Duration time_of(TimePoint at) {
    if (round_ > Duration{}) return at.time_since_epoch() % round_;
    if ((lidar_->is_live() || lidar_->endless()) && !began_) began_ = at;
    return at - began_.value_or(TimePoint{});
  }

  std::unique_ptr<FrameSource> lidar_;
  Panorama panorama_;
  const Duration round_;  ///< 0: not known, or there is only one
  std::optional<TimePoint> began_;
};

/// The LiDAR alone: without colour.
SensorConfig lidar_of(const SensorConfig& sensor, const Lidar360Source& source) {
  SensorConfig out = sensor;
  out.source = source.lidar;
  out.color_camera.reset();
  return out;
}

/// The keys of the LiDAR's own source; nothing where a problem was reported.
std::optional<SourceKeys> read_lidar(yaml::MapReader& map, const std::string& key) {
  const yaml::Node* node = map.need("lidar");
  if (!node) return std::nullopt;
  yaml::MapReader lidar(map.report, *node, "lidar");
  std::string name;
  const bool named = lidar.need("type") && lidar.text("type", name);
  const SourceType* type = named ? find_source_type(name) : nullptr;
  if (type && name != Lidar360Source::kType) return type->read(lidar, key + ".lidar");
  lidar.accept_all();
  if (named)
    map.report.problem(lidar.line("type"), "source type " + in_quotes(name) +
                                               " is no LiDAR; use ouster-pcap, ouster or "
                                               "rgbd-images");
  return std::nullopt;
}

}  // namespace

std::vector<std::string> Lidar360Source::problems() const {
  std::vector<std::string> out = prefixed("lidar: ", lidar.problems());
  append(out, prefixed("color.", color.problems()));
  return out;
}

std::vector<std::filesystem::path> Lidar360Source::files() const {
  std::vector<std::filesystem::path> out = lidar.files();
  if (!color.video.empty()) out.push_back(color.video);
  out.insert(out.end(), color.pictures.begin(), color.pictures.end());
  return out;
}

std::unique_ptr<FrameSource> open_lidar_360(const SensorConfig& sensor, SensorId id,
                                            const Timeline& timeline) {
  const auto* source = sensor.source.get_if<Lidar360Source>();
  MR_ASSERT(source != nullptr);
  const SourceType* type = find_source_type(source->lidar.type());
  MR_ASSERT(type != nullptr);
  return std::make_unique<Lidar360>(type->open(lidar_of(sensor, *source), id, timeline),
                                    source->color,
                                    source->content().loops ? timeline.length : Duration{});
}

SourceKeys read_lidar_360(yaml::MapReader& map, const std::string& key) {
  Lidar360Source source;
  SourceKeys keys{.config = {}, .has_color = true};
  auto lidar = read_lidar(map, key);
  if (!lidar)
    keys.cameras.emplace();
  else if (lidar->cameras)
    keys.cameras = *lidar->cameras;
  if (lidar) source.lidar = std::move(lidar->config);
  const yaml::Node* node = map.need("color");
  auto color = node ? read_panorama(map.report, *node, key + ".color") : std::nullopt;
  if (color) {
    source.color = *std::move(color);
    const auto start = panorama_start(source.color);
    if (!start) map.report.problem(map.line("color"), start.error().message);
    if (start) keys.T_picture_color = start->T_picture_camera;
    if (start && keys.cameras)
      keys.cameras->color = start->camera, keys.cameras->T_color_depth = {};
  }
  keys.config = std::move(source);
  return keys;
}

}  // namespace mr::sensor
