#include "mr/sensor/realsense/recording.h"

#include <algorithm>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstring>
#include <map>
#include <string_view>
#include <utility>

#include "mr/core/user_text.h"
#include "mr/kit/image_limits.h"
#include "mr/kit/jpeg.h"
#include "mr/kit/raw_color.h"
#include "mr/sensor/realsense/ros_bytes.h"

namespace mr::sensor {
namespace {

constexpr std::string_view kFirstDevice = "/device_0/", kFirstSensors = "/device_0/sensor_";
constexpr std::uint32_t kOldestVersion = 2, kNewestVersion = 4;
constexpr int kMostFirstPictures = 60, kMostFirstMessages = 20000;
constexpr std::size_t kMostWordBytes = 200;
/// Clocks of cameras count from when they were plugged in, those of computers from 1970.
constexpr Duration kAnotherClock = std::chrono::hours(24);

/// A text of the file that is shown to people.
std::string word(std::string_view text) { return one_line(text.substr(0, kMostWordBytes)); }

/// "/device_0/sensor_1/Color_0/image/data": the stream, its name, and what is said of it.
struct StreamTopic {
  std::string_view stream, name, rest;
};

std::optional<StreamTopic> stream_topic(std::string_view topic) {
  if (!topic.starts_with(kFirstSensors)) return std::nullopt;
  const std::size_t name = topic.find('/', kFirstSensors.size());
  if (name == std::string_view::npos) return std::nullopt;
  const std::size_t rest = topic.find('/', name + 1);
  if (rest == std::string_view::npos) return std::nullopt;
  return StreamTopic{topic.substr(0, rest), topic.substr(name + 1, rest - name - 1),
                     topic.substr(rest + 1)};
}

std::optional<RealSenseStream> stream_of(std::string_view name) {
  if (name.starts_with("Depth_")) return RealSenseStream::depth;
  if (name.starts_with("Color_")) return RealSenseStream::color;
  return std::nullopt;
}

const char* name_of(RealSenseStream stream) {
  return stream == RealSenseStream::depth ? "depth" : "colour";
}

/// The decimal number that was meant: 0.002, not 0.0020000000949949026.
double decimal(float value) {
  std::array<char, 64> text{};
  const auto written = std::to_chars(text.data(), text.data() + text.size(), value);
  double out = 0;
  std::from_chars(text.data(), written.ptr, out);
  return out;
}

bool is_depth_unit(double metres) { return metres >= 1e-6 && metres <= 0.1; }

/// Header of a ROS message: number, stamp, and a text that is the version of a RealSense image.
struct RosHeader {
  TimePoint stamp{};
  std::string_view text;
};

RosHeader read_ros_header(RosBytes& from) {
  RosHeader out;
  from.get<std::uint32_t>();
  const auto s = from.get<std::uint32_t>(), ns = from.get<std::uint32_t>();
  out.stamp = TimePoint(std::chrono::seconds(s) + Duration(ns));
  out.text = from.text();
  return out;
}

/// sensor_msgs/Image. Nothing: not even its time can be read. One that is damaged behind that has
/// no size and no bytes.
std::optional<RealSensePicture> read_image(std::span<const std::byte> bytes) {
  RosBytes from(bytes);
  const RosHeader header = read_ros_header(from);
  if (!from.good()) return std::nullopt;
  RealSensePicture out;
  out.at = header.stamp;
  const auto height = from.get<std::uint32_t>(), width = from.get<std::uint32_t>();
  const std::string_view encoding = from.text();
  out.big_endian = from.get<std::uint8_t>() != 0;
  out.step_bytes = from.get<std::uint32_t>();
  const auto data = from.counted();
  if (!from.good() || !kit::within_image_limits(width, height)) return out;
  out.encoding = word(encoding);
  out.width = static_cast<int>(width), out.height = static_cast<int>(height);
  out.bytes = std::make_shared<const std::vector<std::byte>>(data.begin(), data.end());
  if (header.text == "1") out.unit_m = decimal(from.get<float>());
  if (!is_depth_unit(out.unit_m)) out.unit_m = 0;
  return out;
}

/// sensor_msgs/CameraInfo.
std::optional<RealSenseLens> read_camera_info(std::span<const std::byte> bytes) {
  RosBytes from(bytes);
  read_ros_header(from);
  RealSenseLens out;
  const auto height = from.get<std::uint32_t>(), width = from.get<std::uint32_t>();
  out.model = word(from.text());
  const auto count = from.get<std::uint32_t>();
  for (std::uint32_t i = 0; i < count && from.good(); ++i) {
    const auto value = from.get<double>();
    if (i < out.coefficients.size()) out.coefficients[i] = value;
  }
  std::array<double, 9> k{};
  for (double& value : k) value = from.get<double>();
  if (!from.good() || !kit::within_image_limits(width, height)) return std::nullopt;
  out.width = static_cast<int>(width), out.height = static_cast<int>(height);
  out.fx = k[0], out.cx = k[2], out.fy = k[4], out.cy = k[5];
  return out;
}

/// geometry_msgs/Transform: from the reference of its group to a stream. The rotation is that of
/// the quaternion x y z w as it stands: so the SDK reads it (quat2rot), and its writers' signs,
/// which look like the conjugate's, come to the same.
std::optional<Pose> read_transform(std::span<const std::byte> bytes) {
  RosBytes from(bytes);
  std::array<double, 7> v{};
  for (double& value : v) value = from.get<double>();
  const double norm = std::sqrt(v[3] * v[3] + v[4] * v[4] + v[5] * v[5] + v[6] * v[6]);
  if (!from.good() || !(std::abs(norm - 1) < 0.01)) return std::nullopt;
  const double x = v[3] / norm, y = v[4] / norm, z = v[5] / norm, w = v[6] / norm;
  Pose out;
  out.rotation.m = {1 - 2 * (y * y + z * z), 2 * (x * y - z * w),     2 * (x * z + y * w),
                    2 * (x * y + z * w),     1 - 2 * (x * x + z * z), 2 * (y * z - x * w),
                    2 * (x * z - y * w),     2 * (y * z + x * w),     1 - 2 * (x * x + y * y)};
  out.translation = {v[0], v[1], v[2]};
  if (!is_rigid(out)) return std::nullopt;
  return out;
}

/// diagnostic_msgs/KeyValue; empty where it is damaged.
std::pair<std::string, std::string> read_key_value(std::span<const std::byte> bytes) {
  RosBytes from(bytes);
  const std::string key = word(from.text()), value = word(from.text());
  return from.good() ? std::pair(key, value) : std::pair<std::string, std::string>();
}

/// What is known of one stream.
struct StreamFacts {
  RealSensePictures pictures;
  std::string group;  ///< of its transform
  std::optional<Pose> T_stream_reference;
  double unit_m = 0;                                       ///< of its first picture; 0: not told
  Duration first_recorded_after{}, last_recorded_after{};  ///< from a picture's stamp

