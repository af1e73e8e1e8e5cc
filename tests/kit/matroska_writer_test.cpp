#include "mr/kit/matroska_writer.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

extern "C" {
#include <libavformat/avformat.h>
}

#include <cstring>
#include <map>
#include <memory>

#include "core/temp_dir.h"
#include "mr/core/file.h"
#include "support/ebml.h"

namespace mr::kit {
namespace {

using std::chrono::milliseconds;
using test::Ebml;
using test::TempDir;
using testing::ElementsAre;
using testing::HasSubstr;
using Bytes = std::vector<std::byte>;
using Frame = MatroskaWriter::Frame;

Bytes bytes_of(std::size_t size, int first) {
  Bytes out(size);
  for (std::size_t i = 0; i < size; ++i) out[i] = static_cast<std::byte>(first + 7 * i);
  return out;
}

MatroskaTrack video_track(std::uint64_t number, std::uint64_t uid, const std::string& name) {
  MatroskaTrack track;
  track.number = number, track.uid = uid, track.name = name;
  track.codec_id = "V_MS/VFW/FOURCC";
  track.codec_private = bytes_of(40, 0);
  track.codec_private[0] = std::byte{40};
  for (std::size_t i = 1; i < 4; ++i) track.codec_private[i] = std::byte{0};
  for (std::size_t i = 0; i < 4; ++i) track.codec_private[16 + i] = std::byte("b16g"[i]);
  track.default_duration = milliseconds(40);
  track.width = 640, track.height = 576;
  return track;
}

MatroskaTrack data_track(std::uint64_t number, std::uint64_t uid) {
  MatroskaTrack track;
  track.number = number, track.uid = uid, track.name = "IMU", track.codec_id = "S_K4A/IMU";
  track.kind = MatroskaTrack::Kind::subtitle;
  return track;
}

MatroskaSettings settings() {
  MatroskaSettings out;
  out.title = "A test", out.writing_app = "test-1.0";
  out.date = std::chrono::sys_days(std::chrono::year{2024} / 2 / 29);
  return out;
}

/// A writer of one video track with number 7 and one of data with number 300.
MatroskaWriter make_writer(const std::filesystem::path& file, const MatroskaSettings& how) {
  auto writer = MatroskaWriter::create(
      file, how, {video_track(7, 0x123456789, "DEPTH"), data_track(300, 42)},
      {{"calibration.json", "application/octet-stream", 99, bytes_of(300, 5)}},
      {{"MODE", "fast", 0x123456789, 0}, {"FILE", "calibration.json", 0, 99}, {"ALL", "1", 0, 0}});
  if (!writer) ADD_FAILURE() << writer.error().message;
  return std::move(*writer);
}

/// Two seconds at 25 Hz, with a laced group after each picture.
void write_frames(MatroskaWriter& writer, MatroskaLacing lacing) {
  for (int i = 0; i < 50; ++i) {
    const milliseconds at(40 * i);
    ASSERT_TRUE(writer.write_frame(7, at, bytes_of(1000 + i, i)));
    const Bytes a = bytes_of(300, i);
    const Bytes b = bytes_of(lacing == MatroskaLacing::fixed ? 300 : 40, i + 1);
    const Bytes c = bytes_of(lacing == MatroskaLacing::fixed ? 300 : 510, i + 2);
    const std::vector<Frame> frames{a, b, c};
    const std::size_t count = lacing == MatroskaLacing::none ? 1 : 3;
    ASSERT_TRUE(writer.write_group(300, at + milliseconds(1), milliseconds(3),
                                   std::span(frames).first(count), lacing));
  }
}

void write_file(const std::filesystem::path& file, const MatroskaSettings& how,
                MatroskaLacing lacing = MatroskaLacing::xiph) {
  MatroskaWriter writer = make_writer(file, how);
  write_frames(writer, lacing);
  ASSERT_TRUE(writer.close());
}

Bytes content_of(const std::filesystem::path& file) {
  const auto bytes = read_file(file);
  EXPECT_TRUE(bytes);
  return bytes ? *bytes : Bytes{};
}

/// The file's segment.
Ebml segment_of(const Bytes& bytes) {
  const std::vector<Ebml> top = test::parse_ebml(bytes);
  EXPECT_EQ(top.size(), 2u);
  EXPECT_EQ(top.at(0).id, 0x1A45DFA3u);
  EXPECT_EQ(top.at(1).id, 0x18538067u);
  return top.at(1);
}

/// The ids of the segment's elements, in order; clusters count once.
std::vector<std::uint32_t> ids_of(const Ebml& segment) {
  std::vector<std::uint32_t> out;
  for (const Ebml& child : segment.children())
    if (out.empty() || out.back() != child.id) out.push_back(child.id);
  return out;
}

// libavformat as the oracle.
struct Input {
  struct Close {
    void operator()(AVFormatContext* context) const { avformat_close_input(&context); }
  };
  explicit Input(const std::filesystem::path& file) {
    AVFormatContext* opened = nullptr;
    av_log_set_level(AV_LOG_ERROR);
    EXPECT_EQ(avformat_open_input(&opened, file.c_str(), nullptr, nullptr), 0);
    context.reset(opened);
  }
  const AVStream& stream(std::size_t i) const { return *context->streams[i]; }
  static std::string tag(AVDictionary* from, const char* key) {
    const AVDictionaryEntry* entry = av_dict_get(from, key, nullptr, 0);
    return entry ? entry->value : "";
  }
  struct Packet {
    int stream = 0;
    std::int64_t time = 0;  ///< in the stream's unit
    Bytes data;
  };
  std::vector<Packet> packets() const {
    std::vector<Packet> out;
    AVPacket* packet = av_packet_alloc();
    while (av_read_frame(context.get(), packet) == 0) {
      const auto* data = reinterpret_cast<const std::byte*>(packet->data);
      out.push_back({packet->stream_index, packet->pts, Bytes(data, data + packet->size)});
      av_packet_unref(packet);
    }
    av_packet_free(&packet);
    return out;
  }

