#include "mr/kit/video_file.h"

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libavutil/display.h>
#include <libavutil/opt.h>
#include <libavutil/parseutils.h>
#include <libavutil/pixdesc.h>
#include <libavutil/spherical.h>
#include <libavutil/stereo3d.h>
#include <libswscale/swscale.h>
}

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <string_view>
#include <utility>

#include "mr/kit/image_limits.h"
#include "mr/kit/yuv.h"

namespace mr::kit {
namespace {

constexpr const char* kContainers = "mov,matroska";  // none that opens further files by itself
constexpr int kIoBytes = 1 << 16;
constexpr int kDecoderThreads = 2;
constexpr std::int64_t kMaxVideoPixels = 64'000'000;
constexpr std::int64_t kMaxSeconds = std::int64_t{100} * 366 * 86400;
constexpr AVRational kNanoseconds{1, 1'000'000'000};

struct CloseFile {
  void operator()(std::FILE* f) const { std::fclose(f); }
};
struct FreeIo {
  void operator()(AVIOContext* io) const {
    av_freep(&io->buffer);
    avio_context_free(&io);
  }
};
struct CloseFormat {
  void operator()(AVFormatContext* f) const { avformat_close_input(&f); }
};
struct FreeFileDecoder {
  void operator()(AVCodecContext* c) const { avcodec_free_context(&c); }
};
struct FreeFileFrame {
  void operator()(AVFrame* f) const { av_frame_free(&f); }
};
struct FreeFilePacket {
  void operator()(AVPacket* p) const { av_packet_free(&p); }
};
struct FreeScaler {
  void operator()(SwsContext* s) const { sws_freeContext(s); }
};
using FileHandle = std::unique_ptr<std::FILE, CloseFile>;

std::string av_text(int av_error) {
  char text[AV_ERROR_MAX_STRING_SIZE] = {};
  av_strerror(av_error, text, sizeof text);
  return text;
}

/// The libraries write lines of their own to stderr; we report errors ourselves.
void silence_libav() {
  static const bool once = (av_log_set_level(AV_LOG_FATAL), true);
  static_cast<void>(once);
}

int read_some(void* opaque, std::uint8_t* to, int size) {
  auto* const file = static_cast<std::FILE*>(opaque);
  const std::size_t got = std::fread(to, 1, static_cast<std::size_t>(size), file);
  if (got > 0) return static_cast<int>(got);
  return std::ferror(file) != 0 ? AVERROR(EIO) : AVERROR_EOF;
}

std::int64_t size_of(std::FILE* file) {
  const off_t at = ::ftello(file);
  if (::fseeko(file, 0, SEEK_END) != 0) return -1;
  const off_t size = ::ftello(file);
  return ::fseeko(file, at, SEEK_SET) != 0 ? -1 : size;
}

std::int64_t seek_to(void* opaque, std::int64_t offset, int whence) {
  auto* const file = static_cast<std::FILE*>(opaque);
  if ((whence & AVSEEK_SIZE) != 0) return size_of(file);
  if (::fseeko(file, offset, whence & ~AVSEEK_FORCE) != 0) return AVERROR(EIO);
  return ::ftello(file);
}

/// Whether a Matroska file is shorter than its header says: its reader takes that for the end.
bool is_cut_matroska(std::FILE* file) {
  std::array<std::uint8_t, 128> head{};
  const std::size_t got = std::fread(head.data(), 1, head.size(), file);
  constexpr std::array<std::uint8_t, 4> kEbml{0x1A, 0x45, 0xDF, 0xA3},
      kSegment{0x18, 0x53, 0x80, 0x67};
  if (got < head.size() || !std::equal(kEbml.begin(), kEbml.end(), head.begin())) return false;
  const auto segment = std::search(head.begin(), head.end(), kSegment.begin(), kSegment.end());
  const auto at = static_cast<std::size_t>(segment - head.begin()) + kSegment.size();
  constexpr std::size_t kLongest = 8;
  if (at + kLongest > head.size() || head[at] == 0) return false;
  const auto bytes = static_cast<std::size_t>(std::countl_zero(head[at]) + 1);
  std::uint64_t size = head[at] & ((1u << (8 - bytes)) - 1);
  for (std::size_t i = 1; i < bytes; ++i) size = size << 8 | head[at + i];
  const bool unknown = size == (std::uint64_t{1} << 7 * bytes) - 1;  // a live recording
  return !unknown && size > static_cast<std::uint64_t>(size_of(file)) - (at + bytes);
}

/// Whether an MP4's index (moov) has a box of Spherical Video V2. libavformat gives the angles of
/// V1 in the same fields, although they mean something else.
bool has_v2_boxes(std::FILE* file) {
  constexpr std::uint64_t kMaxIndexBytes = std::uint64_t{256} << 20;
  const auto big = [](const std::uint8_t* b, int count) {
    std::uint64_t v = 0;
    for (int i = 0; i < count; ++i) v = v << 8 | b[i];
    return v;
  };
  std::array<std::uint8_t, 16> head{};
  const auto size = static_cast<std::uint64_t>(std::max<std::int64_t>(size_of(file), 0));
  for (std::uint64_t at = 0; at + 16 <= size;) {
    if (::fseeko(file, static_cast<off_t>(at), SEEK_SET) != 0 ||
        std::fread(head.data(), 1, head.size(), file) != head.size())
      return false;
    std::uint64_t box = big(head.data(), 4);
    if (box == 1) box = big(head.data() + 8, 8);
    if (box == 0) box = size - at;
    if (box < 8 || box > size - at) return false;
    if (std::equal(&head[4], &head[8], "moov")) {
      if (box > kMaxIndexBytes || ::fseeko(file, static_cast<off_t>(at), SEEK_SET) != 0)
        return false;
      std::string moov(box, '\0');
      return std::fread(moov.data(), 1, moov.size(), file) == moov.size() &&
             moov.find("sv3d") != std::string::npos;
    }
    at += box;
  }
  return false;
}

template <typename T>
const T* side_data(const AVStream& stream, AVPacketSideDataType type,
                   std::size_t least = sizeof(T)) {
#if LIBAVFORMAT_VERSION_MAJOR >= 61
  const AVPacketSideData* found = av_packet_side_data_get(
      stream.codecpar->coded_side_data, stream.codecpar->nb_coded_side_data, type);
  return found != nullptr && found->size >= least ? reinterpret_cast<const T*>(found->data)
                                                  : nullptr;
#else
  std::size_t size = 0;
  const std::uint8_t* found = av_stream_get_side_data(&stream, type, &size);
  return found != nullptr && size >= least ? reinterpret_cast<const T*>(found) : nullptr;
#endif
}

/// Where a part of `size` pixels lies and of how many, from what was cut off at both ends in parts
/// of the whole, 0.32 fixed point (av_spherical_tile_bounds() may be off by one at the far end);
/// the whole is 0 where too little is left.
std::pair<int, int> place_of(int size, std::uint32_t before, std::uint32_t after) {
  constexpr double kOne = 4294967296.0, kLeast = 1.0 / 64;
  const double rest = 1 - before / kOne - after / kOne;
  if (rest < kLeast) return {0, 0};
  const int whole = static_cast<int>(std::lround(size / rest));
  const int first = static_cast<int>(std::lround(before / kOne * whole));
  return {std::min(first, whole - size), whole};
}

PanoramaInfo panorama_of(const AVStream& stream, bool angles_are_pose) {
  PanoramaInfo out;
  const auto* sphere = side_data<AVSphericalMapping>(stream, AV_PKT_DATA_SPHERICAL);
  if (sphere == nullptr) return out;
  const bool tile = sphere->projection == AV_SPHERICAL_EQUIRECTANGULAR_TILE;
  out.projection =
      tile ? "equirectangular" : std::string(av_spherical_projection_name(sphere->projection));
  const auto degrees = [](std::int32_t fixed) { return fixed / 65536.0; };
  if (angles_are_pose) {
    out.heading_deg = degrees(sphere->yaw), out.pitch_deg = degrees(sphere->pitch);
    out.roll_deg = degrees(sphere->roll);
  }
  if (!tile) return out;
  const int width = stream.codecpar->width, height = stream.codecpar->height;
  const auto [left, across] = place_of(width, sphere->bound_left, sphere->bound_right);
  const auto [top, down] = place_of(height, sphere->bound_top, sphere->bound_bottom);
  if (across == 0 || down == 0) return out;
  out.full_width = across, out.full_height = down;
  out.crop = {left, top, width, height};
  return out;
}

/// Clockwise, a multiple of 90 where the file is sane.
int rotation_of(const AVStream& stream) {
  const auto* matrix =
      side_data<std::int32_t>(stream, AV_PKT_DATA_DISPLAYMATRIX, 9 * sizeof(std::int32_t));
  const double counterclockwise = matrix == nullptr ? 0 : av_display_rotation_get(matrix);
  if (!std::isfinite(counterclockwise)) return 0;
  return ((static_cast<int>(std::lround(-counterclockwise)) % 360) + 360) % 360;
}

std::optional<TimePoint> creation_time(const AVFormatContext& format) {
  const AVDictionaryEntry* entry = av_dict_get(format.metadata, "creation_time", nullptr, 0);
  std::int64_t us = 0;
  if (entry == nullptr || av_parse_time(&us, entry->value, 0) < 0 ||
      std::abs(us / 1'000'000) > kMaxSeconds)
    return std::nullopt;
  return TimePoint(std::chrono::microseconds(us));
}

/// Nothing where there is no time or none that can be.
std::optional<Duration> duration_of(std::int64_t value, AVRational unit) {
  if (value == AV_NOPTS_VALUE || unit.num <= 0 || unit.den <= 0) return std::nullopt;
  if (std::abs(static_cast<double>(value) * av_q2d(unit)) > static_cast<double>(kMaxSeconds))
    return std::nullopt;
  return Duration(av_rescale_q(value, unit, kNanoseconds));
}

int scaler_matrix(const AVFrame& picture) {
  switch (picture.colorspace) {
    case AVCOL_SPC_BT709:
      return SWS_CS_ITU709;
    case AVCOL_SPC_FCC:
      return SWS_CS_FCC;
    case AVCOL_SPC_BT470BG:
    case AVCOL_SPC_SMPTE170M:
      return SWS_CS_ITU601;
    case AVCOL_SPC_SMPTE240M:
      return SWS_CS_SMPTE240M;
    case AVCOL_SPC_BT2020_NCL:
    case AVCOL_SPC_BT2020_CL:
      return SWS_CS_BT2020;
    default:
      return picture.height >= 720 || picture.width >= 1280 ? SWS_CS_ITU709 : SWS_CS_ITU601;
  }
}

/// The names with J say by themselves that the range is full.
AVPixelFormat without_j(AVPixelFormat format, bool& full_range) {
  constexpr std::pair<AVPixelFormat, AVPixelFormat> kPlain[] = {
      {AV_PIX_FMT_YUVJ420P, AV_PIX_FMT_YUV420P},
      {AV_PIX_FMT_YUVJ422P, AV_PIX_FMT_YUV422P},
      {AV_PIX_FMT_YUVJ444P, AV_PIX_FMT_YUV444P},
      {AV_PIX_FMT_YUVJ440P, AV_PIX_FMT_YUV440P}};
  for (const auto& [j, plain] : kPlain)
    if (format == j) {
      full_range = true;
      return plain;
    }
  return format;
}

}  // namespace

struct VideoFile::Impl {
  std::string name;
  std::vector<std::byte> memory;
  FileHandle file;
  std::unique_ptr<AVIOContext, FreeIo> io;
  std::unique_ptr<AVFormatContext, CloseFormat> format;
  std::unique_ptr<AVCodecContext, FreeFileDecoder> decoder;
  std::unique_ptr<AVPacket, FreeFilePacket> packet{av_packet_alloc()};
  std::unique_ptr<AVFrame, FreeFileFrame> picture{av_frame_alloc()};
  std::unique_ptr<SwsContext, FreeScaler> scaler;
  std::vector<std::uint8_t> scaled;  ///< libswscale may write past the end of a row
  AVStream* stream = nullptr;
  VideoFileInfo info;
  Duration last{0};                ///< of the last picture
  std::optional<Duration> wanted;  ///< pictures before it are skipped
  std::optional<Error> cut;        ///< reported when the decoder is empty
  bool is_cut = false, ended = false, needs_key_frame = false;