  bool is_complete() const {
    return pictures.width > 0 && pictures.lens && pictures.fps > 0 && T_stream_reference &&
           !pictures.clock.empty();
  }
};

/// Collects what the first messages say.
class FirstMessages {
 public:
  explicit FirstMessages(RealSenseHeader& out) : out_(out) {}

  void accept(const BagMessage& message);
  /// Whether all is known of a stream of a kind.
  bool knows(RealSenseStream stream) const {
    return std::ranges::any_of(of(stream), [](const auto& s) { return s.second.is_complete(); });
  }
  int pictures() const { return pictures_; }
  /// From the stamp of the first and the last depth picture to when these were recorded.
  Duration first_recorded_after() const { return first_recorded_after_; }
  Duration last_recorded_after() const { return last_recorded_after_; }
  void finish(const BagReader& bag);

 private:
  using Streams = std::map<std::string, StreamFacts, std::less<>>;

  const Streams& of(RealSenseStream s) const {
    return s == RealSenseStream::depth ? depth_ : color_;
  }
  void accept_device(std::string_view topic, std::span<const std::byte> bytes);
  void accept_option(std::string_view name, double value);
  void accept_stream(StreamFacts& facts, std::string_view rest, const BagMessage& message);
  void accept_picture(StreamFacts& facts, const BagMessage& message);
  const StreamFacts* choose(RealSenseStream stream);
  void note(std::string line) { out_.notes.push_back(std::move(line)); }
  void take_unit(const StreamFacts& depth);
  void take_extrinsics(const StreamFacts& depth, const StreamFacts& color);
  void note_streams(const BagReader& bag);