  std::unique_ptr<AVFormatContext, Close> context;
};

TEST(MatroskaWriter, LibavformatFindsTracksTagsAndAttachments) {
  const TempDir dir;
  for (const bool first : {true, false}) {
    MatroskaSettings how = settings();
    how.tags_first = first;
    write_file(dir / "a.mkv", how);
    const Input in(dir / "a.mkv");
    ASSERT_EQ(in.context->nb_streams, 3u);  // an attachment is one, too
    const AVCodecParameters& depth = *in.stream(0).codecpar;
    EXPECT_EQ(depth.codec_type, AVMEDIA_TYPE_VIDEO);
    EXPECT_EQ(depth.width, 640);
    EXPECT_EQ(depth.height, 576);
    EXPECT_EQ(depth.codec_tag, MKTAG('b', '1', '6', 'g'));
    EXPECT_EQ(in.tag(in.stream(0).metadata, "title"), "DEPTH");
    EXPECT_EQ(in.stream(0).avg_frame_rate.num, 25 * in.stream(0).avg_frame_rate.den);
    EXPECT_EQ(in.stream(1).codecpar->codec_type, AVMEDIA_TYPE_SUBTITLE);
    const AVCodecParameters& attached = *in.stream(2).codecpar;
    EXPECT_EQ(in.tag(in.stream(2).metadata, "filename"), "calibration.json");
    ASSERT_EQ(attached.extradata_size, 300);
    EXPECT_EQ(std::memcmp(attached.extradata, bytes_of(300, 5).data(), 300), 0);
    EXPECT_EQ(in.tag(in.context->metadata, "title"), "A test");
    EXPECT_EQ(in.tag(in.context->metadata, "ALL"), "1");
    if (first) {  // else libavformat does not look for those of tracks
      EXPECT_EQ(in.tag(in.stream(0).metadata, "MODE"), "fast");
      EXPECT_EQ(in.tag(in.stream(2).metadata, "FILE"), "calibration.json");
    }
    EXPECT_EQ(in.context->duration, 1'961'000);
  }
}

TEST(MatroskaWriter, LibavformatReadsEveryFrameOfEveryLacing) {
  const TempDir dir;
  for (const auto lacing :
       {MatroskaLacing::none, MatroskaLacing::xiph, MatroskaLacing::fixed, MatroskaLacing::ebml}) {
    write_file(dir / "a.mkv", settings(), lacing);
    const Input in(dir / "a.mkv");
    const int per_group = lacing == MatroskaLacing::none ? 1 : 3;
    std::vector<Bytes> pictures, samples;
    for (const Input::Packet& packet : in.packets()) {
      if (packet.stream == 0) {
        EXPECT_EQ(packet.time, static_cast<std::int64_t>(40'000 * pictures.size()));
        pictures.push_back(packet.data);
      } else {
        samples.push_back(packet.data);
      }
    }
    ASSERT_EQ(pictures.size(), 50u);
    ASSERT_EQ(samples.size(), 50u * per_group);
    for (int i = 0; i < 50; ++i) {
      EXPECT_EQ(pictures[i], bytes_of(1000 + i, i));
      EXPECT_EQ(samples[i * per_group], bytes_of(300, i));
      if (per_group == 1) continue;
      const bool fixed = lacing == MatroskaLacing::fixed;
      EXPECT_EQ(samples[i * per_group + 1], bytes_of(fixed ? 300 : 40, i + 1));
      EXPECT_EQ(samples[i * per_group + 2], bytes_of(fixed ? 300 : 510, i + 2));
    }
  }
}

// As k4arecord lays it out.
TEST(MatroskaWriter, ElementsComeInOrderAndAreFoundByTheirPositions) {
  const TempDir dir;
  write_file(dir / "a.mkv", settings());
  const Bytes bytes = content_of(dir / "a.mkv");
  const Ebml segment = segment_of(bytes);
  EXPECT_TRUE(segment.known_size);
  EXPECT_THAT(ids_of(segment), ElementsAre(0x114D9B74, 0xEC, 0x1549A966, 0xEC, 0x1654AE6B,
                                           0x1941A469, 0x1254C367, 0xEC, 0x1F43B675, 0x1C53BB6B));
  std::map<std::uint32_t, std::size_t> places;
  for (const Ebml& child : segment.children()) places.emplace(child.id, child.at);
  const auto seeks = segment.one(0x114D9B74).all(0x4DBB);
  EXPECT_EQ(seeks.size(), 5u);
  for (const Ebml& seek : seeks)
    EXPECT_EQ(seek.one(0x53AC).number(),
              places.at(static_cast<std::uint32_t>(seek.one(0x53AB).number())));
  const Ebml info = segment.one(0x1549A966);
  EXPECT_EQ(info.one(0x2AD7B1).number(), 1000u);
  EXPECT_EQ(info.one(0x4489).real(), 1'961'000);
  EXPECT_EQ(info.one(0x5741).text(), "test-1.0");
  constexpr std::uint64_t kSeconds = (23 * 365 + 5 + 31 + 28) * 86400ull;  // since 2001
  EXPECT_EQ(info.one(0x4461).number(), kSeconds * 1'000'000'000);
}

/// Read bit by bit, unlike the writer.
std::uint32_t slow_crc32(std::span<const std::byte> bytes) {
  std::uint32_t c = ~0u;
  for (const std::byte b : bytes) {
    c ^= std::to_integer<std::uint32_t>(b);
    for (int i = 0; i < 8; ++i) c = c >> 1 ^ (c & 1 ? 0xEDB88320u : 0);
  }
  return ~c;
}

TEST(MatroskaWriter, ClustersAreShortSummedAndIndexed) {
  const TempDir dir;
  write_file(dir / "a.mkv", settings());
  const Bytes bytes = content_of(dir / "a.mkv");
  const Ebml segment = segment_of(bytes);
  std::map<std::uint64_t, std::uint64_t> times;  // of clusters, by place
  for (const std::uint32_t id : {0x1254C367u, 0x1F43B675u})
    for (const Ebml& part : segment.all(id)) {
      const Ebml sum = part.children().at(0);
      ASSERT_EQ(sum.id, 0xBFu);
      ASSERT_EQ(sum.content.size(), 4u);
      std::uint32_t stored = 0;
      for (int i = 3; i >= 0; --i)
        stored = stored << 8 | std::to_integer<std::uint32_t>(sum.content[i]);
      EXPECT_EQ(stored, slow_crc32(part.content.subspan(6)));
      if (id == 0x1F43B675u) times[part.at] = part.one(0xE7).number();
    }
  EXPECT_EQ(times.size(), 50u);  // 40 ms apart, so each picture begins one
  std::vector<std::uint64_t> cues;
  for (const Ebml& cue : segment.one(0x1C53BB6B).all(0xBB)) {
    cues.push_back(cue.one(0xB3).number());
    EXPECT_EQ(cue.one(0xB7).one(0xF7).number(), 7u);
    EXPECT_EQ(times.at(cue.one(0xB7).one(0xF1).number()), cues.back());
  }
  EXPECT_THAT(cues, ElementsAre(0, 1'000'000));
}

TEST(MatroskaWriter, RelativeTimesStayWithinSixteenBits) {
  const TempDir dir;
  MatroskaSettings how = settings();
  how.tick = std::chrono::nanoseconds(100), how.cluster_span = std::chrono::seconds(10);
  MatroskaWriter writer = make_writer(dir / "a.mkv", how);
  for (const int ms : {0, 2, 1, 3, 4, 9, 7})  // 3.2767 ms is the most; one goes back too far
    ASSERT_TRUE(writer.write_frame(7, milliseconds(ms), bytes_of(4, ms)));
  ASSERT_TRUE(writer.close());
  const Bytes bytes = content_of(dir / "a.mkv");
  std::vector<std::uint64_t> starts;
  for (const Ebml& cluster : segment_of(bytes).all(0x1F43B675))
    starts.push_back(cluster.one(0xE7).number());
  EXPECT_THAT(starts, ElementsAre(0, 40'000, 90'000));
  std::vector<double> times;
  for (const Input::Packet& packet : Input(dir / "a.mkv").packets())
    times.push_back(packet.time * 1e-4);
  EXPECT_THAT(times, ElementsAre(0, 2, 1, 3, 4, 9, 7));
}

TEST(MatroskaWriter, VariantsLeaveOutWhatTheySay) {
  const TempDir dir;
  MatroskaSettings how = settings();
  how.cues = how.checksums = how.known_size = how.tags_first = false;
  write_file(dir / "a.mkv", how);
  const Bytes bytes = content_of(dir / "a.mkv");
  const Ebml segment = segment_of(bytes);
  EXPECT_FALSE(segment.known_size);
  EXPECT_THAT(ids_of(segment), ElementsAre(0x114D9B74, 0xEC, 0x1549A966, 0xEC, 0x1654AE6B, 0xEC,
                                           0x1F43B675, 0x1941A469, 0x1254C367));
  for (const Ebml& cluster : segment.all(0x1F43B675)) EXPECT_TRUE(cluster.all(0xBF).empty());
  EXPECT_EQ(Input(dir / "a.mkv").packets().size(), 200u);
}

TEST(MatroskaWriter, AKilledRecorderLeavesNoInfoAndNoIndex) {
  const TempDir dir;
  {
    MatroskaWriter writer = make_writer(dir / "a.mkv", settings());
    write_frames(writer, MatroskaLacing::fixed);
  }
  const Bytes bytes = content_of(dir / "a.mkv");
  const Ebml segment = segment_of(bytes);
  EXPECT_FALSE(segment.known_size);
  EXPECT_THAT(ids_of(segment),
              ElementsAre(0xEC, 0x1654AE6B, 0x1941A469, 0x1254C367, 0xEC, 0x1F43B675));
  EXPECT_EQ(segment.all(0x1F43B675).size(), 49u);  // the last was still in memory
}

TEST(MatroskaWriter, FilesMayExceedFourGibibytes) {
  const TempDir dir;
  MatroskaWriter writer = make_writer(dir / "a.mkv", settings());
  ASSERT_TRUE(writer.write_frame(7, milliseconds(0), bytes_of(10, 1)));
  ASSERT_TRUE(writer.skip(std::uint64_t{5} << 30));
  ASSERT_TRUE(writer.write_frame(7, milliseconds(1500), bytes_of(20, 2)));
  ASSERT_TRUE(writer.close());
  EXPECT_GT(std::filesystem::file_size(dir / "a.mkv"), std::uint64_t{5} << 30);
  const Input in(dir / "a.mkv");
  ASSERT_GE(av_seek_frame(in.context.get(), 0, 1'500'000, 0), 0);  // by the index
  const auto packets = in.packets();
  ASSERT_EQ(packets.size(), 1u);
  EXPECT_EQ(packets[0].data, bytes_of(20, 2));
}

TEST(MatroskaWriter, FailuresNameTheFile) {
  const TempDir dir;
  const auto nowhere =
      MatroskaWriter::create(dir / "none/a.mkv", settings(), {data_track(1, 1)}, {}, {});
  ASSERT_FALSE(nowhere);
  EXPECT_THAT(nowhere.error().message, HasSubstr("none/a.mkv: No such file"));
  MatroskaWriter writer = make_writer(dir / "a.mkv", settings());
  const Bytes a = bytes_of(3, 0), b = bytes_of(4, 0);
  const std::vector<Frame> frames{a, b}, many(257, a);
  EXPECT_FALSE(writer.write_frame(7, milliseconds(-1), a));
  EXPECT_FALSE(writer.write_group(7, {}, {}, frames, MatroskaLacing::fixed));
  EXPECT_FALSE(writer.write_group(7, {}, {}, frames, MatroskaLacing::none));
  EXPECT_FALSE(writer.write_group(7, {}, {}, many, MatroskaLacing::ebml));
  EXPECT_FALSE(writer.write_group(7, {}, {}, {}, MatroskaLacing::ebml));
}

}  // namespace
}  // namespace mr::kit
