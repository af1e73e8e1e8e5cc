#include "mr/sensor/azure_kinect/source.h"

#include <gtest/gtest.h>

#include <cstring>
#include <fstream>

#include "core/temp_dir.h"
#include "mr/kit/image_io.h"
#include "mr/kit/matroska_writer.h"
#include "mr/sensor/azure_kinect/captures.h"
#include "mr/sensor/timelines.h"
#include "support/shared_data.h"

namespace mr::sensor {
namespace {

using namespace std::chrono_literals;
using kit::MatroskaLacing;
using kit::MatroskaWriter;
using test::TempDir;
using Bytes = std::vector<std::byte>;

// --- the genuine recording

TEST(KinectMkv, ReadsTheGenuineRecording) {
  const auto file = test::shared_data() / "azure_kinect_mkv/recording.mkv";
  if (!std::filesystem::exists(file)) GTEST_SKIP() << "no recordings at " << file;
  auto recording = KinectRecording::open(file);
  ASSERT_TRUE(recording) << recording.error().message;
  const KinectHeader& header = recording->header();
  EXPECT_EQ(header.serial, "001514394512");
  EXPECT_EQ(header.start_offset, 336'277'000ns);
  EXPECT_EQ(header.period, 200ms);
  EXPECT_EQ(header.sync, KinectHeader::Sync::standalone);
  EXPECT_EQ(header.depth->mode, "NFOV_UNBINNED");
  EXPECT_EQ(header.color->mode, "MJPG_720P");
  EXPECT_TRUE(header.infrared && header.has_imu);
  EXPECT_EQ(header.calibration.size(), 3900u);
  EXPECT_EQ(header.first, TimePoint(336'277us + 463'945us));
  EXPECT_EQ(header.last, header.first);
  const auto cameras = kinect_cameras(header, file, {});
  ASSERT_TRUE(cameras) << cameras.error().message;
  EXPECT_NEAR(cameras->depth.fx, 504.6, 0.06);
  EXPECT_NEAR(cameras->color->cx, 639.3, 0.06);
  EXPECT_NEAR(cameras->T_color_depth.translation.x, -0.0321, 1e-4);

  KinectCaptures captures(*std::move(recording));
  const auto capture = captures.next();
  ASSERT_TRUE(capture && *capture && (*capture)->color && (*capture)->depth);
  std::vector<float> counts(65536);
  for (std::size_t i = 0; i < counts.size(); ++i) counts[i] = static_cast<float>(i);
  const auto depth = decode_counts((*capture)->depth->bytes, *captures.header().depth, counts);
  ASSERT_TRUE(depth);
  ImageDepth::Values valid = depth->data;
  std::erase(valid, 0.0f);
  EXPECT_NEAR(100.0 * static_cast<double>(valid.size()) / (640 * 576), 76, 0.5);
  std::ranges::nth_element(valid, valid.begin() + static_cast<std::ptrdiff_t>(valid.size() / 2));
  EXPECT_NEAR(valid[valid.size() / 2], 1491, 0.5);
  const auto color = decode_kinect_color((*capture)->color->bytes, *captures.header().color);
  ASSERT_TRUE(color) << color.error().message;
  EXPECT_EQ(color->width, 1280);
  const auto end = captures.next();
  EXPECT_TRUE(end && !*end);
}

// --- recordings made here

constexpr int kWidth = 320, kHeight = 288, kColorWidth = 1280, kColorHeight = 720;

/// Of FORMATS-like numbers: a lens without distortion.
std::string calibration_json() {
  const auto camera = [](const char* purpose, const char* location, const char* model,
                         const char* t, int width, int height) {
    return std::string("{\"Intrinsics\":{\"ModelParameterCount\":14,\"ModelParameters\":[") +
           model +
           "],\"ModelType\":\"CALIBRATION_LensDistortionModelBrownConrady\"},\"Location\":"
           "\"CALIBRATION_CameraLocation" +
           location + "\",\"Purpose\":\"CALIBRATION_CameraPurpose" + purpose +
           "\",\"MetricRadius\":1.7,\"Rt\":{\"Rotation\":[1,0,0,0,1,0,0,0,1],\"Translation\":[" +
           t + "]},\"SensorWidth\":" + std::to_string(width) +
           ",\"SensorHeight\":" + std::to_string(height) + "}";
  };
  return "{\"CalibrationInformation\":{\"Cameras\":[" +
         camera("Depth", "D0", "0.5,0.5,0.49,0.49,0,0,0,0,0,0,0,0,0,0", "0,0,0", 1024, 1024) + "," +
         camera("PhotoVideo", "PV0", "0.5,0.5,0.48,0.64,0,0,0,0,0,0,0,0,0,0", "-0.032,0,0", 4096,
                3072) +
         "],\"InertialSensors\":[]}}";
}

Bytes bytes_of(const std::string& text) {
  Bytes out(text.size());
  std::memcpy(out.data(), text.data(), text.size());
  return out;
}

Bytes bitmap_info(const char (&fourcc)[5], int width, int height, int bits) {
  Bytes out(40);
  const auto put = [&](std::size_t at, std::uint32_t value) {
    for (int i = 0; i < 4; ++i) out[at + i] = static_cast<std::byte>(value >> 8 * i);
  };
  put(0, 40), put(4, width), put(8, height), put(12, 1u | static_cast<std::uint32_t>(bits) << 16);
  std::memcpy(out.data() + 16, fourcc, 4);
  return out;
}

/// What a recording is made of.
struct Made {
  Duration start_offset{}, depth_delay{};
  std::string sync = "STANDALONE";
  Duration subordinate_delay{};
  bool calibration = true, tags = true;
  const char* depth_code = "b16g";
  kit::MatroskaSettings settings{};
};

constexpr std::uint64_t kColorUid = 111, kDepthUid = 222, kImuUid = 333;

kit::MatroskaTrack pictures_track(std::uint64_t number, std::uint64_t uid, const char* name,
                                  Bytes code, int width, int height) {
  kit::MatroskaTrack track;
  track.number = number, track.uid = uid, track.name = name;
  track.codec_id = "V_MS/VFW/FOURCC", track.codec_private = std::move(code);
  track.default_duration = 33'333'333ns;
  track.width = width, track.height = height;
  return track;
}

MatroskaWriter recording(const std::filesystem::path& file, const Made& made) {
  const bool swapped = std::string_view(made.depth_code) == "b16g";
  std::vector<kit::MatroskaTrack> tracks{
      pictures_track(9, kDepthUid, made.tags ? "ANYTHING" : "DEPTH",
                     swapped ? bitmap_info("b16g", kWidth, kHeight, 16)
                             : bitmap_info("YUY2", kWidth, kHeight, 16),
                     kWidth, kHeight),
      pictures_track(4, kColorUid, "COLOR", bitmap_info("MJPG", kColorWidth, kColorHeight, 24),
                     kColorWidth, kColorHeight)};
  kit::MatroskaTrack imu;
  imu.number = 200, imu.uid = kImuUid, imu.name = "IMU", imu.codec_id = "S_K4A/IMU";
  imu.kind = kit::MatroskaTrack::Kind::subtitle;
  tracks.push_back(imu);
  std::vector<kit::MatroskaTag> tags;
  const auto number = [](Duration d) { return std::to_string(d.count()); };
  if (made.tags)
    tags = {{"K4A_DEPTH_TRACK", std::to_string(kDepthUid), kDepthUid, 0},
            {"K4A_DEPTH_MODE", "NFOV_2x2BINNED", kDepthUid, 0},
            {"K4A_COLOR_TRACK", std::to_string(kColorUid), kColorUid, 0},
            {"K4A_COLOR_MODE", "MJPG_720P", kColorUid, 0},
            {"K4A_CALIBRATION_FILE", "calibration.json", 0, 77},
            {"K4A_DEVICE_SERIAL_NUMBER", "000000000042", 0, 0},
            {"K4A_WIRED_SYNC_MODE", made.sync, 0, 0},
            {"K4A_SUBORDINATE_DELAY_NS", number(made.subordinate_delay), 0, 0},
            {"K4A_DEPTH_DELAY_NS", number(made.depth_delay), 0, 0},
            {"K4A_START_OFFSET_NS", number(made.start_offset), 0, 0}};
  std::vector<kit::MatroskaAttachment> attachments;
  if (made.calibration)
    attachments.push_back({"calibration.json", "application/octet-stream", 77,
                           bytes_of("\xEF\xBB\xBF" + calibration_json() + std::string(1, '\0'))});
  auto writer = MatroskaWriter::create(file, made.settings, tracks, attachments, tags);
  if (!writer) ADD_FAILURE() << writer.error().message;
  return *std::move(writer);
}

/// A ramp: pixel i is `first` + i mod 4096 mm.
Bytes depth_bytes(int first, bool big_endian = true) {
  Bytes out(2 * std::size_t{kWidth} * kHeight);
  for (int i = 0; i < kWidth * kHeight; ++i) {
    const int mm = first + i % 4096;
    out[2 * i + (big_endian ? 0 : 1)] = static_cast<std::byte>(mm >> 8);
    out[2 * i + (big_endian ? 1 : 0)] = static_cast<std::byte>(mm);
  }
  return out;
}

const Bytes& color_bytes() {
  static const Bytes jpeg =
      kit::encode_jpeg(ImageRgb(kColorWidth, kColorHeight, std::uint8_t{90}), 90).operator*();
  return jpeg;
}

void add_depth(MatroskaWriter& writer, Duration at, int first = 600) {
  ASSERT_TRUE(writer.write_frame(9, at, depth_bytes(first)));
}
void add_color(MatroskaWriter& writer, Duration at) {
  ASSERT_TRUE(writer.write_frame(4, at, color_bytes()));
}

SensorConfig sensor_of(const std::filesystem::path& file, bool loop = false) {
  const auto opened = KinectRecording::open(file);
  EXPECT_TRUE(opened) << opened.error().message;
  const auto cameras = kinect_cameras(opened->header(), file, {});
  EXPECT_TRUE(cameras) << cameras.error().message;
  KinectMkvSource source;
  source.file = file, source.loop = loop;
  source.recorded = {"test", *opened->header().first - opened->header().subordinate_delay,
                     opened->header().last};
  SensorConfig sensor;
  sensor.id = "kinect", sensor.source = source;
  sensor.depth_camera = cameras->depth, sensor.color_camera = cameras->color;
  sensor.depth_near_m = 0.5, sensor.depth_far_m = 10;
  sensor.T_world_depth = {Pose{}};
  return sensor;
}

std::unique_ptr<FrameSource> open(const SensorConfig& sensor, double fps = 30) {
  return open_kinect_mkv(sensor, {}, timelines(std::span(&sensor, 1), fps)[0]);
}

TEST(KinectMkv, FindsTracksByTagsAndSwapsTheBytesOfDepth) {
  const TempDir dir;
  auto writer = recording(dir / "a.mkv", {.start_offset = 5s});
  add_depth(writer, 10ms), add_color(writer, 10ms);
  ASSERT_TRUE(writer.close());
  const SensorConfig sensor = sensor_of(dir / "a.mkv");
  EXPECT_NEAR(sensor.depth_camera.fx, 0.49 * 512, 1e-9);
  const auto frame = open(sensor)->next();
  ASSERT_TRUE(frame && *frame) << frame.error().message;
  EXPECT_EQ((*frame)->captured_at(), TimePoint(0ms));
  EXPECT_EQ(*(*frame)->depth.at(0, 0), 0.6f);
  EXPECT_EQ(*(*frame)->depth.at(319, 0), static_cast<float>(0.919));
  EXPECT_EQ((*frame)->color.width, kColorWidth);
}

TEST(KinectMkv, FindsTracksByNameAndOldDepthIsNotSwapped) {
  const TempDir dir;
  auto writer = recording(dir / "a.mkv", {.tags = false, .depth_code = "YUY2"});
  ASSERT_TRUE(writer.write_frame(9, 0ms, depth_bytes(600, false)));
  ASSERT_TRUE(writer.close());
  const auto frame = open(sensor_of(dir / "a.mkv"))->next();
  ASSERT_TRUE(frame && *frame) << frame.error().message;
  EXPECT_EQ(*(*frame)->depth.at(1, 0), static_cast<float>(0.601));
  EXPECT_TRUE((*frame)->color.empty());
}

TEST(KinectMkv, GroupsWhatBelongsTogether) {
  const TempDir dir;
  auto writer = recording(dir / "a.mkv", {.depth_delay = 160us});
  // Colour is missing at first; its exposures are 160 us before depth; depth is missing once.
  for (const Duration at : {0ms, 33ms, 66ms, 100ms, 133ms}) {
    if (at >= 66ms) add_color(writer, at - 160us);
    if (at != 100ms) add_depth(writer, at);
  }
  ASSERT_TRUE(writer.close());
  KinectCaptures captures(*KinectRecording::open(dir / "a.mkv"));
  std::string seen;
  while (true) {
    const auto capture = captures.next();
    ASSERT_TRUE(capture) << capture.error().message;
    if (!*capture) break;
    seen += (*capture)->color ? ((*capture)->depth ? "both " : "color ") : "depth ";
  }
  EXPECT_EQ(seen, "depth depth both color both ");
}

TEST(KinectMkv, RecordingsOfOneCableLieOnOneClock) {
  const TempDir dir;
  std::vector<SensorConfig> rig;
  for (int i = 0; i < 3; ++i) {
    const auto file = dir / (std::to_string(i) + ".mkv");
    // Each begins a frame later than the one before, and exposes 160 us later.
    const Duration delay = i * 160us, start = 7s + i * 33'333us;
    auto writer = recording(file, {.start_offset = start,
                                   .sync = i == 0 ? "MASTER" : "SUBORDINATE",
                                   .subordinate_delay = delay});
    for (int frame = i; frame < 6; ++frame)
      add_depth(writer, frame * 33'333us + delay - (start - 7s), 600 + 100 * frame);
    ASSERT_TRUE(writer.close());
    rig.push_back(sensor_of(file));
  }
  const auto lines = timelines(rig, 30);
  for (int i = 0; i < 3; ++i) {
    const auto source = open_kinect_mkv(rig[i], {}, lines[i]);
    for (int frame = 0; frame < 6; ++frame) {
      const auto got = source->next();
      if (frame < i) {
        EXPECT_TRUE(!got && is_gap(got.error())) << i << " " << frame;
        continue;
      }
      ASSERT_TRUE(got && *got) << got.error().message;
      EXPECT_NEAR(*(*got)->depth.at(0, 0), 0.6 + 0.1 * frame, 1e-6) << i << " " << frame;
      EXPECT_EQ((*got)->captured_at(), TimePoint(frame * 33'333us));
    }
  }
}

TEST(KinectMkv, SkipsSeeksAndStartsAgain) {
  const TempDir dir;
  for (const bool cues : {true, false}) {
    const auto file = dir / (cues ? "cues.mkv" : "none.mkv");
    Made made;
    made.settings.cues = cues;
    auto writer = recording(file, made);
    for (int i = 0; i < 150; ++i) add_depth(writer, i * 33'333us, 600 + i);
    ASSERT_TRUE(writer.close());
    const auto source = open(sensor_of(file, true));
    source->skip(100);
    auto frame = source->next();
    ASSERT_TRUE(frame && *frame) << frame.error().message;
    EXPECT_NEAR(*(*frame)->depth.at(0, 0), 0.7, 1e-6);
    source->skip(48);
    EXPECT_NEAR(*(*source->next())->depth.at(0, 0), 0.749, 1e-6);
    frame = source->next();
    ASSERT_TRUE(frame && *frame) << frame.error().message;
    EXPECT_NEAR(*(*frame)->depth.at(0, 0), 0.6, 1e-6);
    EXPECT_EQ((*frame)->index, 150u);
  }
}

TEST(KinectMkv, ReadsWhatWasNeverClosedAndWhatIsCutOff) {
  const TempDir dir;
  {
    auto writer = recording(dir / "killed.mkv", {});
    for (int i = 0; i < 6; ++i) add_depth(writer, i * 33'333us);
  }  // never closed: no unit of time, no duration, no index
  auto killed = KinectRecording::open(dir / "killed.mkv");
  ASSERT_TRUE(killed) << killed.error().message;
  EXPECT_FALSE(killed->header().last.has_value());
  for (int i = 0; i < 4; ++i) {
    const auto block = killed->next();
    ASSERT_TRUE(block && *block) << i;
    EXPECT_EQ((*block)->at, TimePoint(i * 33'333us));
  }
  auto whole = recording(dir / "whole.mkv", {});
  for (int i = 0; i < 6; ++i) add_depth(whole, i * 33'333us);
  ASSERT_TRUE(whole.close());
  const auto size = std::filesystem::file_size(dir / "whole.mkv");
  std::filesystem::resize_file(dir / "whole.mkv", size - 2 * kWidth * kHeight - 1000);
  const auto source = open(sensor_of(dir / "whole.mkv"));
  int frames = 0;
  for (auto frame = source->next(); frame && *frame; frame = source->next()) ++frames;
  EXPECT_GE(frames, 4);
}

TEST(KinectMkv, ADamagedPictureCostsItselfAlone) {
  const TempDir dir;
  auto writer = recording(dir / "a.mkv", {});
  add_depth(writer, 0ms);
  ASSERT_TRUE(writer.write_frame(4, 0ms, std::span(color_bytes()).first(900)));
  ASSERT_TRUE(writer.write_frame(9, 33'333us, Bytes(99)));
  add_color(writer, 33'333us);
  add_depth(writer, 66'666us), add_color(writer, 66'666us);
  ASSERT_TRUE(writer.close());
  const auto source = open(sensor_of(dir / "a.mkv"));
  const auto first = source->next();
  ASSERT_TRUE(first && *first);
  EXPECT_TRUE((*first)->color.empty());
  ASSERT_TRUE((*first)->color_lost.has_value());
  EXPECT_NE((*first)->color_lost->message.find("a.mkv: colour: JPEG is truncated"),
            std::string::npos)
      << (*first)->color_lost->message;
  const auto second = source->next();
  ASSERT_FALSE(second.ok());
  EXPECT_NE(second.error().message.find("a.mkv: depth: a picture of 99 bytes"), std::string::npos)
      << second.error().message;
  const auto third = source->next();
  ASSERT_TRUE(third && *third);
  EXPECT_FALSE((*third)->color.empty());
  EXPECT_FALSE((*third)->color_lost.has_value());
}

TEST(KinectMkv, SaysWhatIsWrong) {
  const TempDir dir;
  const auto message = [&](const std::filesystem::path& file) {
    const auto opened = KinectRecording::open(file);
    if (!opened) return opened.error().message;
    const auto cameras = kinect_cameras(opened->header(), file, {});
    return cameras ? "nothing" : cameras.error().message;
  };
  EXPECT_NE(message(dir / "none.mkv").find("no such file"), std::string::npos);
  EXPECT_NE(message(dir.write("text.mkv", "hello")).find("not a Matroska file"), std::string::npos);
  auto bare = recording(dir / "bare.mkv", {.calibration = false});
  add_depth(bare, 0ms);
  ASSERT_TRUE(bare.close());
  EXPECT_NE(message(dir / "bare.mkv").find("bare.mkv: it holds no calibration.json"),
            std::string::npos);
  kit::MatroskaTrack film =
      pictures_track(1, 1, "film", bitmap_info("H264", 640, 480, 24), 640, 480);
  auto other = MatroskaWriter::create(dir / "film.mkv", {}, {film}, {}, {});
  ASSERT_TRUE(other && other->write_frame(1, 0ms, Bytes(50)) && other->close());
  EXPECT_NE(message(dir / "film.mkv").find("no recording of an Azure Kinect"), std::string::npos)
      << message(dir / "film.mkv");
}

TEST(KinectMkv, ReadsLacedSamplesOfTheImu) {
  const TempDir dir;
  for (const auto lacing : {MatroskaLacing::xiph, MatroskaLacing::fixed, MatroskaLacing::ebml}) {
    auto writer = recording(dir / "a.mkv", {});
    add_depth(writer, 0ms);
    std::vector<Bytes> samples(5, Bytes(40));
    for (int i = 0; i < 5; ++i) {
      const std::int64_t ns = 1'000'000 * (i + 1);
      const float g = -9.81f;
      std::memcpy(samples[i].data(), &ns, 8);
      std::memcpy(samples[i].data() + 12, &g, 4);
    }
    const std::vector<MatroskaWriter::Frame> frames(samples.begin(), samples.end());
    ASSERT_TRUE(writer.write_group(200, 1ms, 5ms, frames, lacing));
    ASSERT_TRUE(writer.close());
    auto opened = KinectRecording::open(dir / "a.mkv");
    ASSERT_TRUE(opened);
    std::vector<KinectImuSample> read;
    for (auto block = opened->next(); block && *block; block = opened->next())
      if ((*block)->track == KinectTrack::imu)
        for (const KinectImuSample& sample : decode_imu((*block)->bytes)) read.push_back(sample);
    ASSERT_EQ(read.size(), 5u);
    EXPECT_EQ(read[4].accelerometer_at, TimePoint(5ms));
    EXPECT_EQ(read[4].acceleration_mps2[1], -9.81f);
  }
}

}  // namespace
}  // namespace mr::sensor
