#include "mr/sensor/azure_kinect/recording.h"

extern "C" {
#include <libavformat/avformat.h>
}

#include <algorithm>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstring>
#include <map>
#include <utility>

#include "mr/core/user_text.h"
#include "mr/kit/jpeg.h"
#include "mr/kit/raw_color.h"

namespace mr::sensor {
namespace {

using std::chrono::microseconds;

constexpr int kMostSide_px = 16384;
constexpr std::int64_t kMost_ns = std::int64_t{1} << 61;  // sums of such times stay in range
constexpr int kFirstBlocks = 4096;  // how many are looked at for the first picture

constexpr std::uint32_t fourcc(const char (&name)[5]) {
  return static_cast<std::uint32_t>(name[0]) | static_cast<std::uint32_t>(name[1]) << 8 |
         static_cast<std::uint32_t>(name[2]) << 16 | static_cast<std::uint32_t>(name[3]) << 24;
}

struct CloseInput {
  void operator()(AVFormatContext* input) const { avformat_close_input(&input); }
};
struct FreePacket {
  void operator()(AVPacket* packet) const { av_packet_free(&packet); }
};
using Input = std::unique_ptr<AVFormatContext, CloseInput>;
using Packet = std::unique_ptr<AVPacket, FreePacket>;

std::string text_of(const AVDictionary* tags, const char* name) {
  const AVDictionaryEntry* entry = av_dict_get(tags, name, nullptr, 0);
  return entry ? entry->value : "";
}

/// A tag's number of nanoseconds; 0 where it is missing or none.
Duration nanoseconds_of(const AVDictionary* tags, const char* name) {
  const std::string text = text_of(tags, name);
  std::int64_t ns = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), ns);
  const bool good = error == std::errc() && ns > -kMost_ns && ns < kMost_ns;
  return Duration(good ? ns : 0);
}

Result<Input> open_input(const std::filesystem::path& file) {
  static const bool once = (av_log_set_level(AV_LOG_FATAL), true);  // errors are ours to report
  static_cast<void>(once);
  std::error_code failed;
  if (!std::filesystem::exists(file, failed))
    return Error{Error::Cause::not_found, file.string() + ": there is no such file"};
  AVFormatContext* opened = nullptr;
  const AVInputFormat* matroska = av_find_input_format("matroska");
  const std::string url = "file:" + file.string();
  if (avformat_open_input(&opened, url.c_str(), matroska, nullptr) < 0)
    return Error{Error::Cause::corrupt,
                 file.string() + ": not a Matroska file (.mkv), or its header is damaged"};
  return Input(opened);
}

/// The track that a stream is, by its tag, which counts most, or by its name.
std::optional<KinectTrack> track_of(const AVStream& stream, bool by_tag) {
  constexpr std::pair<KinectTrack, const char*> kTracks[] = {{KinectTrack::color, "COLOR"},
                                                             {KinectTrack::depth, "DEPTH"},
                                                             {KinectTrack::infrared, "IR"},
                                                             {KinectTrack::imu, "IMU"}};
  const std::string title = text_of(stream.metadata, "title");
  for (const auto& [track, name] : kTracks) {
    const std::string tag = "K4A_" + std::string(name) + "_TRACK";
    if (by_tag ? !text_of(stream.metadata, tag.c_str()).empty() : title == name) return track;
  }
  if (!by_tag && title == "DEPTH_IR") return KinectTrack::infrared;
  return std::nullopt;
}

const char* name_of(KinectTrack track) {
  constexpr const char* kNames[] = {"COLOR", "DEPTH", "IR", "IMU"};
  return kNames[static_cast<int>(track)];
}

std::string fourcc_text(std::uint32_t tag) {
  std::string out;
  for (int shift = 0; shift < 32; shift += 8) out += static_cast<char>(tag >> shift & 0xff);
  return in_quotes(out);
}

std::optional<KinectColorFormat> color_format(std::uint32_t tag) {
  switch (tag) {
    case fourcc("MJPG"):
      return KinectColorFormat::mjpg;
    case fourcc("NV12"):
      return KinectColorFormat::nv12;
    case fourcc("YUY2"):
      return KinectColorFormat::yuy2;
    case fourcc("BGRA"):
      return KinectColorFormat::bgra;
    default:
      return std::nullopt;
  }
}