  Error failure(Error::Cause cause, const std::string& what) const {
    return {cause, name + ": " + what};
  }
  Error damaged(int av_error) const;
  Status open();
  Status open_container();
  Status open_decoder();
  void describe(bool has_v2);
  Status feed();
  Status send();
  Status end_with(int av_error);
  Result<TimedImage> take();
  Status convert(ImageRgb& out);
  Status convert_by_scaler(AVPixelFormat pixels, bool full_range, ImageRgb& out);
};

Error VideoFile::Impl::damaged(int av_error) const {
  const double after_s = std::chrono::duration<double>(last).count();
  char at[32];
  std::snprintf(at, sizeof at, "%.2f", after_s);
  return failure(Error::Cause::corrupt,
                 "a damaged picture after " + std::string(at) + " s: " + av_text(av_error));
}

Status VideoFile::Impl::open() {
  silence_libav();
  if (packet == nullptr || picture == nullptr) return failure(Error::Cause::io, "out of memory");
  const bool has_v2 = has_v2_boxes(file.get());
  std::rewind(file.get());
  is_cut = is_cut_matroska(file.get());
  std::rewind(file.get());
  if (const auto status = open_container(); !status) return status;
  const int index = av_find_best_stream(format.get(), AVMEDIA_TYPE_VIDEO, -1, -1, nullptr, 0);
  if (index < 0)
    return failure(Error::Cause::unsupported, "holds no video stream: record or export one");
  stream = format->streams[index];
  for (unsigned i = 0; i < format->nb_streams; ++i)
    if (format->streams[i] != stream) format->streams[i]->discard = AVDISCARD_ALL;
  if (const auto status = open_decoder(); !status) return status;
  describe(has_v2);
  return {};
}

Status VideoFile::Impl::open_container() {
  auto* const buffer = static_cast<std::uint8_t*>(av_malloc(kIoBytes));
  if (buffer == nullptr) return failure(Error::Cause::io, "out of memory");
  io.reset(avio_alloc_context(buffer, kIoBytes, 0, file.get(), &read_some, nullptr, &seek_to));
  AVFormatContext* opened = avformat_alloc_context();
  if (io == nullptr || opened == nullptr) return failure(Error::Cause::io, "out of memory");
  opened->pb = io.get();
  opened->flags |= AVFMT_FLAG_CUSTOM_IO;
  AVDictionary* options = nullptr;
  av_dict_set(&options, "format_whitelist", kContainers, 0);
  const int rc = avformat_open_input(&opened, "", nullptr, &options);  // frees it when it fails
  av_dict_free(&options);
  format.reset(opened);
  if (rc < 0)
    return failure(Error::Cause::corrupt,
                   "not an MP4, MOV or MKV video, or cut off before its index: " + av_text(rc));
  std::vector<AVDictionary*> limits(format->nb_streams, nullptr);
  for (AVDictionary*& limit : limits) {
    av_dict_set_int(&limit, "max_pixels", kMaxVideoPixels, 0);
    av_dict_set_int(&limit, "threads", 1, 0);
  }
  const int found = avformat_find_stream_info(format.get(), limits.data());
  for (AVDictionary*& limit : limits) av_dict_free(&limit);
  if (found < 0)
    return failure(Error::Cause::corrupt, "its streams cannot be read: " + av_text(found));
  return {};
}

Status VideoFile::Impl::open_decoder() {
  const AVCodecParameters& p = *stream->codecpar;
  if (p.width < 1 || p.height < 1)
    return failure(Error::Cause::corrupt, "its video stream has no picture of a known size");
  if (const auto fits = within_image_limits(p.width, p.height); !fits)
    return failure(fits.error().cause, fits.error().message);
  const AVCodec* codec = avcodec_find_decoder(p.codec_id);
  if (codec == nullptr)
    return failure(Error::Cause::unsupported, std::string("this libavcodec has no decoder for ") +
                                                  avcodec_get_name(p.codec_id) +
                                                  ": convert the video to H.264");
  decoder.reset(avcodec_alloc_context3(codec));
  if (decoder == nullptr || avcodec_parameters_to_context(decoder.get(), &p) < 0)
    return failure(Error::Cause::io, "out of memory");
  decoder->thread_count = kDecoderThreads;
  decoder->err_recognition = AV_EF_EXPLODE;
  decoder->max_pixels = kMaxVideoPixels;
  decoder->pkt_timebase = stream->time_base;
  if (const int rc = avcodec_open2(decoder.get(), codec, nullptr); rc < 0)
    return failure(Error::Cause::unsupported,
                   std::string("the decoder of ") + codec->name + " refuses it: " + av_text(rc));
  return {};
}

void VideoFile::Impl::describe(bool has_v2) {
  const bool mov = std::string_view(format->iformat->name).starts_with("mov");
  info.container = format->iformat->name;
  info.codec = avcodec_get_name(stream->codecpar->codec_id);
  info.width = stream->codecpar->width, info.height = stream->codecpar->height;
  const AVRational rate =
      stream->avg_frame_rate.num > 0 ? stream->avg_frame_rate : stream->r_frame_rate;
  info.frames_per_s = rate.num > 0 && rate.den > 0 ? av_q2d(rate) : 0;
  auto length = duration_of(stream->duration, stream->time_base);
  if (!length) length = duration_of(format->duration, {1, AV_TIME_BASE});
  info.duration = std::max(length.value_or(Duration(0)), Duration(0));
  info.start = duration_of(stream->start_time, stream->time_base).value_or(Duration(0));
  info.recorded_at = creation_time(*format);
  info.rotation_deg = rotation_of(*stream);
  const auto* stereo = side_data<AVStereo3D>(*stream, AV_PKT_DATA_STEREO3D);
  info.stereo = stereo != nullptr && stereo->type != AV_STEREO3D_2D;
  info.panorama = panorama_of(*stream, !mov || has_v2);
  last = info.start;
}

/// Reads on until the decoder got something.
Status VideoFile::Impl::feed() {
  while (true) {
    const int rc = av_read_frame(format.get(), packet.get());
    if (rc < 0) return end_with(rc);
    const bool ours = packet->stream_index == stream->index;
    const bool key = (packet->flags & AV_PKT_FLAG_KEY) != 0;
    const bool whole = (packet->flags & AV_PKT_FLAG_CORRUPT) == 0;
    if (ours && !whole) {
      av_packet_unref(packet.get());
      return end_with(AVERROR_INVALIDDATA);
    }
    if (!ours || (needs_key_frame && !key)) {
      av_packet_unref(packet.get());
      continue;
    }
    needs_key_frame = false;
    return send();
  }
}

Status VideoFile::Impl::send() {
  const int rc = avcodec_send_packet(decoder.get(), packet.get());
  av_packet_unref(packet.get());
  if (rc >= 0) return {};
  avcodec_flush_buffers(decoder.get());
  needs_key_frame = true;
  return damaged(rc);
}

/// The decoder still holds pictures.
Status VideoFile::Impl::end_with(int av_error) {
  if (is_cut || av_error != AVERROR_EOF || format->pb->error < 0)
    cut = failure(Error::Cause::corrupt, "the file is truncated: " + av_text(av_error));
  avcodec_send_packet(decoder.get(), nullptr);
  return {};
}

Result<TimedImage> VideoFile::Impl::take() {
  const AVFrame& p = *picture;
  if (p.decode_error_flags != 0 || (p.flags & AV_FRAME_FLAG_CORRUPT) != 0)
    return damaged(AVERROR_INVALIDDATA);
  if (p.width != info.width || p.height != info.height)
    return failure(Error::Cause::unsupported,
                   "its pictures change their size to " + std::to_string(p.width) + "x" +
                       std::to_string(p.height) + ": cut the video there");
  const auto time = duration_of(p.best_effort_timestamp, stream->time_base);
  if (!time) return failure(Error::Cause::corrupt, "a picture without a time");
  last = *time;
  TimedImage out{*time, {}};
  if (wanted && *time < *wanted) return out;
  if (const auto status = convert(out.image); !status) return status.error();
  return out;
}

Status VideoFile::Impl::convert(ImageRgb& out) {
  const AVFrame& p = *picture;
  bool full_range = p.color_range == AVCOL_RANGE_JPEG;
  const AVPixelFormat pixels = without_j(static_cast<AVPixelFormat>(p.format), full_range);
  out = ImageRgb(p.width, p.height);
  if (pixels != AV_PIX_FMT_YUV420P || full_range || scaler_matrix(p) != SWS_CS_ITU709)
    return convert_by_scaler(pixels, full_range, out);
  yuv_to_rgb({{p.data[0], p.data[1], p.data[2]}, {p.linesize[0], p.linesize[1], p.linesize[2]}},
             out);
  return {};
}

Status VideoFile::Impl::convert_by_scaler(AVPixelFormat pixels, bool full_range, ImageRgb& out) {
  const AVFrame& p = *picture;
  const AVPixFmtDescriptor* known = av_pix_fmt_desc_get(pixels);
  const Error unsupported = failure(
      Error::Cause::unsupported,
      std::string("pixels of kind ") + (known == nullptr ? "?" : known->name) + " are not read");
  if (known == nullptr || sws_isSupportedInput(pixels) == 0) return unsupported;
  constexpr int kFlags = SWS_BILINEAR | SWS_FULL_CHR_H_INT | SWS_ACCURATE_RND | SWS_BITEXACT;
  scaler.reset(sws_getCachedContext(scaler.release(), p.width, p.height, pixels, p.width, p.height,
                                    AV_PIX_FMT_RGB24, kFlags, nullptr, nullptr, nullptr));
  if (scaler == nullptr) return unsupported;
  constexpr int kOne = 1 << 16, kFull = 1;
  sws_setColorspaceDetails(scaler.get(), sws_getCoefficients(scaler_matrix(p)), full_range,
                           sws_getCoefficients(SWS_CS_DEFAULT), kFull, 0, kOne, kOne);
  constexpr int kAlign = 64;
  const int stride = (3 * p.width + 2 * kAlign) / kAlign * kAlign;
  scaled.resize(static_cast<std::size_t>(stride) * (p.height + 1));
  std::uint8_t* const to[4] = {scaled.data()};
  const int strides[4] = {stride};
  if (sws_scale(scaler.get(), p.data, p.linesize, 0, p.height, to, strides) != p.height)
    return unsupported;
  for (int y = 0; y < p.height; ++y)
    std::copy_n(scaled.data() + static_cast<std::size_t>(stride) * y, 3 * p.width, out.row(y));
  return {};
}

VideoFile::VideoFile(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
VideoFile::VideoFile(VideoFile&&) noexcept = default;
VideoFile& VideoFile::operator=(VideoFile&&) noexcept = default;
VideoFile::~VideoFile() = default;

const VideoFileInfo& VideoFile::info() const { return impl_->info; }

Result<VideoFile> VideoFile::open(const std::filesystem::path& file) {
  auto impl = std::make_unique<Impl>();
  impl->name = file.string();
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(file, ignored))
    return impl->failure(Error::Cause::not_found, "there is no such file");
  impl->file.reset(std::fopen(file.c_str(), "rb"));
  if (impl->file == nullptr) return impl->failure(Error::Cause::io, "cannot be opened");
  if (const auto status = impl->open(); !status) return status.error();
  return VideoFile(std::move(impl));
}

Result<VideoFile> VideoFile::open(std::vector<std::byte> bytes, const std::string& name) {
  auto impl = std::make_unique<Impl>();
  impl->name = name;
  impl->memory = std::move(bytes);
  if (impl->memory.empty()) return impl->failure(Error::Cause::corrupt, "is empty");
  impl->file.reset(::fmemopen(impl->memory.data(), impl->memory.size(), "rb"));
  if (impl->file == nullptr) return impl->failure(Error::Cause::io, "cannot be opened");
  if (const auto status = impl->open(); !status) return status.error();
  return VideoFile(std::move(impl));
}

Result<std::optional<TimedImage>> VideoFile::next() {
  Impl& i = *impl_;
  while (!i.ended) {
    const int rc = avcodec_receive_frame(i.decoder.get(), i.picture.get());
    if (rc == AVERROR(EAGAIN)) {
      if (const auto fed = i.feed(); !fed) return fed.error();
      continue;
    }
    if (rc == AVERROR_EOF) {
      i.ended = true;
      if (i.cut) return *std::exchange(i.cut, std::nullopt);
      break;
    }
    if (rc < 0) {
      i.needs_key_frame = true;
      return i.damaged(rc);
    }
    auto taken = i.take();
    av_frame_unref(i.picture.get());
    if (!taken) {
      i.needs_key_frame = true;
      return taken.error();
    }
    if (taken->image.empty()) continue;
    i.wanted.reset();
    return std::optional<TimedImage>(std::move(*taken));
  }
  return std::optional<TimedImage>();
}

Status VideoFile::seek(Duration time) {
  Impl& i = *impl_;
  const Duration clamped = std::max(time, i.info.start);
  const std::int64_t target = av_rescale_q(clamped.count(), kNanoseconds, i.stream->time_base);
  const int rc = av_seek_frame(i.format.get(), i.stream->index, target, AVSEEK_FLAG_BACKWARD);
  if (rc < 0) return i.failure(Error::Cause::corrupt, "cannot be searched: " + av_text(rc));
  avcodec_flush_buffers(i.decoder.get());
  i.wanted = time;
  i.ended = i.needs_key_frame = false;
  i.cut.reset();
  return {};
}

}  // namespace mr::kit
