#include "mr/sensor/realsense/source.h"

#include <algorithm>
#include <utility>

#include "mr/sensor/realsense/captures.h"
#include "mr/sensor/recorded_frames.h"
#include "mr/sensor/rgbd_items.h"
#include "mr/yaml/files.h"

namespace mr::sensor {
namespace {

/// Opens the recording when the first capture is asked for, so that a missing file is reported as
/// any other loss.
class RealSenseReader final : public RecordingReader {
 public:
  explicit RealSenseReader(const SensorConfig& sensor)
      : sensor_(sensor), source_(*sensor.source.get_if<RealSenseBagSource>()) {}

  Result<std::optional<Capture>> peek() override {
    if (const Status ready = look_ahead(); !ready) return ready.error();
    if (!waiting_) return std::optional<Capture>();
    const RealSenseHeader& header = captures_->header();
    const TimePoint at = waiting_->depth.at;
    return std::optional(Capture{at, item_at(at, header.first, header.period)});
  }

  Result<Frame> take() override {
    MR_ASSERT(waiting_.has_value());
    const RealSenseCapture capture = *std::exchange(waiting_, std::nullopt);
    const auto lost = [&](const Error& error) {
      return Error{error.cause, source_.file.string() + ": depth: " + error.message +
                                    " (a frame of sensor '" + sensor_.id + "' is lost)"};
    };
    if (!source_.depth_unit_m && capture.depth.unit_m > 0) use_unit(capture.depth.unit_m);
    auto depth = decode_realsense_depth(capture.depth, table_);
    if (!depth) return lost(depth.error());
    if (const Status fits =
            check_size(depth->width, depth->height, sensor_.depth_camera, "depth", "a picture");
        !fits)
      return lost(fits.error());
    Frame frame;
    frame.depth = *std::move(depth);
    frame.exposure_start = frame.exposure_end = capture.depth.at;
    if (has_color()) add_recorded_color(color_of(capture), source_.file, sensor_.id, frame);
    return frame;
  }

  void drop() override { waiting_.reset(); }

  Status seek(TimePoint time) override {
    if (!captures_) return {};
    waiting_.reset();
    return captures_->seek(time);
  }

 private:
  bool has_color() const { return captures_->header().color && sensor_.color_camera; }

  Result<ImageRgb> color_of(const RealSenseCapture& capture) const {
    if (!capture.color) return Error{Error::Cause::not_found, "no picture near depth's"};
    auto color = decode_realsense_color(*capture.color);
    if (!color) return color;
    const Status fits =
        check_size(color->width, color->height, *sensor_.color_camera, "colour", "a picture");
    if (!fits) return fits.error();
    return color;
  }

  Status look_ahead() {
    if (!captures_)
      if (const Status opened = open(); !opened) return opened;
    if (waiting_) return {};
    auto next = captures_->next();
    if (!next) return next.error();
    waiting_ = *std::move(next);
    return {};
  }

  Status open() {
    auto recording = RealSenseRecording::open(source_.file);
    if (!recording) return recording.error();
    const RealSenseHeader& header = recording->header();
    if (!header.depth)
      return Error{Error::Cause::unsupported, source_.file.string() + ": it has no depth stream"};
    const auto fits = [&](const RealSensePictures& of, const Camera& camera, const char* which) {
      return check_size(of.width, of.height, camera, which, source_.file.string());
    };
    if (const Status good = fits(*header.depth, sensor_.depth_camera, "depth"); !good) return good;
    if (header.color && sensor_.color_camera)
      if (const Status good = fits(*header.color, *sensor_.color_camera, "colour"); !good)
        return good;
    use_unit(source_.depth_unit_m.value_or(header.depth_unit_m));
    captures_.emplace(*std::move(recording), sensor_.color_camera.has_value());
    return {};
  }

  /// The unit may be changed while the camera records.
  void use_unit(double unit_m) {
    if (unit_m == table_unit_m_) return;
    table_unit_m_ = unit_m;
    table_ = depth_table(sensor_, unit_m, {});
  }

  const SensorConfig sensor_;
  const RealSenseBagSource source_;
  std::optional<RealSenseCaptures> captures_;
  double table_unit_m_ = 0;
  std::vector<float> table_;  ///< metres by count, of this unit
  std::optional<RealSenseCapture> waiting_;
};

/// The clock of a recording. Pictures that are stamped by the computer that recorded them can be
/// compared with others of it.
SourceClock clock_of(const RealSenseHeader& header, const std::filesystem::path& file) {
  SourceClock out;
  const std::string stamped = header.depth ? header.depth->clock : "";
  const bool is_shared = stamped == "Global Time" || stamped == "System Time";
  const std::string device = header.serial.empty() ? file.string() : header.serial;
  out.domain = is_shared ? "realsense computer" : "realsense " + device;
  out.first = header.first.value_or(TimePoint{});
  out.last = header.last;
  return out;
}

/// What the recording says, into the source and the sensor's cameras.
Status read_recording(RealSenseBagSource& source, SourceKeys& keys) {
  const auto recording = RealSenseRecording::open(source.file);
  if (!recording) return recording.error();
  const RealSenseHeader& header = recording->header();
  source.recorded = clock_of(header, source.file);
  source.captures = captures_of(header.first, header.last, header.period);
  keys.has_color = header.color.has_value();
  auto cameras = realsense_cameras(header, source.file);
  if (cameras) {
    keys.cameras = *std::move(cameras);
    return {};
  }
  if (!header.depth) return cameras.error();
  RealSenseHeader without = header;
  without.color.reset();
  keys.no_camera = cameras.error().message;
  keys.cameras.reset();
  if (auto depth = realsense_cameras(without, source.file)) keys.cameras = *std::move(depth);
  if (keys.cameras) keys.cameras->T_color_depth = header.T_color_depth;
  return {};
}

}  // namespace

std::vector<std::string> RealSenseBagSource::problems() const {
  if (!depth_unit_m) return {};
  return out_of_range({{"depth_unit_m", *depth_unit_m, kDepthUnit_m}});
}

std::unique_ptr<FrameSource> open_realsense_bag(const SensorConfig& sensor, SensorId id,
                                                const Timeline& timeline) {
  MR_ASSERT(sensor.source.get_if<RealSenseBagSource>() != nullptr);
  return std::make_unique<RecordedFrames>(std::make_unique<RealSenseReader>(sensor), sensor, id,
                                          timeline);
}

SourceKeys read_realsense_bag(yaml::MapReader& map, const std::string&) {
  RealSenseBagSource source;
  SourceKeys keys;
  keys.cameras.emplace();
  double unit_m = 0;
  if (map.number("depth_unit_m", unit_m, RealSenseBagSource::kDepthUnit_m))
    source.depth_unit_m = unit_m;
  map.flag("loop", source.loop);
  const yaml::Node* const node = map.need("file");
  const auto list = node ? yaml::read_one_file(map.report, *node, "file") : std::nullopt;
  if (list) source.file = list->paths.front();
  if (list && list->unusable.empty())
    if (const Status read = read_recording(source, keys); !read)
      map.report.problem(map.line("file"), read.error().message);
  keys.config = std::move(source);
  return keys;
}

}  // namespace mr::sensor