/// A track of pictures; an Error says why it cannot be used.
Result<KinectPictures> pictures_of(const AVStream& stream, KinectTrack track) {
  const AVCodecParameters& coded = *stream.codecpar;
  const std::string name = std::string("track ") + name_of(track);
  KinectPictures out;
  out.width = coded.width, out.height = coded.height;
  out.mode = text_of(stream.metadata, ("K4A_" + std::string(name_of(track)) + "_MODE").c_str());
  if (out.width < 1 || out.height < 1 || out.width > kMostSide_px || out.height > kMostSide_px)
    return Error{Error::Cause::corrupt, name + " has pictures of " + std::to_string(out.width) +
                                            "x" + std::to_string(out.height) + " pixels"};
  if (track == KinectTrack::color) {
    const auto format = color_format(coded.codec_tag);
    if (!format)
      return Error{Error::Cause::unsupported, name + " is coded as " +
                                                  fourcc_text(coded.codec_tag) +
                                                  "; MJPG, NV12, YUY2 and BGRA are read"};
    out.format = *format;
    return out;
  }
  out.little_endian = coded.codec_tag == fourcc("YUY2");
  if (!out.little_endian && coded.codec_tag != fourcc("b16g"))
    return Error{Error::Cause::unsupported, name + " is coded as " + fourcc_text(coded.codec_tag) +
                                                "; b16g, 16 bits of grey, is read"};
  return out;
}

std::optional<KinectPictures>& pictures_in(KinectHeader& header, KinectTrack track) {
  return track == KinectTrack::color   ? header.color
         : track == KinectTrack::depth ? header.depth
                                       : header.infrared;
}

/// Which stream is which track; notes what cannot be used.
std::map<int, KinectTrack> find_tracks(const AVFormatContext& input, KinectHeader& header) {
  std::map<int, KinectTrack> out;
  const auto is_found = [&](KinectTrack track) {
    return std::ranges::any_of(out, [&](const auto& known) { return known.second == track; });
  };
  for (const bool by_tag : {true, false})
    for (unsigned i = 0; i < input.nb_streams; ++i) {
      const AVStream& stream = *input.streams[i];
      const auto track = track_of(stream, by_tag);
      if (!track || is_found(*track) || out.contains(static_cast<int>(i))) continue;
      if (*track == KinectTrack::imu) {
        header.has_imu = true;
      } else {
        auto pictures = pictures_of(stream, *track);
        if (!pictures) {
          header.notes.push_back(pictures.error().message);
          continue;
        }
        pictures_in(header, *track) = *std::move(pictures);
      }
      out.emplace(static_cast<int>(i), *track);
    }
  return out;
}

std::string calibration_in(const AVFormatContext& input) {
  std::string found;
  for (unsigned i = 0; i < input.nb_streams; ++i) {
    const AVStream& stream = *input.streams[i];
    const AVCodecParameters& data = *stream.codecpar;
    if (data.codec_type != AVMEDIA_TYPE_ATTACHMENT || data.extradata_size <= 0 ||
        static_cast<std::size_t>(data.extradata_size) > kMostKinectCalibrationBytes)
      continue;
    const bool is_tagged = !text_of(stream.metadata, "K4A_CALIBRATION_FILE").empty();
    if (!is_tagged && text_of(stream.metadata, "filename") != "calibration.json") continue;
    found.assign(reinterpret_cast<const char*>(data.extradata),
                 static_cast<std::size_t>(data.extradata_size));
    if (is_tagged) break;
  }
  return found;
}

Duration period_of(const AVFormatContext& input, const std::map<int, KinectTrack>& tracks) {
  constexpr double kUsual_fps = 30;
  for (const auto& [stream, track] : tracks) {
    const AVRational fps = input.streams[stream]->avg_frame_rate;
    if (track != KinectTrack::imu && fps.num > 0 && fps.den > 0)
      return Duration(std::llround(1e9 * fps.den / fps.num));
  }
  return Duration(std::llround(1e9 / kUsual_fps));
}

