#include "mr/sensor/ouster/source.h"

#include <algorithm>
#include <cmath>

#include "mr/kit/device_clock.h"
#include "mr/sensor/ouster/recording.h"
#include "mr/sensor/ouster/udp_socket.h"
#include "mr/sensor/recorded_frames.h"
#include "mr/yaml/files.h"

namespace mr::sensor {
namespace {

constexpr double kNear_m = 0.3, kFar_m = 30;  // unless the scene says otherwise
constexpr Precision kLidar{.base_m = 0.015, .per_m2 = 0};
constexpr Duration kPatience = std::chrono::seconds(1);

/// A scan's pictures as a frame with the sensor's own times.
Frame frame_of(const LidarScan& scan, RangeCamera& camera, GreySource texture,
               const SensorConfig& sensor) {
  RangeCamera::Picture picture =
      camera.picture(scan, sensor.color_camera ? texture : GreySource::none);
  Frame frame;
  frame.depth = std::move(picture.depth), frame.color = std::move(picture.color);
  for (float& depth : frame.depth.data)
    if (depth < sensor.depth_near_m || depth > sensor.depth_far_m) depth = 0;
  const ScanTime time = time_of(scan);
  frame.exposure_start = time.start, frame.exposure_end = time.end;
  return frame;
}

class OusterReader final : public RecordingReader {
 public:
  explicit OusterReader(const SensorConfig& sensor)
      : sensor_(sensor), source_(*sensor.source.get_if<OusterPcapSource>()) {}

  Result<std::optional<Capture>> peek() override {
    if (const Status ready = look_ahead(); !ready) return ready.error();
    if (!waiting_) return std::optional<Capture>();
    return std::optional(Capture{time_of(*waiting_).middle(), item_});
  }

  Result<Frame> take() override {
    MR_ASSERT(waiting_.has_value());
    Frame frame = frame_of(*waiting_, *camera_, source_.texture, sensor_);
    drop();
    return frame;
  }

  void drop() override {
    waiting_.reset();
    ++item_;
  }

  /// Captures have no index: later scans are reached by reading on.
  Status seek(TimePoint time) override {
    if (!recording_ || (waiting_ && time_of(*waiting_).middle() <= time)) return {};
    return open();
  }

 private:
  Status look_ahead() {
    if (!recording_)
      if (const Status opened = open(); !opened) return opened;
    if (waiting_) return {};
    auto next = recording_->next();
    if (!next) return next.error();
    waiting_ = *std::move(next);
    return {};
  }

  Status open() {
    const auto metadata = read_ouster_metadata(source_.metadata);
    if (!metadata) return metadata.error();
    auto opened = OusterRecording::open(source_.file, *metadata, source_.sender);
    if (!opened) return opened.error();
    if (!camera_) camera_.emplace(*metadata);
    recording_.emplace(*std::move(opened));
    waiting_.reset();
    item_ = 0;
    return {};
  }

  const SensorConfig sensor_;
  const OusterPcapSource source_;
  std::optional<OusterRecording> recording_;
  std::optional<RangeCamera> camera_;
  std::optional<LidarScan> waiting_;
  std::size_t item_ = 0;  ///< of waiting_, or of the next scan
};

class OusterLive final : public FrameSource {
 public:
  explicit OusterLive(const SensorConfig& sensor, SensorId id)
      : sensor_(sensor), source_(*sensor.source.get_if<OusterLiveSource>()), id_(id) {}

