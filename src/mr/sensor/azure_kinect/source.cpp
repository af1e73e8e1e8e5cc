#include "mr/sensor/azure_kinect/source.h"

#include <algorithm>
#include <utility>

#include "mr/sensor/azure_kinect/captures.h"
#include "mr/sensor/recorded_frames.h"
#include "mr/sensor/rgbd_items.h"
#include "mr/yaml/files.h"

namespace mr::sensor {
namespace {

constexpr double kDepthUnit_m = 0.001;

/// Opens the recording when the first capture is asked for, so that a missing file is reported as
/// any other loss.
class KinectReader final : public RecordingReader {
 public:
  explicit KinectReader(const SensorConfig& sensor)
      : sensor_(sensor), source_(*sensor.source.get_if<KinectMkvSource>()) {}

  Result<std::optional<Capture>> peek() override {
    if (const Status ready = look_ahead(); !ready) return ready.error();
    if (!waiting_) return std::optional<Capture>();
    const TimePoint at = waiting_->at() - captures_->header().subordinate_delay;
    return std::optional(Capture{at, item_at(at, first(), captures_->header().period)});
  }

  Result<Frame> take() override {
    MR_ASSERT(waiting_.has_value());
    const KinectCapture capture = *std::exchange(waiting_, std::nullopt);
    const auto lost = [&](const std::string& why) {
      return Error{Error::Cause::corrupt, source_.file.string() + ": " + why +
                                              " (a frame of sensor '" + sensor_.id + "' is lost)"};
    };
    if (!capture.depth) return lost("a capture without depth");
    auto depth = decode_counts(capture.depth->bytes, *captures_->header().depth, table_);
    if (!depth) return lost("depth: " + depth.error().message);
    Frame frame;
    frame.depth = *std::move(depth);
    frame.exposure_start = frame.exposure_end =
        capture.at() - captures_->header().subordinate_delay;
    if (captures_->header().color && sensor_.color_camera)
      add_recorded_color(color_of(capture), source_.file, sensor_.id, frame);
    return frame;
  }

  void drop() override { waiting_.reset(); }

  Status seek(TimePoint time) override {
    if (!captures_) return {};
    waiting_.reset();
    return captures_->seek(time + captures_->header().subordinate_delay);
  }

 private:
  Result<ImageRgb> color_of(const KinectCapture& capture) const {
    if (!capture.color) return Error{Error::Cause::not_found, "a capture without it"};
    return decode_kinect_color(capture.color->bytes, *captures_->header().color);
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
    auto recording = KinectRecording::open(source_.file);
    if (!recording) return recording.error();
    const KinectHeader& header = recording->header();
    if (!header.depth)
      return Error{Error::Cause::unsupported, source_.file.string() + ": it has no depth track"};
    const auto fits = [&](const KinectPictures& pictures, const Camera& camera, const char* which) {
      return check_size(pictures.width, pictures.height, camera, which, source_.file.string());
    };
    if (const Status good = fits(*header.depth, sensor_.depth_camera, "depth"); !good) return good;
    if (header.color && sensor_.color_camera)
      if (const Status good = fits(*header.color, *sensor_.color_camera, "colour"); !good)
        return good;
    table_ = depth_table(sensor_, kDepthUnit_m, {});
    captures_.emplace(*std::move(recording));
    return {};
  }

  /// By the clock of the cable.
  std::optional<TimePoint> first() const {
    const KinectHeader& header = captures_->header();
    if (!header.first) return std::nullopt;
    return *header.first - header.subordinate_delay;
  }

  const SensorConfig sensor_;
  const KinectMkvSource source_;
  std::optional<KinectCaptures> captures_;
  std::vector<float> table_;  ///< metres by count
  std::optional<KinectCapture> waiting_;
};

/// The clock of a recording: devices on one sync cable share a clock.
SourceClock clock_of(const KinectHeader& header, const std::filesystem::path& file) {
  SourceClock clock;
  const bool alone = header.sync == KinectHeader::Sync::standalone;
  const std::string device = header.serial.empty() ? file.string() : header.serial;
  clock.domain = alone ? "azure-kinect " + device : "azure-kinect cable";
  clock.first = header.first.value_or(TimePoint{}) - header.subordinate_delay;
  if (header.last) clock.last = *header.last - header.subordinate_delay;
  return clock;
}

/// What the recording says, into the source and the sensor's cameras.
Status read_recording(KinectMkvSource& source, SourceKeys& keys) {
  const auto recording = KinectRecording::open(source.file);
  if (!recording) return recording.error();
  const KinectHeader& header = recording->header();
  source.recorded = clock_of(header, source.file);
  source.captures = captures_of(header.first, header.last, header.period);
  keys.has_color = header.color.has_value();
  auto cameras = kinect_cameras(header, source.file, source.calibration);
  if (cameras) {
    keys.cameras = *std::move(cameras);
    return {};
  }
  if (!header.depth) return cameras.error();
  KinectHeader without = header;
  without.color.reset();
  keys.no_camera = cameras.error().message;
  keys.cameras.reset();
  if (auto depth = kinect_cameras(without, source.file, source.calibration))
    keys.cameras = *std::move(depth);
  return {};
}

}  // namespace

std::vector<std::filesystem::path> KinectMkvSource::files() const {
  if (calibration.empty()) return {file};
  return {file, calibration};
}

std::unique_ptr<FrameSource> open_kinect_mkv(const SensorConfig& sensor, SensorId id,
                                             const Timeline& timeline) {
  MR_ASSERT(sensor.source.get_if<KinectMkvSource>() != nullptr);
  return std::make_unique<RecordedFrames>(std::make_unique<KinectReader>(sensor), sensor, id,
                                          timeline);
}

SourceKeys read_kinect_mkv(yaml::MapReader& map, const std::string&) {
  KinectMkvSource source;
  SourceKeys keys;
  keys.cameras.emplace();
  const auto file_at = [&](const yaml::Node* node, const char* name, std::filesystem::path& out) {
    const auto list = node ? yaml::read_one_file(map.report, *node, name) : std::nullopt;
    if (list) out = list->paths.front();
    return list && list->unusable.empty();
  };
  bool good = file_at(map.need("file"), "file", source.file);
  if (const yaml::Node* node = map.find("calibration"))
    good &= file_at(node, "calibration", source.calibration);
  map.flag("loop", source.loop);
  if (good)
    if (const Status read = read_recording(source, keys); !read)
      map.report.problem(map.line("file"), read.error().message);
  keys.config = std::move(source);
  return keys;
}

}  // namespace mr::sensor