void read_tags(const AVFormatContext& input, KinectHeader& header) {
  const AVDictionary* tags = input.metadata;
  header.calibration = calibration_in(input);
  header.serial = text_of(tags, "K4A_DEVICE_SERIAL_NUMBER");
  header.color_firmware = text_of(tags, "K4A_COLOR_FIRMWARE_VERSION");
  header.depth_firmware = text_of(tags, "K4A_DEPTH_FIRMWARE_VERSION");
  header.writer = text_of(tags, "encoder");
  header.depth_delay = nanoseconds_of(tags, "K4A_DEPTH_DELAY_NS");
  header.subordinate_delay = nanoseconds_of(tags, "K4A_SUBORDINATE_DELAY_NS");
  header.start_offset = nanoseconds_of(tags, "K4A_START_OFFSET_NS");
  const std::string sync = text_of(tags, "K4A_WIRED_SYNC_MODE");
  if (sync == "MASTER") header.sync = KinectHeader::Sync::master;
  if (sync == "SUBORDINATE") header.sync = KinectHeader::Sync::subordinate;
  if (header.calibration.empty())
    header.notes.push_back("no attachment calibration.json: name one (calibration: FILE)");
  if (header.serial.empty()) header.notes.push_back("no serial number (K4A_DEVICE_SERIAL_NUMBER)");
}

}  // namespace

struct KinectRecording::Impl {
  std::filesystem::path file;
  KinectHeader header;
  std::map<int, KinectTrack> tracks;  ///< by stream
  Input input;
  bool read_on = false;                 ///< a block was read since the file was opened
  std::optional<TimePoint> read_until;  ///< the last of them
  /// A recording that was never closed has no unit of time, for which Matroska means 1 ms; the
  /// recorder's is 1 us.
  bool lacks_unit = false;

  Status open() {
    auto opened = open_input(file);
    if (!opened) return opened.error();
    input = *std::move(opened);
    read_on = false;
    read_until.reset();
    if (!tracks.empty()) choose_streams();
    return {};
  }

  void read_header() {
    header.notes.clear();
    tracks = find_tracks(*input, header);
    read_tags(*input, header);
    header.period = period_of(*input, tracks);
    lacks_unit = header.writer.empty() && text_of(input->metadata, "title").empty();
    if (!lacks_unit && input->duration > 0 && input->duration < kMost_ns / 1000)
      header.last = TimePoint(header.start_offset + microseconds(input->duration));
    else
      header.notes.push_back("no duration: the recording was not closed properly");
  }

  /// Blocks of other streams are not handed out, and cost no memory of their own.
  void choose_streams() {
    for (unsigned i = 0; i < input->nb_streams; ++i)
      input->streams[i]->discard =
          tracks.contains(static_cast<int>(i)) ? AVDISCARD_DEFAULT : AVDISCARD_ALL;
  }

