#include "support/video_files.h"

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libavutil/display.h>
#include <libavutil/opt.h>
#include <libavutil/pixdesc.h>
#include <libavutil/spherical.h>
#include <libswscale/swscale.h>
}

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "support/pictures.h"

namespace mr::test {
namespace {

void must(bool good, const char* what) {
  if (good) return;
  std::fprintf(stderr, "video_files: %s failed\n", what);
  std::abort();
}

template <typename T>
T* side_data(AVStream* stream, AVPacketSideDataType type, std::size_t size) {
#if LIBAVFORMAT_VERSION_MAJOR >= 61
  auto* added = av_packet_side_data_new(&stream->codecpar->coded_side_data,
                                        &stream->codecpar->nb_coded_side_data, type, size, 0);
  must(added != nullptr, "side data");
  return reinterpret_cast<T*>(added->data);
#else
  auto* data = av_stream_new_side_data(stream, type, size);
  must(data != nullptr, "side data");
  return reinterpret_cast<T*>(data);
#endif
}

void add_sphere(AVStream* stream, const SphericalPose& pose) {
  std::size_t size = 0;
  AVSphericalMapping* made = av_spherical_alloc(&size);
  const auto fixed = [](double deg) { return static_cast<std::int32_t>(deg * 65536); };
  const auto part = [](double of_one) { return static_cast<std::uint32_t>(of_one * 4294967295.0); };
  made->yaw = fixed(pose.yaw_deg), made->pitch = fixed(pose.pitch_deg);
  made->roll = fixed(pose.roll_deg);
  made->bound_left = part(pose.left), made->bound_top = part(pose.top);
  made->bound_right = part(pose.right), made->bound_bottom = part(pose.bottom);
  const bool tile = pose.left + pose.top + pose.right + pose.bottom > 0;
  made->projection = tile ? AV_SPHERICAL_EQUIRECTANGULAR_TILE : AV_SPHERICAL_EQUIRECTANGULAR;
  std::memcpy(side_data<AVSphericalMapping>(stream, AV_PKT_DATA_SPHERICAL, size), made, size);
  av_free(made);
}

AVCodecContext* open_encoder(const VideoKind& kind, int width, int height, bool global_header) {
  const AVCodec* codec = avcodec_find_encoder_by_name(kind.encoder.c_str());
  must(codec != nullptr, kind.encoder.c_str());
  AVCodecContext* c = avcodec_alloc_context3(codec);
  c->width = width, c->height = height;
  c->pix_fmt = av_get_pix_fmt(kind.pixels.c_str());
  c->time_base = {1, kind.fps};
  c->framerate = {kind.fps, 1};
  c->gop_size = kind.key_frame_every;
  c->max_b_frames = kind.encoder == "libx264" ? kind.b_frames : 0;
  c->thread_count = 1;
  c->global_quality = 2 * FF_QP2LAMBDA;
  c->strict_std_compliance = FF_COMPLIANCE_UNOFFICIAL;
  if (kind.encoder == "mjpeg") c->flags |= AV_CODEC_FLAG_QSCALE;
  if (kind.says_color) {
    c->colorspace = kind.bt709 ? AVCOL_SPC_BT709 : AVCOL_SPC_SMPTE170M;
    c->color_primaries = kind.bt709 ? AVCOL_PRI_BT709 : AVCOL_PRI_SMPTE170M;
    c->color_trc = AVCOL_TRC_BT709;
  }
  if (kind.says_color || kind.encoder == "mjpeg")
    c->color_range = kind.full_range ? AVCOL_RANGE_JPEG : AVCOL_RANGE_MPEG;
  if (global_header) c->flags |= AV_CODEC_FLAG_GLOBAL_HEADER;
  av_opt_set(c->priv_data, "crf", "10", 0);
  av_opt_set(c->priv_data, "preset", "ultrafast", 0);
  av_opt_set(c->priv_data, "x264-params", "bframes=2:scenecut=0", 0);
  av_opt_set(c->priv_data, "x265-params", "log-level=none:pools=1:frame-threads=1", 0);
  av_opt_set(c->priv_data, "deadline", "realtime", 0);
  must(avcodec_open2(c, codec, nullptr) >= 0, "the encoder");
  return c;
}

AVFrame* to_frame(const ImageRgb& picture, const AVCodecContext& c, const VideoKind& kind) {
  AVFrame* frame = av_frame_alloc();
  frame->format = c.pix_fmt, frame->width = c.width, frame->height = c.height;
  frame->color_range = c.color_range, frame->colorspace = c.colorspace;
  must(av_frame_get_buffer(frame, 0) >= 0, "a frame");
  SwsContext* sws = sws_getContext(c.width, c.height, AV_PIX_FMT_RGB24, c.width, c.height,
                                   c.pix_fmt, SWS_BILINEAR | SWS_ACCURATE_RND | SWS_FULL_CHR_H_INP,
                                   nullptr, nullptr, nullptr);
  must(sws != nullptr, "swscale");
  sws_setColorspaceDetails(sws, sws_getCoefficients(SWS_CS_DEFAULT), 1,
                           sws_getCoefficients(kind.bt709 ? SWS_CS_ITU709 : SWS_CS_ITU601),
                           kind.full_range, 0, 1 << 16, 1 << 16);
  const std::uint8_t* from[1] = {picture.data.data()};
  const int stride[1] = {3 * picture.width};
  sws_scale(sws, from, stride, 0, picture.height, frame->data, frame->linesize);
  sws_freeContext(sws);
  return frame;
}

void write_packets(AVFormatContext* format, AVStream* stream, AVCodecContext* codec,
                   const AVFrame* frame) {
  must(avcodec_send_frame(codec, frame) >= 0, "encoding");
  AVPacket* packet = av_packet_alloc();
  while (avcodec_receive_packet(codec, packet) >= 0) {
    if (packet->duration == 0 && codec->codec_type == AVMEDIA_TYPE_VIDEO) packet->duration = 1;
    av_packet_rescale_ts(packet, codec->time_base, stream->time_base);
    packet->stream_index = 0;
    must(av_interleaved_write_frame(format, packet) >= 0, "muxing");
  }
  av_packet_free(&packet);
}

AVFormatContext* open_output(const std::filesystem::path& file, const std::string& container) {
  AVFormatContext* format = nullptr;
  must(avformat_alloc_output_context2(&format, nullptr, container.c_str(), file.c_str()) >= 0,
       "the container");
  must(avio_open(&format->pb, file.c_str(), AVIO_FLAG_WRITE) >= 0, "the file");
  format->strict_std_compliance = FF_COMPLIANCE_UNOFFICIAL;  // spherical metadata
  format->flags |= AVFMT_FLAG_BITEXACT;
  return format;
}

void close_output(AVFormatContext* format, AVCodecContext* codec) {
  must(av_write_trailer(format) >= 0, "the end of the file");
  avio_closep(&format->pb);
  avformat_free_context(format);
  avcodec_free_context(&codec);
}

std::uint32_t big(const std::string& b, std::size_t at) {
  std::uint32_t v = 0;
  for (std::size_t i = at; i < at + 4; ++i) v = v << 8 | static_cast<std::uint8_t>(b[i]);
  return v;
}

}  // namespace

bool has_encoder(const std::string& name) {
  return avcodec_find_encoder_by_name(name.c_str()) != nullptr;
}

void write_video(const std::filesystem::path& file, std::span<const ImageRgb> pictures,
                 const VideoKind& kind) {
  av_log_set_level(AV_LOG_FATAL);
  AVFormatContext* format = open_output(file, kind.container);
  AVCodecContext* codec = open_encoder(kind, pictures[0].width, pictures[0].height,
                                       (format->oformat->flags & AVFMT_GLOBALHEADER) != 0);
  AVStream* stream = avformat_new_stream(format, nullptr);
  must(avcodec_parameters_from_context(stream->codecpar, codec) >= 0, "parameters");
  stream->time_base = codec->time_base;
  stream->avg_frame_rate = codec->framerate;
  if (kind.sphere) add_sphere(stream, *kind.sphere);
  if (kind.rotation_deg != 0)
    av_display_rotation_set(side_data<std::int32_t>(stream, AV_PKT_DATA_DISPLAYMATRIX, 36),
                            kind.rotation_deg);
  if (!kind.creation_time.empty())
    av_dict_set(&format->metadata, "creation_time", kind.creation_time.c_str(), 0);
  AVDictionary* options = nullptr;
  if (kind.index_first) av_dict_set(&options, "movflags", "+faststart", 0);
  must(avformat_write_header(format, &options) >= 0, "the header");
  av_dict_free(&options);
  for (std::size_t i = 0; i < pictures.size(); ++i) {
    AVFrame* frame = to_frame(pictures[i], *codec, kind);
    frame->pts = static_cast<std::int64_t>(i);
    write_packets(format, stream, codec, frame);
    av_frame_free(&frame);
  }
  write_packets(format, stream, codec, nullptr);
  close_output(format, codec);
}

void write_sound_only(const std::filesystem::path& file) {
  AVFormatContext* format = open_output(file, "mp4");
  const AVCodec* aac = avcodec_find_encoder(AV_CODEC_ID_AAC);
  must(aac != nullptr, "AAC");
  AVCodecContext* codec = avcodec_alloc_context3(aac);
  codec->sample_fmt = AV_SAMPLE_FMT_FLTP;
  codec->sample_rate = 48000;
  codec->time_base = {1, 48000};
  av_channel_layout_default(&codec->ch_layout, 1);
  codec->flags |= AV_CODEC_FLAG_GLOBAL_HEADER;
  must(avcodec_open2(codec, aac, nullptr) >= 0, "AAC");
  AVStream* stream = avformat_new_stream(format, nullptr);
  must(avcodec_parameters_from_context(stream->codecpar, codec) >= 0, "parameters");
  must(avformat_write_header(format, nullptr) >= 0, "the header");
  AVFrame* frame = av_frame_alloc();
  frame->format = codec->sample_fmt, frame->nb_samples = codec->frame_size;
  frame->sample_rate = codec->sample_rate;
  av_channel_layout_copy(&frame->ch_layout, &codec->ch_layout);
  must(av_frame_get_buffer(frame, 0) >= 0, "samples");
  std::memset(frame->data[0], 0, static_cast<std::size_t>(frame->linesize[0]));
  for (frame->pts = 0; frame->pts < 48000; frame->pts += codec->frame_size)
    write_packets(format, stream, codec, frame);
  write_packets(format, stream, codec, nullptr);
  av_frame_free(&frame);
  close_output(format, codec);
}

std::string with_spherical_v1(std::string mp4, const std::string& xml) {
  const std::string uuid("\xff\xcc\x82\x63\xf8\x55\x4a\x93\x88\x14\x58\x7a\x02\x52\x1f\xdd", 16);
  const std::string box =
      big_endian(static_cast<std::uint32_t>(8 + uuid.size() + xml.size()), 4) + "uuid" + uuid + xml;
  const std::size_t moov = mp4.find("moov") - 4, track = mp4.find("trak", moov) - 4;
  const std::uint32_t track_bytes = big(mp4, track), moov_bytes = big(mp4, moov);
  mp4.insert(track + track_bytes, box);
  const auto more = static_cast<std::uint32_t>(box.size());
  mp4.replace(track, 4, big_endian(track_bytes + more, 4));
  mp4.replace(moov, 4, big_endian(moov_bytes + more, 4));
  return mp4;
}

}  // namespace mr::test
