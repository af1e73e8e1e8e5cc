#include "mr/kit/video.h"

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavutil/opt.h>
}

#include <algorithm>
#include <cmath>
#include <cstring>
#include <string>

#include "mr/core/assert.h"
#include "mr/kit/yuv.h"

namespace mr::kit {
namespace {

constexpr int kMaxVideoSide = 8192;
constexpr int kNever = 1 << 30;  // pictures
// By how much key frames are finer than the pictures that follow from them (x264's ipratio, 1.4).
constexpr double kKeyFramesFiner = 2.91;

struct FreeContext {
  void operator()(AVCodecContext* c) const { avcodec_free_context(&c); }
};
struct FreeFrame {
  void operator()(AVFrame* f) const { av_frame_free(&f); }
};
struct FreePacket {
  void operator()(AVPacket* p) const { av_packet_free(&p); }
};
using Context = std::unique_ptr<AVCodecContext, FreeContext>;
using Picture = std::unique_ptr<AVFrame, FreeFrame>;
using Unit = std::unique_ptr<AVPacket, FreePacket>;

Error failed(Error::Cause cause, const std::string& what, int av_error) {
  char text[AV_ERROR_MAX_STRING_SIZE] = {};
  av_strerror(av_error, text, sizeof text);
  return {cause, "video: " + what + ": " + text};
}

/// libavcodec writes a line to stderr for each damaged unit; we report errors ourselves.
void silence_library() {
  static const bool once = (av_log_set_level(AV_LOG_FATAL), true);
  static_cast<void>(once);
}

template <typename Byte>
YuvPlanes<Byte> planes_of(const AVFrame& picture) {
  return {{picture.data[0], picture.data[1], picture.data[2]},
          {picture.linesize[0], picture.linesize[1], picture.linesize[2]}};
}

std::vector<std::string> problems(const VideoSettings& s) {
  std::vector<std::string> out;
  if (s.width < 2 || s.height < 2 || s.width > kMaxVideoSide || s.height > kMaxVideoSide ||
      s.width % 2 != 0 || s.height % 2 != 0)
    out.push_back("size must be even and between 2 and 8192 pixels a side");
  if (!(s.fps > 0 && s.fps <= 1000)) out.push_back("fps must be above 0 and at most 1000");
  if (s.qp < 0 || s.qp > 51) out.push_back("qp must be between 0 and 51");
  if (s.threads < 1 || s.threads > 64 || s.slices < 1 || s.slices > 64)
    out.push_back("threads and slices must be between 1 and 64");
  if (s.key_frame_every < 0) out.push_back("key_frame_every must not be negative");
  return out;
}

/// Sets the quantiser by x264's rate factor, which unlike `qp` may be changed in a running encoder.
/// With adaptation to complexity disabled (qcomp, aq-mode; next to, for bands) both are equal.
void set_rate_factor(AVCodecContext& c, double qp) {
  constexpr double kFinest = 1;  // 0 is lossless, not in main
  av_opt_set_double(c.priv_data, "crf", std::max(qp, kFinest), 0);
}

Result<Context> open_encoder(const VideoSettings& s) {
  const AVCodec* codec = avcodec_find_encoder_by_name("libx264");
  if (codec == nullptr)
    return Error{Error::Cause::unsupported, "video: this libavcodec has no libx264"};
  Context c(avcodec_alloc_context3(codec));
  if (c == nullptr) return Error{Error::Cause::io, "video: out of memory"};
  c->width = s.width, c->height = s.height;
  c->pix_fmt = AV_PIX_FMT_YUV420P;
  c->framerate = av_d2q(s.fps, 1 << 16);
  c->time_base = av_inv_q(c->framerate);
  c->gop_size = s.key_frame_every > 0 ? s.key_frame_every : kNever;
  c->max_b_frames = 0;
  c->thread_count = s.threads;
  c->slices = s.slices;
  c->color_range = AVCOL_RANGE_MPEG;
  c->color_primaries = AVCOL_PRI_BT709;
  c->color_trc = AVCOL_TRC_BT709;
  c->colorspace = AVCOL_SPC_BT709;
  c->chroma_sample_location = AVCHROMA_LOC_CENTER;
  av_opt_set(c->priv_data, "preset", "superfast", 0);
  av_opt_set(c->priv_data, "tune", "zerolatency", 0);
  av_opt_set(c->priv_data, "profile", "main", 0);
  set_rate_factor(*c, s.qp - kKeyFramesFiner);  // before the first picture x264 knows no ratio
  av_opt_set_int(c->priv_data, "forced-idr", 1, 0);
  // Key frames only on demand; a constant quantiser. x264 takes bands only while it adapts
  // quantisers: so little that it does not.
  av_opt_set(
      c->priv_data, "x264-params",
      s.bands ? "scenecut=0:qcomp=1:aq-mode=1:aq-strength=0.001" : "scenecut=0:qcomp=1:aq-mode=0",
      0);
  if (const int rc = avcodec_open2(c.get(), codec, nullptr); rc < 0)
    return failed(Error::Cause::unsupported, "libx264 refuses the settings", rc);
  return c;
}

Result<Picture> make_picture(const VideoSettings& s) {
  Picture picture(av_frame_alloc());
  if (picture == nullptr) return Error{Error::Cause::io, "video: out of memory"};
  picture->format = AV_PIX_FMT_YUV420P;
  picture->width = s.width, picture->height = s.height;
  if (const int rc = av_frame_get_buffer(picture.get(), 0); rc < 0)
    return failed(Error::Cause::io, "no room for a picture", rc);
  return picture;
}

/// Tells x264 to code the rows beyond a band as coarsely as it can.
Status set_band(AVFrame& frame, RowBand band) {
  std::vector<AVRegionOfInterest> beyond;
  const auto add = [&](int top, int bottom) {
    if (top < bottom)
      beyond.push_back({sizeof(AVRegionOfInterest), top, bottom, 0, frame.width, {1, 1}});
  };
  add(0, band.first), add(band.end, frame.height);
  if (beyond.empty()) return {};
  const std::size_t bytes = beyond.size() * sizeof(AVRegionOfInterest);
  AVFrameSideData* data = av_frame_new_side_data(&frame, AV_FRAME_DATA_REGIONS_OF_INTEREST, bytes);
  if (data == nullptr) return Error{Error::Cause::io, "video: out of memory"};
  std::memcpy(data->data, beyond.data(), bytes);
  return {};
}

/// The first byte of each NAL unit of an Annex B stream, as offsets.
std::vector<std::size_t> nal_starts(std::span<const std::byte> unit) {
  std::vector<std::size_t> out;
  for (std::size_t i = 0; i + 3 < unit.size(); ++i)
    if (unit[i] == std::byte{0} && unit[i + 1] == std::byte{0} && unit[i + 2] == std::byte{1})
      out.push_back(i + 3), i += 2;
  return out;
}

int nal_type(std::byte first) { return std::to_integer<int>(first) & 31; }

bool holds_key_frame(std::span<const std::byte> unit) {
  constexpr int kIdrSlice = 5;
  for (const std::size_t at : nal_starts(unit))
    if (nal_type(unit[at]) == kIdrSlice) return true;
  return false;
}

/// The unit without x264's note about itself (SEI).
std::vector<std::byte> without_notes(std::span<const std::byte> unit) {
  constexpr int kSei = 6;
  const std::vector<std::size_t> starts = nal_starts(unit);
  std::vector<std::byte> out;
  out.reserve(unit.size());
  for (std::size_t n = 0; n < starts.size(); ++n) {
    if (nal_type(unit[starts[n]]) == kSei) continue;
    std::size_t end = unit.size();
    if (n + 1 < starts.size()) {
      end = starts[n + 1] - 3;
      if (end > starts[n] && unit[end - 1] == std::byte{0}) --end;  // a four-byte start code
    }
    for (const int b : {0, 0, 0, 1}) out.push_back(static_cast<std::byte>(b));
    out.insert(out.end(), unit.begin() + static_cast<std::ptrdiff_t>(starts[n]),
               unit.begin() + static_cast<std::ptrdiff_t>(end));
  }
  return out;
}

}  // namespace

VideoLibrary video_library() {
  const unsigned version = avcodec_version();
  return {std::to_string(AV_VERSION_MAJOR(version)) + "." +
              std::to_string(AV_VERSION_MINOR(version)) + "." +
              std::to_string(AV_VERSION_MICRO(version)),
          avcodec_license()};
}

// ---- encoder ----

struct VideoEncoder::Impl {
  VideoSettings settings;
  Context context;
  Picture picture;
  Unit unit;
  std::int64_t frames = 0;
};

VideoEncoder::VideoEncoder(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
VideoEncoder::VideoEncoder(VideoEncoder&&) noexcept = default;
VideoEncoder& VideoEncoder::operator=(VideoEncoder&&) noexcept = default;
VideoEncoder::~VideoEncoder() = default;

const VideoSettings& VideoEncoder::settings() const { return impl_->settings; }

void VideoEncoder::set_qp(int qp) { impl_->settings.qp = std::clamp(qp, 0, 51); }

Result<VideoEncoder> VideoEncoder::create(const VideoSettings& settings) {
  silence_library();
  if (const auto wrong = problems(settings); !wrong.empty())
    return Error{Error::Cause::invalid, "video: " + wrong.front()};
  auto context = open_encoder(settings);
  if (!context) return context.error();
  auto picture = make_picture(settings);
  if (!picture) return picture.error();
  Unit unit(av_packet_alloc());
  if (unit == nullptr) return Error{Error::Cause::io, "video: out of memory"};
  return VideoEncoder(std::make_unique<Impl>(
      Impl{settings, std::move(*context), std::move(*picture), std::move(unit)}));
}

Result<AccessUnit> VideoEncoder::encode(const ImageRgb& picture, bool force_key_frame) {
  return encode(picture, force_key_frame, nullptr);
}

Result<AccessUnit> VideoEncoder::encode_band(const ImageRgb& picture, RowBand band) {
  MR_ASSERT(impl_->settings.bands);
  return encode(picture, false, &band);
}

Result<AccessUnit> VideoEncoder::encode(const ImageRgb& picture, bool force_key_frame,
                                        const RowBand* band) {
  Impl& i = *impl_;
  if (picture.width != i.settings.width || picture.height != i.settings.height)
    return Error{Error::Cause::invalid, "video: a picture of another size than the stream's"};
  if (const int rc = av_frame_make_writable(i.picture.get()); rc < 0)
    return failed(Error::Cause::io, "no room for a picture", rc);
  rgb_to_yuv(picture, planes_of<std::uint8_t>(*i.picture));
  av_frame_remove_side_data(i.picture.get(), AV_FRAME_DATA_REGIONS_OF_INTEREST);
  if (band)
    if (const Status set = set_band(*i.picture, *band); !set) return set.error();
  if (i.frames > 0) set_rate_factor(*i.context, i.settings.qp);
  i.picture->pts = i.frames++;
  i.picture->pict_type = force_key_frame ? AV_PICTURE_TYPE_I : AV_PICTURE_TYPE_NONE;
  if (const int rc = avcodec_send_frame(i.context.get(), i.picture.get()); rc < 0)
    return failed(Error::Cause::io, "libx264 refuses a picture", rc);
  if (const int rc = avcodec_receive_packet(i.context.get(), i.unit.get()); rc < 0)
    return failed(Error::Cause::io, "libx264 gives no access unit", rc);
  const auto* bytes = reinterpret_cast<const std::byte*>(i.unit->data);
  AccessUnit out{without_notes({bytes, static_cast<std::size_t>(i.unit->size)}),
                 (i.unit->flags & AV_PKT_FLAG_KEY) != 0};
  av_packet_unref(i.unit.get());
  return out;
}

// ---- decoder ----

struct VideoDecoder::Impl {
  Context context;
  Picture picture;
  Unit unit;
  bool needs_key_frame = true;
  std::vector<std::uint8_t> padded;  ///< libavcodec reads beyond the end

  Status open();
  Status feed(std::span<const std::byte> access_unit);
  Result<ImageRgb> to_rgb();
};

VideoDecoder::VideoDecoder(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
VideoDecoder::VideoDecoder(VideoDecoder&&) noexcept = default;
VideoDecoder& VideoDecoder::operator=(VideoDecoder&&) noexcept = default;
VideoDecoder::~VideoDecoder() = default;

Result<VideoDecoder> VideoDecoder::create() {
  silence_library();
  auto impl = std::make_unique<Impl>();
  impl->picture.reset(av_frame_alloc());
  impl->unit.reset(av_packet_alloc());
  if (impl->picture == nullptr || impl->unit == nullptr)
    return Error{Error::Cause::io, "video: out of memory"};
  if (const Status opened = impl->open(); !opened) return opened.error();
  return VideoDecoder(std::move(impl));
}

/// A decoder that knows nothing of what came before.
Status VideoDecoder::Impl::open() {
  const AVCodec* codec = avcodec_find_decoder(AV_CODEC_ID_H264);
  if (codec == nullptr)
    return Error{Error::Cause::unsupported, "video: this libavcodec has no H.264 decoder"};
  context.reset(avcodec_alloc_context3(codec));
  if (context == nullptr) return Error{Error::Cause::io, "video: out of memory"};
  context->thread_count = 1;
  context->flags |= AV_CODEC_FLAG_LOW_DELAY;
  context->err_recognition = AV_EF_EXPLODE | AV_EF_BITSTREAM | AV_EF_BUFFER;
  context->max_pixels = std::int64_t{kMaxVideoSide} * kMaxVideoSide;
  if (const int rc = avcodec_open2(context.get(), codec, nullptr); rc < 0)
    return failed(Error::Cause::unsupported, "no H.264 decoder", rc);
  return {};
}

/// One access unit in, exactly one undamaged picture out.
Status VideoDecoder::Impl::feed(std::span<const std::byte> access_unit) {
  padded.assign(access_unit.size() + AV_INPUT_BUFFER_PADDING_SIZE, 0);
  std::memcpy(padded.data(), access_unit.data(), access_unit.size());
  unit->data = padded.data();
  unit->size = static_cast<int>(access_unit.size());
  const int sent = avcodec_send_packet(context.get(), unit.get());
  unit->data = nullptr;
  unit->size = 0;
  if (sent < 0) return failed(Error::Cause::corrupt, "a damaged access unit", sent);
  const int received = avcodec_receive_frame(context.get(), picture.get());
  if (received < 0)
    return failed(Error::Cause::corrupt, "an access unit without picture", received);
  if (picture->decode_error_flags != 0 || (picture->flags & AV_FRAME_FLAG_CORRUPT) != 0)
    return Error{Error::Cause::corrupt, "video: a damaged picture"};
  return {};
}

Result<ImageRgb> VideoDecoder::Impl::to_rgb() {
  const int w = picture->width, h = picture->height;
  if (w < 1 || h < 1 || w > kMaxVideoSide || h > kMaxVideoSide)
    return Error{Error::Cause::too_large, "video: a picture of more than 8192 pixels a side"};
  if (picture->format != AV_PIX_FMT_YUV420P)
    return Error{Error::Cause::unsupported, "video: only 8-bit 4:2:0 is read"};
  ImageRgb out(w, h);
  yuv_to_rgb(planes_of<const std::uint8_t>(*picture), out);
  return out;
}

Result<ImageRgb> VideoDecoder::decode(std::span<const std::byte> access_unit) {
  Impl& i = *impl_;
  constexpr std::size_t kMaxBytes = 256u << 20;
  if (access_unit.empty() || access_unit.size() > kMaxBytes)
    return Error{Error::Cause::corrupt, "video: an empty or endless access unit"};
  if (i.needs_key_frame && !holds_key_frame(access_unit))
    return Error{Error::Cause::corrupt, "video: waiting for a key frame"};
  Status fed = i.feed(access_unit);
  // Damaged parameter sets leave traces that flushing does not remove, such as a longer delay.
  if (!fed && holds_key_frame(access_unit) && i.open()) fed = i.feed(access_unit);
  Result<ImageRgb> out = fed ? i.to_rgb() : Result<ImageRgb>(fed.error());
  av_frame_unref(i.picture.get());
  i.needs_key_frame = !out;
  if (!out) avcodec_flush_buffers(i.context.get());
  return out;
}

}  // namespace mr::kit