  Result<std::optional<KinectBlock>> next() {
    while (true) {
      Packet packet(av_packet_alloc());
      const int status = packet ? av_read_frame(input.get(), packet.get()) : AVERROR(ENOMEM);
      read_on = true;
      if (status == AVERROR_EOF) return std::optional<KinectBlock>();
      if (status < 0)
        return Error{Error::Cause::corrupt, file.string() + ": damaged; what follows is lost"};
      const auto known = tracks.find(packet->stream_index);
      if (known == tracks.end() || packet->pts == AV_NOPTS_VALUE || packet->size <= 0) continue;
      const AVRational stated = input->streams[packet->stream_index]->time_base;
      const AVRational base = lacks_unit ? AVRational{1, 1'000'000} : stated;
      const std::int64_t ns = av_rescale_q(packet->pts, base, {1, 1'000'000'000});
      if (ns <= -kMost_ns || ns >= kMost_ns) continue;
      KinectBlock block{known->second, TimePoint(header.start_offset + Duration(ns)), {}, {}};
      block.bytes = std::as_bytes(std::span(packet->data, static_cast<std::size_t>(packet->size)));
      block.owner = std::shared_ptr<const AVPacket>(packet.release(), [](const AVPacket* done) {
        FreePacket()(const_cast<AVPacket*>(done));
      });
      read_until = block.at;
      return std::optional(std::move(block));
    }
  }
};

KinectRecording::KinectRecording(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
KinectRecording::KinectRecording(KinectRecording&&) noexcept = default;
KinectRecording& KinectRecording::operator=(KinectRecording&&) noexcept = default;
KinectRecording::~KinectRecording() = default;

const KinectHeader& KinectRecording::header() const { return impl_->header; }

Result<KinectRecording> KinectRecording::open(const std::filesystem::path& file) {
  auto impl = std::make_unique<Impl>();
  impl->file = file;
  if (const Status opened = impl->open(); !opened) return opened.error();
  impl->read_header();
  if (impl->tracks.empty()) {
    const auto& notes = impl->header.notes;
    const bool is_known = std::ranges::any_of(
        notes, [](const std::string& note) { return note.starts_with("track "); });
    return Error{Error::Cause::unsupported,
                 file.string() + ": " +
                     (is_known ? notes.front()
                               : "no recording of an Azure Kinect: it has no track COLOR, DEPTH, "
                                 "IR or IMU")};
  }
  for (int i = 0; i < kFirstBlocks && !impl->header.first; ++i) {
    const auto block = impl->next();
    if (!block || !*block) break;
    if ((*block)->track != KinectTrack::imu) impl->header.first = (*block)->at;
  }
  if (const Status again = impl->open(); !again) return again.error();
  if (impl->header.last && impl->header.first && *impl->header.last < *impl->header.first)
    impl->header.last.reset();
  return KinectRecording(std::move(impl));
}

void KinectRecording::leave_out(KinectTrack track) {
  std::erase_if(impl_->tracks, [&](const auto& known) { return known.second == track; });
  impl_->choose_streams();
}

Result<std::optional<KinectBlock>> KinectRecording::next() { return impl_->next(); }

Status KinectRecording::seek(TimePoint at) {
  constexpr Duration kMargin = std::chrono::seconds(1);  // blocks of tracks are not in one order
  const Duration since = at - TimePoint(impl_->header.start_offset) - kMargin;
  const auto us = std::chrono::duration_cast<microseconds>(since).count();
  if (us > 0 && !impl_->lacks_unit &&
      av_seek_frame(impl_->input.get(), -1, us, AVSEEK_FLAG_BACKWARD) >= 0) {
    const auto block = impl_->next();
    if (block && *block && (*block)->at < at) return {};
  }
  if (impl_->lacks_unit && impl_->read_until && *impl_->read_until + kMargin / 2 < at) return {};
  return impl_->read_on ? impl_->open() : Status{};
}

Result<ImageDepth> decode_counts(std::span<const std::byte> bytes, const KinectPictures& of,
                                 std::span<const float> table) {
  MR_ASSERT(table.size() == 65536);
  const std::size_t pixels = static_cast<std::size_t>(of.width) * of.height;
  if (bytes.size() != 2 * pixels)
    return Error{Error::Cause::corrupt, "a picture of " + std::to_string(bytes.size()) +
                                            " bytes where " + std::to_string(2 * pixels) +
                                            " are wanted"};
  auto out = ImageDepth::unfilled(of.width, of.height);
  // A table of swapped counts would save the turn, but the counts of a scene, which lie close
  // together, would be spread over all of it.
  const bool is_native = of.little_endian == (std::endian::native == std::endian::little);
  const int turn = is_native ? 0 : 8;
  for (std::size_t i = 0; i < pixels; ++i) {
    std::uint16_t count = 0;
    std::memcpy(&count, bytes.data() + 2 * i, sizeof count);
    out.data[i] = table[std::rotr(count, turn)];
  }
  return out;
}

Result<ImageRgb> decode_kinect_color(std::span<const std::byte> bytes, const KinectPictures& of) {
  if (of.format == KinectColorFormat::mjpg) {
    auto picture = kit::decode_jpeg(bytes);
    if (picture && (picture->width != of.width || picture->height != of.height))
      return Error{Error::Cause::invalid, "a picture of " + std::to_string(picture->width) + "x" +
                                              std::to_string(picture->height) +
                                              " pixels in a track of " + std::to_string(of.width) +
                                              "x" + std::to_string(of.height)};
    return picture;
  }
  const auto format = of.format == KinectColorFormat::nv12   ? kit::RawColorFormat::nv12
                      : of.format == KinectColorFormat::yuy2 ? kit::RawColorFormat::yuy2
                                                             : kit::RawColorFormat::bgra;
  return kit::decode_raw_color(bytes, {format, of.width, of.height});
}

std::vector<KinectImuSample> decode_imu(std::span<const std::byte> bytes) {
  constexpr std::size_t kSample = 40, kGyroscope = 20;
  std::vector<KinectImuSample> out;
  const auto read = [](std::span<const std::byte> from, TimePoint& at, std::array<float, 3>& xyz) {
    std::int64_t ns = 0;
    std::memcpy(&ns, from.data(), sizeof ns);
    std::memcpy(xyz.data(), from.data() + sizeof ns, sizeof xyz);
    at = TimePoint(Duration(ns));
  };
  for (; bytes.size() >= kSample; bytes = bytes.subspan(kSample)) {
    KinectImuSample& sample = out.emplace_back();
    read(bytes, sample.accelerometer_at, sample.acceleration_mps2);
    read(bytes.subspan(kGyroscope), sample.gyroscope_at, sample.rotation_radps);
  }
  return out;
}

}  // namespace mr::sensor