  Result<std::optional<Frame>> next() override {
    if (const Status ready = open(); !ready) return ready.error();
    const auto until = std::chrono::steady_clock::now() + kPatience;
    while (true) {
      const auto left = until - std::chrono::steady_clock::now();
      const auto datagram = left > Duration{} ? socket_->receive(left) : std::optional<Datagram>();
      if (!datagram) return datagram.error();
      if (!*datagram)
        return Error{Error::Cause::io, "sensor '" + sensor_.id + "': no turn on UDP port " +
                                           std::to_string(source_.port) +
                                           " for a second; does the sensor send to this computer?"};
      const auto scan = assembler_->accept((*datagram)->payload, (*datagram)->from.address);
      if (!scan || scan->valid_columns() == 0) continue;
      Frame frame = frame_of(*scan, *camera_, source_.texture, sensor_);
      to_system_time(frame, (*datagram)->captured_at);
      const auto pose = sensor_.pose_of(0, frame.captured_at());
      if (!pose) return pose.error();
      frame.sensor = id_, frame.index = index_++;
      frame.T_world_depth = *pose;
      return std::optional(std::move(frame));
    }
  }

  void skip(std::uint64_t) override {}  // what it sees next is the newest
  bool endless() const override { return true; }
  bool is_live() const override { return true; }

 private:
  /// From the sensor's clock to this computer's, by when the turn's last packet arrived.
  void to_system_time(Frame& frame, TimePoint arrived) {
    const Duration shift = clock_.system_time(frame.exposure_end.time_since_epoch(), arrived) -
                           frame.exposure_end +
                           Duration(std::llround(sensor_.clock_offset_ms * 1e6));
    frame.exposure_start += shift, frame.exposure_end += shift;
  }

  Status open() {
    if (socket_) return {};
    const auto metadata = read_ouster_metadata(source_.metadata);
    if (!metadata) return metadata.error();
    const auto sender = sender_address(source_.sender);
    if (!sender) return sender.error();
    auto socket = UdpSocket::bind(
        {.address = source_.address, .port = static_cast<std::uint16_t>(source_.port)});
    if (!socket) return socket.error();
    camera_.emplace(*metadata);
    assembler_.emplace(*metadata, *sender);
    socket_.emplace(*std::move(socket));
    return {};
  }