  RealSenseHeader& out_;
  Streams depth_, color_;
  double option_unit_m_ = 0;
  int pictures_ = 0;
  Duration first_recorded_after_{}, last_recorded_after_{};
};

void FirstMessages::accept(const BagMessage& message) {
  const auto topic = stream_topic(message.topic);
  if (!topic) return accept_device(message.topic, message.bytes);
  if (topic->name == "option") {
    if (topic->rest.ends_with("/value"))
      accept_option(topic->rest.substr(0, topic->rest.find('/')),
                    decimal(RosBytes(message.bytes).get<float>()));
    return;
  }
  const auto stream = stream_of(topic->name);
  if (!stream) return;
  Streams& streams = *stream == RealSenseStream::depth ? depth_ : color_;
  StreamFacts& facts = streams[std::string(topic->stream)];
  facts.pictures.topic = topic->stream;
  accept_stream(facts, topic->rest, message);
}

void FirstMessages::accept_device(std::string_view topic, std::span<const std::byte> bytes) {
  if (topic == "/file_version") out_.version = RosBytes(bytes).get<std::uint32_t>();
  const bool is_property = topic.starts_with(kFirstSensors) && topic.ends_with("/property");
  if (topic != "/device_0/info" && !is_property) return;
  const auto [key, value] = read_key_value(bytes);
  // Options as files of version 2 have them.
  double number = 0;
  std::from_chars(value.data(), value.data() + value.size(), number);
  if (is_property) return accept_option(key, number);
  if (key == "Name") out_.name = value;
  if (key == "Serial Number") out_.serial = value;
  if (key == "Firmware Version") out_.firmware = value;
}

void FirstMessages::accept_option(std::string_view name, double value) {
  const bool is_unit = name == "Depth_Units" || name == "Depth Units";
  if (is_unit && option_unit_m_ == 0 && is_depth_unit(value)) option_unit_m_ = value;
}

void FirstMessages::accept_stream(StreamFacts& facts, std::string_view rest,
                                  const BagMessage& message) {
  constexpr double kMostFps = 1000;
  if (rest == "image/data") return accept_picture(facts, message);
  if (rest == "info") {
    const auto fps = RosBytes(message.bytes).get<std::uint32_t>();
    if (fps <= kMostFps) facts.pictures.fps = fps;
  } else if (rest == "info/camera_info") {
    if (auto lens = read_camera_info(message.bytes)) facts.pictures.lens = *std::move(lens);
  } else if (rest == "image/metadata" && facts.pictures.clock.empty()) {
    auto [key, value] = read_key_value(message.bytes);
    if (key == "timestamp_domain") facts.pictures.clock = std::move(value);
  } else if (rest.starts_with("tf/") && !facts.T_stream_reference) {
    facts.group = rest.substr(3);
    facts.T_stream_reference = read_transform(message.bytes);
  }
}

void FirstMessages::accept_picture(StreamFacts& facts, const BagMessage& message) {
  ++pictures_;
  const auto picture = read_image(message.bytes);
  if (!picture || picture->width == 0) return;
  facts.last_recorded_after = message.recorded - picture->at.time_since_epoch();
  if (facts.pictures.width != 0) return;
  facts.first_recorded_after = facts.last_recorded_after;
  facts.pictures.width = picture->width, facts.pictures.height = picture->height;
  facts.pictures.encoding = picture->encoding;
  facts.unit_m = picture->unit_m;
}

/// The first stream that has pictures.
const StreamFacts* FirstMessages::choose(RealSenseStream stream) {
  const Streams& streams = of(stream);
  const auto found =
      std::ranges::find_if(streams, [](const auto& s) { return s.second.pictures.width > 0; });
  if (found == streams.end()) {
    if (!streams.empty())
      note(std::string("no picture of ") + name_of(stream) + " at the beginning: it is left out");
    return nullptr;
  }
  const StreamFacts& chosen = found->second;
  if (streams.size() > 1)
    note(std::to_string(streams.size()) + " streams of " + name_of(stream) + ": " +
         word(chosen.pictures.topic) + " is read");
  if (!chosen.pictures.lens)
    note(std::string("no camera_info of ") + name_of(stream) + ": its camera is not known");
  return &chosen;
}

void FirstMessages::take_unit(const StreamFacts& depth) {
  if (depth.unit_m > 0) {
    out_.depth_unit_m = depth.unit_m;
    out_.depth_unit_from = "its pictures";
  } else if (option_unit_m_ > 0) {
    out_.depth_unit_m = option_unit_m_;
    out_.depth_unit_from = "its option Depth_Units";
  } else {
    out_.depth_unit_from = "not told: what most cameras have";
    note("no unit of depth: 0.001 m is taken (depth_unit_m changes that)");
  }
}

void FirstMessages::take_extrinsics(const StreamFacts& depth, const StreamFacts& color) {
  if (depth.T_stream_reference && color.T_stream_reference && depth.group == color.group)
    out_.T_color_depth = *color.T_stream_reference * depth.T_stream_reference->inverse();
  else
    note(
        "it does not tell where colour lies beside depth (tf): both are taken for one place; "
        "state T_color_depth");
  if (depth.pictures.clock != color.pictures.clock)
    note("depth and colour are stamped by different clocks ('" + depth.pictures.clock + "' and '" +
         color.pictures.clock + "'): colour may be missing");
}

/// What there is besides the streams that are read.
void FirstMessages::note_streams(const BagReader& bag) {
  const bool has_others = std::ranges::any_of(bag.topics(), [](const auto& topic) {
    return topic.second.starts_with("/device_") && !topic.second.starts_with(kFirstDevice);
  });
  if (has_others) note("several devices: the first (device_0) is read");
  if (!bag.is_closed()) note("the recording was not closed properly: it has no index");
  if (bag.is_closed() && !bag.has_index())
    note("its index is damaged or missing: the recording is cut off or damaged");
}

void FirstMessages::finish(const BagReader& bag) {
  constexpr double kUsualFps = 30;
  if (out_.version < kOldestVersion || out_.version > kNewestVersion)
    note("version " + std::to_string(out_.version) + " of the layout; 2 to 4 are known");
  if (out_.serial.empty()) note("no serial number");
  const StreamFacts* const depth = choose(RealSenseStream::depth);
  const StreamFacts* const color = choose(RealSenseStream::color);
  if (depth) {
    out_.depth = depth->pictures;
    first_recorded_after_ = depth->first_recorded_after;
    last_recorded_after_ = depth->last_recorded_after;
    take_unit(*depth);
  }
  if (color) out_.color = color->pictures;
  if (depth && color) take_extrinsics(*depth, *color);
  const double told_fps = depth ? depth->pictures.fps : 0;
  if (depth && told_fps == 0) note("no rate of depth: 30 a second is taken");
  out_.period = Duration(std::llround(1e9 / (told_fps > 0 ? told_fps : kUsualFps)));
  note_streams(bag);
}

}  // namespace

RealSenseRecording::RealSenseRecording(BagReader bag, std::string file)
    : bag_(std::move(bag)), file_(std::move(file)) {}

Result<RealSenseRecording> RealSenseRecording::open(const std::filesystem::path& file) {
  auto bag = BagReader::open(file);
  if (!bag) return bag.error();
  RealSenseRecording out(*std::move(bag), file.string());
  if (const Status read = out.read_header(); !read) return read.error();
  return out;
}

/// Reads on until all is known of a depth and a colour stream, or for some pictures.
Status RealSenseRecording::read_header() {
  FirstMessages first(header_);
  const auto has = [&](RealSenseStream stream) {
    return std::ranges::any_of(bag_.topics(), [&](const auto& known) {
      const auto topic = stream_topic(known.second);
      return topic && topic->rest == "image/data" && stream_of(topic->name) == stream;
    });
  };
  const bool may_have_color = !bag_.has_index() || has(RealSenseStream::color);
  std::optional<Error> broken;
  for (int i = 0; i < kMostFirstMessages && first.pictures() < kMostFirstPictures; ++i) {
    const auto message = bag_.next();
    if (!message) broken = message.error();
    if (!message || !*message) break;
    first.accept(**message);
    // Without an index the last of these pictures tell which clock stays.
    if (bag_.has_index() && first.knows(RealSenseStream::depth) &&
        (first.knows(RealSenseStream::color) || !may_have_color))
      break;
  }
  first.finish(bag_);
  if (!header_.depth && !header_.color)
    return broken ? *broken
                  : Error{Error::Cause::unsupported,
                          file_ +
                              ": no recording of a RealSense: it has no pictures of a topic such "
                              "as /device_0/sensor_0/Depth_0/image/data"};
  return find_times(first.first_recorded_after(), first.last_recorded_after());
}

/// Settles which clock stamps the pictures, and when the first and the last depth picture was
/// taken.
Status RealSenseRecording::find_times(Duration first_recorded_after, Duration last_recorded_after) {
  if (!header_.depth) return bag_.rewind();
  const bool knows_last = bag_.seek_last(header_.depth->topic + "/image/data");
  while (knows_last) {  // pictures of any clock, for there is none yet
    const auto picture = next();
    if (!picture || !*picture) break;
    if ((*picture)->stream == RealSenseStream::depth)
      last_recorded_after = (*picture)->recorded_after;
  }
  const bool changes = std::chrono::abs(first_recorded_after - last_recorded_after) > kAnotherClock;
  recorded_after_ = changes ? last_recorded_after : first_recorded_after;
  if (changes)
    header_.notes.push_back(
        "its first pictures are stamped by another clock than the last: they are left out");
  if (knows_last && bag_.seek_last(header_.depth->topic + "/image/data"))
    while (true) {
      const auto picture = next();
      if (!picture || !*picture) break;
      if ((*picture)->stream == RealSenseStream::depth) header_.last = (*picture)->at;
    }
  if (const Status again = rewind(); !again) return again;
  while (!header_.first) {
    const auto picture = next();
    if (!picture || !*picture) break;
    if ((*picture)->stream == RealSenseStream::depth) header_.first = (*picture)->at;
  }
  if (header_.last && (!header_.first || *header_.last < *header_.first)) header_.last.reset();
  if (changes) read_clock();
  return rewind();
}

/// Which clock stamped the depth picture that was read last: its metadata follows.
void RealSenseRecording::read_clock() {
  for (int i = 0; i < kMostFirstMessages; ++i) {
    const auto message = bag_.next();
    if (!message || !*message) return;
    if ((*message)->topic != header_.depth->topic + "/image/metadata") continue;
    auto [key, value] = read_key_value((*message)->bytes);
    if (key != "timestamp_domain") continue;
    header_.depth->clock = std::move(value);
    return;
  }
}

/// A picture's time on the recording's clock, whose counter of microseconds begins anew every 72
/// minutes where it is the camera's. Nothing: another clock stamped it, or the stamp is damaged.
std::optional<TimePoint> RealSenseRecording::on_clock(const RealSensePicture& picture) const {
  if (!recorded_after_) return picture.at;
  constexpr Duration kRound = std::chrono::microseconds(std::int64_t{1} << 32);
  const Duration late = picture.recorded_after - *recorded_after_;
  if (std::chrono::abs(late) > kAnotherClock) return std::nullopt;
  const auto& read = picture.stream == RealSenseStream::depth ? header_.depth : header_.color;
  if (!read || read->clock != "Hardware Clock") return picture.at;
  const Duration rounds = (late + (late < Duration{} ? -kRound : kRound) / 2) / kRound * kRound;
  // The recorder's clock stands still while it is paused; what differs by more is no new round.
  constexpr Duration kMostPause = std::chrono::minutes(5);
  return std::chrono::abs(late - rounds) < kMostPause ? picture.at + rounds : picture.at;
}

Result<std::optional<RealSensePicture>> RealSenseRecording::next() {
  while (true) {
    const auto message = bag_.next();
    if (!message) return message.error();
    if (!*message) return std::optional<RealSensePicture>();
    const auto topic = stream_topic((*message)->topic);
    if (!topic || topic->rest != "image/data") continue;
    const auto stream = stream_of(topic->name);
    const auto& read = stream == RealSenseStream::depth ? header_.depth : header_.color;
    if (!stream || !read || read->topic != topic->stream) continue;
    auto picture = read_image((*message)->bytes);
    if (!picture) continue;
    picture->stream = *stream;
    picture->recorded_after = (*message)->recorded - picture->at.time_since_epoch();
    const auto at = on_clock(*picture);
    if (!at) continue;
    picture->at = *at;
    read_until_ = *at;
    return picture;
  }
}

Status RealSenseRecording::rewind() {
  read_until_.reset();
  return bag_.rewind();
}

Status RealSenseRecording::seek(TimePoint at) {
  constexpr Duration kMargin = std::chrono::seconds(1);  // pictures wait before they are written
  const bool may_go_on = read_until_ && *read_until_ + kMargin / 2 < at;
  if (!bag_.has_index() && may_go_on) return {};
  if (bag_.has_index() && recorded_after_ && header_.first && at > *header_.first + kMargin) {
    const Duration recorded = at.time_since_epoch() + *recorded_after_ - kMargin;
    if (bag_.seek(recorded)) {
      const auto picture = next();
      if (picture && *picture && (*picture)->at + kMargin / 2 < at) return {};
    }
  }
  return rewind();
}

namespace {

std::string lower_case(std::string text) {
  for (char& c : text)
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  return text;
}

Error unknown_encoding(const RealSensePicture& picture, const char* known) {
  return {Error::Cause::unsupported,
          "its encoding is " + in_quotes(picture.encoding) + "; " + known + " are read"};
}

Error damaged_message() { return {Error::Cause::corrupt, "its message is damaged"}; }

}  // namespace

Result<ImageDepth> decode_realsense_depth(const RealSensePicture& picture,
                                          std::span<const float> table) {
  MR_ASSERT(table.size() == 65536);
  if (!picture.bytes) return damaged_message();
  const std::string encoding = lower_case(picture.encoding);
  if (encoding != "mono16" && encoding != "z16" && encoding != "16uc1")
    return unknown_encoding(picture, "mono16 and Z16");
  const auto width = static_cast<std::size_t>(picture.width);
  const auto height = static_cast<std::size_t>(picture.height);
  const std::size_t row = 2 * width, step = picture.step_bytes, most = step * height;
  const std::size_t count = picture.bytes->size();
  if (step < row || count > most || count < most - step + row)
    return Error{Error::Cause::corrupt, std::to_string(count) + " bytes with rows of " +
                                            std::to_string(step) + " for a picture of " +
                                            std::to_string(width) + "x" + std::to_string(height) +
                                            " pixels"};
  const int turn = picture.big_endian == (std::endian::native == std::endian::big) ? 0 : 8;
  ImageDepth out(picture.width, picture.height);
  for (std::size_t y = 0; y < height; ++y) {
    const std::byte* const from = picture.bytes->data() + y * step;
    float* const to = out.row(static_cast<int>(y));
    for (std::size_t x = 0; x < width; ++x) {
      std::uint16_t value = 0;
      std::memcpy(&value, from + 2 * x, sizeof value);
      to[x] = table[std::rotr(value, turn)];
    }
  }
  return out;
}

Result<ImageRgb> decode_realsense_color(const RealSensePicture& picture) {
  using kit::RawColorFormat;
  constexpr std::pair<std::string_view, RawColorFormat> kFormats[] = {
      {"rgb8", RawColorFormat::rgb},    {"bgr8", RawColorFormat::bgr},
      {"rgba8", RawColorFormat::rgba},  {"bgra8", RawColorFormat::bgra},
      {"yuv422", RawColorFormat::uyvy}, {"uyvy", RawColorFormat::uyvy},
      {"yuyv", RawColorFormat::yuy2},   {"yuy2", RawColorFormat::yuy2}};
  if (!picture.bytes) return damaged_message();
  const std::string encoding = lower_case(picture.encoding);
  if (encoding == "mjpeg" || encoding == "jpeg") {
    auto out = kit::decode_jpeg(*picture.bytes);
    if (out && (out->width != picture.width || out->height != picture.height))
      return Error{Error::Cause::invalid, "a JPEG of another size than its message says"};
    return out;
  }
  const auto* const known =
      std::ranges::find(kFormats, encoding, &std::pair<std::string_view, RawColorFormat>::first);
  if (known == std::end(kFormats))
    return unknown_encoding(picture, "rgb8, bgr8, rgba8, bgra8, yuv422, YUYV and MJPEG");
  kit::RawColorLayout layout{known->second, picture.width, picture.height};
  constexpr std::uint32_t kMostStep = 1 << 20;
  if (picture.step_bytes == 0 || picture.step_bytes > kMostStep)
    return Error{Error::Cause::corrupt, "rows of " + std::to_string(picture.step_bytes) + " bytes"};
  layout.stride_bytes = static_cast<int>(picture.step_bytes);
  return kit::decode_raw_color(*picture.bytes, layout);
}

}  // namespace mr::sensor