  const SensorConfig sensor_;
  const OusterLiveSource source_;
  const SensorId id_;
  std::optional<UdpSocket> socket_;
  std::optional<ScanAssembler> assembler_;
  std::optional<RangeCamera> camera_;
  kit::DeviceClock clock_;
  std::uint64_t index_ = 0;
};

/// The sensor's clock; the last turn's middle lies half a turn before the end of a capture.
SourceClock clock_of(const OusterMetadata& metadata, const LidarScan& first,
                     std::optional<Duration> length) {
  SourceClock out;
  out.domain = "ouster " + metadata.serial;
  out.first = time_of(first).middle();
  const Duration turn(std::llround(1e9 / metadata.rate_hz));
  if (length) out.last = out.first + std::max(*length - turn, Duration{});
  return out;
}

/// How long a capture lasts, by the times at which datagrams arrived; nothing for captures that
/// take long to read.
std::optional<Duration> length_of(const std::filesystem::path& file) {
  constexpr std::uintmax_t kMostBytes = std::uintmax_t{256} << 20;
  std::error_code failed;
  if (std::filesystem::file_size(file, failed) > kMostBytes || failed) return std::nullopt;
  auto reader = PcapReader::open(file);
  if (!reader) return std::nullopt;
  std::optional<TimePoint> first, last;
  for (auto datagram = reader->next(); datagram && *datagram; datagram = reader->next()) {
    if (!first) first = (*datagram)->captured_at;
    last = (*datagram)->captured_at;
  }
  if (!first || *last < *first) return std::nullopt;
  return *last - *first;
}

/// The file that a key names; false where a problem was reported.
bool read_file_key(yaml::MapReader& map, const char* name, std::filesystem::path& out) {
  const yaml::Node* node = map.need(name);
  const auto list = node ? yaml::read_one_file(map.report, *node, name) : std::nullopt;
  if (list) out = list->paths.front();
  return list && list->unusable.empty();
}

/// The keys of both types. False where a problem was reported.
template <typename Source>
bool read_common_keys(yaml::MapReader& map, Source& source) {
  const bool good = read_file_key(map, "metadata", source.metadata);
  map.choice<GreySource>("texture", source.texture,
                         {{"near_ir", GreySource::near_ir},
                          {"reflectivity", GreySource::reflectivity},
                          {"none", GreySource::none}});
  if (map.text("sender", source.sender))
    if (const auto address = sender_address(source.sender); !address) {
      map.report.problem(map.line("sender"), "sender: " + address.error().message);
      return false;
    }
  return good;
}

SourceCameras cameras_of(const OusterMetadata& metadata, GreySource texture) {
  const RangeCamera camera(metadata);
  SourceCameras out;
  out.depth = camera.depth_camera();
  if (texture != GreySource::none) out.color = camera.color_camera();
  out.depth_near_m = kNear_m, out.depth_far_m = kFar_m;
  out.precision = kLidar;
  return out;
}

/// The metadata that `source` names; nothing where a problem was reported.
std::optional<OusterMetadata> metadata_of(yaml::MapReader& map, const std::filesystem::path& file) {
  auto metadata = read_ouster_metadata(file);
  if (metadata) return *std::move(metadata);
  map.report.problem(map.line("metadata"), metadata.error().message);
  return std::nullopt;
}

}  // namespace

std::vector<std::string> OusterLiveSource::problems() const {
  return out_of_range({{"port", static_cast<double>(port), kPort}});
}

std::unique_ptr<FrameSource> open_ouster_pcap(const SensorConfig& sensor, SensorId id,
                                              const Timeline& timeline) {
  MR_ASSERT(sensor.source.get_if<OusterPcapSource>() != nullptr);
  return std::make_unique<RecordedFrames>(std::make_unique<OusterReader>(sensor), sensor, id,
                                          timeline);
}

std::unique_ptr<FrameSource> open_ouster_live(const SensorConfig& sensor, SensorId id,
                                              const Timeline&) {
  MR_ASSERT(sensor.source.get_if<OusterLiveSource>() != nullptr);
  return std::make_unique<OusterLive>(sensor, id);
}

SourceKeys read_ouster_pcap(yaml::MapReader& map, const std::string&) {
  OusterPcapSource source;
  SourceKeys keys;
  keys.cameras.emplace();
  bool good = read_file_key(map, "file", source.file);
  good &= read_common_keys(map, source);
  map.flag("loop", source.loop);
  const auto metadata = good ? metadata_of(map, source.metadata) : std::nullopt;
  if (metadata) {
    keys.cameras = cameras_of(*metadata, source.texture);
    keys.has_color = keys.cameras->color.has_value();
    auto recording = OusterRecording::open(source.file, *metadata, source.sender);
    const auto scan =
        recording ? recording->next() : Result<std::optional<LidarScan>>(recording.error());
    if (!scan)
      map.report.problem(map.line("file"), scan.error().message);
    else if (!*scan)
      map.report.problem(map.line("file"), in_quotes(source.file.string()) +
                                               " holds no packets of the sensor that " +
                                               in_quotes(source.metadata.string()) +
                                               " describes: is the metadata of this recording?");
    else if (const std::string odd = turn_mismatch(*metadata, **scan); !odd.empty())
      map.report.notice(map.line("metadata"), in_quotes(source.metadata.string()) + ": " + odd);
    if (scan && *scan)
      source.recorded =
          clock_of(*metadata, **scan, source.loop ? length_of(source.file) : std::nullopt);
  }
  keys.config = std::move(source);
  return keys;
}

SourceKeys read_ouster_live(yaml::MapReader& map, const std::string&) {
  OusterLiveSource source;
  SourceKeys keys;
  keys.cameras.emplace();
  const bool good = read_common_keys(map, source);
  map.text("address", source.address);
  map.integer("port", source.port, OusterLiveSource::kPort);
  if (const auto metadata = good ? metadata_of(map, source.metadata) : std::nullopt) {
    keys.cameras = cameras_of(*metadata, source.texture);
    keys.has_color = keys.cameras->color.has_value();
  }
  keys.config = std::move(source);
  return keys;
}

}  // namespace mr::sensor
