#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <numbers>
#include <numeric>
#include <random>

#include "core/temp_dir.h"
#include "mr/kit/image_io.h"
#include "mr/sensor/depth_to_color.h"
#include "mr/sensor/realsense/captures.h"
#include "mr/sensor/realsense/source.h"
#include "mr/sensor/timelines.h"
#include "support/realsense_bag.h"

namespace mr::sensor {
namespace {
namespace realsense_test {

using namespace std::chrono_literals;
using test::BagCompression;
using test::Bytes;
using test::RealSenseBag;
using test::RealSenseMade;
using test::RosImage;
using test::RosWriter;
using test::TempDir;
using testing::AllOf;
using testing::Contains;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

constexpr int kWidth = 16, kHeight = 8, kColorWidth = 24, kColorHeight = 12;

Camera pinhole(int width, int height, double f) {
  Camera out;
  out.width = width, out.height = height, out.fx = f, out.fy = f + 1;
  out.cx = width / 2.0 - 0.25, out.cy = height / 2.0 + 0.25;
  return out;
}

RealSenseMade made(BagCompression compression = BagCompression::none) {
  RealSenseMade out;
  out.compression = compression;
  out.depth_camera = pinhole(kWidth, kHeight, 14);
  out.color_camera = pinhole(kColorWidth, kColorHeight, 20);
  out.T_color_depth.translation = {0.015, 0.0002, 0.0003};
  return out;
}

/// Pixel i counts `first` + i.
std::vector<std::uint16_t> counts(int first) {
  std::vector<std::uint16_t> out(kWidth * kHeight);
  std::iota(out.begin(), out.end(), static_cast<std::uint16_t>(first));
  return out;
}

Bytes pixels(int first, std::size_t count = 3 * kColorWidth * kColorHeight) {
  Bytes out(count);
  for (std::size_t i = 0; i < count; ++i)
    out[i] = static_cast<std::byte>(static_cast<std::size_t>(first) + 7 * i);
  return out;
}

std::filesystem::path write(const TempDir& dir, const std::string& name, const Bytes& bytes) {
  return dir.write(name, {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
}

/// `frames` pictures of both streams, from 5 s on.
Bytes recorded(const RealSenseMade& of, int frames) {
  RealSenseBag bag(of);
  for (int i = 0; i < frames; ++i) {
    bag.depth(5s + i * 33'333us, counts(600 + 100 * i));
    bag.color(5s + i * 33'333us + 2ms, pixels(i));
  }
  return bag.bag.close();
}

RealSenseHeader header_of(const std::filesystem::path& file) {
  const auto recording = RealSenseRecording::open(file);
  if (!recording) ADD_FAILURE() << recording.error().message;
  return recording ? recording->header() : RealSenseHeader();
}

SensorConfig sensor_of(const std::filesystem::path& file, bool loop = false) {
  const RealSenseHeader header = header_of(file);
  const auto cameras = realsense_cameras(header, file);
  EXPECT_TRUE(cameras) << cameras.error().message;
  RealSenseBagSource source;
  source.file = file, source.loop = loop;
  source.recorded = {"test", header.first.value_or(TimePoint{}), header.last};
  SensorConfig sensor;
  sensor.id = "d435", sensor.source = source;
  if (!cameras) return sensor;
  sensor.depth_camera = cameras->depth, sensor.color_camera = cameras->color;
  sensor.T_color_depth = cameras->T_color_depth;
  sensor.depth_near_m = 0.01, sensor.depth_far_m = 60;
  sensor.T_world_depth = {Pose{}};
  return sensor;
}

std::unique_ptr<FrameSource> open(const SensorConfig& sensor, double fps = 30) {
  return open_realsense_bag(sensor, {}, timelines(std::span(&sensor, 1), fps)[0]);
}

std::string refusal(const std::filesystem::path& file) {
  const auto recording = RealSenseRecording::open(file);
  return recording ? "" : recording.error().message;
}

// --- what a recording says

TEST(RealSenseBag, GivesEveryPixelBack) {
  const TempDir dir;
  for (const auto compression : {BagCompression::none, BagCompression::lz4}) {
    const auto file = write(dir, "a.bag", recorded(made(compression), 4));
    const auto source = open(sensor_of(file));
    for (int i = 0; i < 4; ++i) {
      const auto frame = source->next();
      ASSERT_TRUE(frame && *frame) << frame.error().message;
      EXPECT_EQ((*frame)->captured_at(), TimePoint(i * 33'333us));
      for (int p = 0; p < kWidth * kHeight; ++p)
        ASSERT_EQ((*frame)->depth.data[p], static_cast<float>((600 + 100 * i + p) * 0.001)) << p;
      ASSERT_EQ((*frame)->color.width, kColorWidth);
      const Bytes right = pixels(i);
      for (std::size_t p = 0; p < right.size(); ++p)
        ASSERT_EQ((*frame)->color.data[p], std::to_integer<std::uint8_t>(right[p])) << p;
    }
    const auto end = source->next();
    EXPECT_TRUE(end && !*end);
  }
}

TEST(RealSenseBag, TellsItsHeader) {
  const TempDir dir;
  RealSenseMade of = made();
  of.color_model = "Brown Conrady";
  of.color_coefficients = {0.01, -0.02, 0.003, -0.004, 0.005};
  const auto file = write(dir, "a.bag", recorded(of, 40));
  const RealSenseHeader header = header_of(file);
  EXPECT_EQ(header.name, "Intel RealSense D435");
  EXPECT_EQ(header.serial, "123456789012");
  EXPECT_EQ(header.firmware, "05.12.07.150");
  EXPECT_EQ(header.version, 4u);
  EXPECT_EQ(header.period, 33'333'333ns);
  EXPECT_EQ(header.first, TimePoint(5s));
  EXPECT_EQ(header.last, TimePoint(5s + 39 * 33'333us));
  EXPECT_EQ(header.depth->encoding, "mono16");
  EXPECT_EQ(header.depth->clock, "Hardware Clock");
  EXPECT_THAT(header.notes, IsEmpty());
  const auto cameras = realsense_cameras(header, file);
  ASSERT_TRUE(cameras) << cameras.error().message;
  EXPECT_EQ(cameras->depth, of.depth_camera);
  Camera color = of.color_camera;
  color.distortion = DistortionModel::brown;
  color.k = {0.01, -0.02, 0.005}, color.p = {0.003, -0.004};
  EXPECT_EQ(*cameras->color, color);
  EXPECT_EQ(cameras->T_color_depth.translation.x, 0.015);
}

TEST(RealSenseBag, PicturesOfATurnedColorCameraLieOnDepth) {
  // The colour camera looks 10 degrees to the right of depth: rotation by -10 about y, from depth
  // to colour. The tenth pixel of the third row is 2 m away.
  const double angle = -10 * std::numbers::pi / 180;
  RealSenseMade of = made();
  of.depth_camera = pinhole(kWidth, kHeight, 40), of.color_camera = pinhole(240, 120, 300);
  of.color_camera.cx = 40;
  of.quaternion = {0, std::sin(angle / 2), 0, std::cos(angle / 2)};
  of.T_color_depth.translation = {0.015, 0.01, 0};
  const Vec3d point = 2 * unproject(of.depth_camera, {10, 3});
  const Vec3d turned{std::cos(angle) * point.x + std::sin(angle) * point.z + 0.015, point.y + 0.01,
                     -std::sin(angle) * point.x + std::cos(angle) * point.z};
  const auto seen = project(of.color_camera, turned);
  ASSERT_TRUE(seen && seen->x > 5 && seen->x < 235 && seen->y > 5 && seen->y < 115) << seen->x;
  Bytes color(3 * 240 * 120);
  for (int y = -2; y <= 2; ++y)
    for (int x = -2; x <= 2; ++x)
      color[3 * static_cast<std::size_t>(std::lround(seen->y + y) * 240 +
                                         std::lround(seen->x + x))] = std::byte{255};
  const TempDir dir;
  // q and -q are one rotation: older recorders write the one, newer ones the other.
  for (const int sign : {1, -1}) {
    for (double& v : of.quaternion) v *= sign;
    RealSenseBag bag(of);
    bag.depth(5s, std::vector<std::uint16_t>(kWidth * kHeight, 2000));
    bag.color(5s, color);
    const SensorConfig sensor = sensor_of(write(dir, "a.bag", bag.bag.close()));
    const auto frame = open(sensor)->next();
    ASSERT_TRUE(frame && *frame) << frame.error().message;
    const DepthColors colors =
        color_for_depth((*frame)->depth, (*frame)->color, sensor.depth_camera, *sensor.color_camera,
                        sensor.T_color_depth);
    EXPECT_EQ(*colors.seen.at(10, 3), 1);
    EXPECT_EQ(colors.color.at(10, 3)[0], 255);
    EXPECT_EQ(colors.color.at(5, 3)[0], 0);
  }
}

TEST(RealSenseBag, TransformsAreFromTheReferenceOfTheirGroup) {
  RealSenseMade of = made();
  of.quaternion = {0, 0, std::sqrt(0.5), std::sqrt(0.5)};  // x becomes y
  const auto transform = [](double x) {
    RosWriter out;
    for (const double v : {x, 0., 0., 0., 0., 0., 1.}) out.put(v);
    return out.out;
  };
  const TempDir dir;
  for (const char* group : {"0", "1"}) {
    RealSenseBag bag(of);
    bag.bag.message(std::string(RealSenseBag::kDepth) + "/tf/" + group, "geometry_msgs/Transform",
                    {}, transform(0.1));
    bag.depth(5s, counts(600)), bag.color(5s, pixels(0));
    const RealSenseHeader header = header_of(write(dir, "a.bag", bag.bag.close()));
    const Vec3d t = header.T_color_depth.translation;
    const bool is_one = std::string_view(group) == "0";
    EXPECT_NEAR(t.x, is_one ? 0.015 : 0, 1e-9);
    EXPECT_NEAR(t.y, is_one ? 0.0002 - 0.1 : 0, 1e-9);
    EXPECT_EQ(header.notes.size(), is_one ? 0u : 1u) << "groups that have nothing in common";
  }
}

TEST(RealSenseBag, FindsTheUnitOfDepth) {
  const TempDir dir;
  const auto unit = [&](const RealSenseMade& of) {
    return header_of(write(dir, "a.bag", recorded(of, 1))).depth_unit_m;
  };
  RealSenseMade of = made();
  of.unit_m = 0.0001f, of.option_unit_m = 0.002f;
  EXPECT_EQ(unit(of), 0.0001) << "what the pictures say counts more";
  of.unit_m.reset();
  EXPECT_EQ(unit(of), 0.002);
  of.option_name = "Depth Units", of.version = 3, of.option_unit_m = 0.00025f;
  EXPECT_EQ(unit(of), 0.00025);
  of.version = 2;
  EXPECT_EQ(unit(of), 0.00025);
  of.option_unit_m = 17.0f;
  EXPECT_EQ(unit(of), 0.001) << "an impossible one";
  EXPECT_THAT(header_of(dir / "a.bag").notes, Contains(HasSubstr("no unit of depth")));
  SensorConfig sensor = sensor_of(dir / "a.bag");
  sensor.source.get_if<RealSenseBagSource>()->depth_unit_m = 0.01;
  const auto frame = open(sensor)->next();
  ASSERT_TRUE(frame && *frame);
  EXPECT_EQ((*frame)->depth.data[0], 6.0f);
}

TEST(RealSenseBag, LensModels) {
  const TempDir dir;
  const auto cameras = [&](const char* model, double k1) {
    RealSenseMade of = made();
    of.color_model = model, of.color_coefficients[0] = k1;
    const auto file = write(dir, "a.bag", recorded(of, 1));
    return realsense_cameras(header_of(file), file);
  };
  for (const char* model : {"Brown Conrady", "Inverse Brown Conrady", "None"}) {
    const auto plain = cameras(model, 0);
    ASSERT_TRUE(plain) << plain.error().message;
    EXPECT_EQ(plain->color->distortion, DistortionModel::none) << model;
  }
  EXPECT_THAT(realsense_lens_notes(header_of(dir / "a.bag")), IsEmpty());
  for (const char* model : {"Brown Conrady", "Modified Brown Conrady", "Inverse Brown Conrady"}) {
    const auto bent = cameras(model, 0.1);
    ASSERT_TRUE(bent) << bent.error().message;
    EXPECT_EQ(bent->color->distortion, DistortionModel::brown) << model;
    EXPECT_EQ(bent->color->k[0], 0.1);
  }
  EXPECT_THAT(realsense_lens_notes(header_of(dir / "a.bag")),
              Contains(HasSubstr("state color_camera in the scene")));
  for (const char* model : {"Ftheta", "Kannala Brandt4", "new\none"}) {
    const auto none = cameras(model, 0);
    ASSERT_FALSE(none);
    EXPECT_THAT(none.error().message, HasSubstr("a.bag: colour: its lens model '"));
    EXPECT_EQ(none.error().message.find('\n'), std::string::npos);
  }
}

TEST(RealSenseBag, SaysWhatIsMissing) {
  const TempDir dir;
  const auto camera_error = [&](const RealSenseMade& of) {
    const auto file = write(dir, "a.bag", recorded(of, 2));
    const auto cameras = realsense_cameras(header_of(file), file);
    return cameras ? "" : cameras.error().message;
  };
  RealSenseMade of = made();
  of.depth_info = false;
  EXPECT_THAT(camera_error(of), HasSubstr("depth: the recording has no camera_info of it"));
  of = made(), of.color_info = false;
  EXPECT_THAT(camera_error(of), HasSubstr("colour: the recording has no camera_info of it"));
  of = made(), of.color_camera.fx = 0;
  EXPECT_THAT(camera_error(of), HasSubstr("colour: camera_info: focal"));
  of = made(), of.tf = false;
  EXPECT_EQ(camera_error(of), "");
  EXPECT_THAT(header_of(dir / "a.bag").notes, Contains(HasSubstr("state T_color_depth")));
  of = made(), of.quaternion = {3, 0, 0, 0};
  EXPECT_EQ(camera_error(of), "");
  EXPECT_THAT(header_of(dir / "a.bag").notes, Contains(HasSubstr("state T_color_depth")));
  of = made(), of.serial = "", of.version = 9, of.fps = 0;
  EXPECT_EQ(camera_error(of), "");
  EXPECT_THAT(header_of(dir / "a.bag").notes,
              AllOf(Contains("no serial number"), Contains(HasSubstr("version 9")),
                    Contains(HasSubstr("no rate of depth"))));

  RealSenseBag color_only(made());
  color_only.color(5s, pixels(0));
  const auto no_depth = write(dir, "color.bag", color_only.bag.close());
  EXPECT_THAT(header_of(no_depth).notes, Contains(HasSubstr("no picture of depth")));
  const auto cameras = realsense_cameras(header_of(no_depth), no_depth);
  ASSERT_FALSE(cameras);
  EXPECT_THAT(cameras.error().message, HasSubstr("color.bag: it has no depth stream"));
  RealSenseBag nothing(made());
  EXPECT_THAT(refusal(write(dir, "none.bag", nothing.bag.close())),
              HasSubstr("none.bag: no recording of a RealSense"));
}

TEST(RealSenseBag, ReadsTheFirstOfSeveralStreamsAndDevices) {
  const TempDir dir;
  RealSenseBag bag(made());
  RosImage other{5s, 4, 2, "mono16", Bytes(16), 8};
  bag.picture("/device_0/sensor_4/Depth_1", other);
  bag.picture("/device_1/sensor_0/Depth_0", other);
  bag.picture("/device_0/sensor_0/Infrared_1", {5s, 4, 2, "8UC1", Bytes(8), 4});
  bag.depth(5s, counts(600)), bag.color(5s, pixels(0));
  const auto file = write(dir, "a.bag", bag.bag.close());
  EXPECT_THAT(header_of(file).notes,
              AllOf(Contains("2 streams of depth: /device_0/sensor_0/Depth_0 is read"),
                    Contains("several devices: the first (device_0) is read")));
  auto recording = RealSenseRecording::open(file);
  ASSERT_TRUE(recording);
  int read = 0;
  for (auto picture = recording->next(); picture && *picture; picture = recording->next()) ++read;
  EXPECT_EQ(read, 2);
}

TEST(RealSenseBag, ClocksOfOneComputerAreOne) {
  const TempDir dir;
  const auto domain = [&](const char* clock, const char* serial) {
    RealSenseMade of = made();
    of.clock = clock, of.serial = serial;
    const auto file = write(dir, "a.bag", recorded(of, 2));
    yaml::Report report("scene.yaml", {});
    const yaml::Tree tree = yaml::parse_yaml("{file: " + file.string() + "}");
    yaml::MapReader map(report, tree.root, "source");
    const SourceKeys keys = read_realsense_bag(map, "source");
    EXPECT_TRUE(keys.config.clock().has_value());
    EXPECT_EQ(keys.config.content().items, 2u);
    return keys.config.clock()->domain;
  };
  EXPECT_EQ(domain("Global Time", "1"), domain("System Time", "2"));
  EXPECT_NE(domain("Hardware Clock", "1"), domain("Hardware Clock", "2"));
  EXPECT_EQ(domain("Hardware Clock", "1"), domain("Hardware Clock", "1"));
}

// --- pictures

/// The first pixels of a colour picture of 2x1 pixels; empty: refused.
ImageRgb::Values decoded(const std::string& encoding, const std::vector<int>& bytes,
                         std::uint32_t step = 0) {
  RealSensePicture picture;
  picture.width = 2, picture.height = 1, picture.encoding = encoding;
  Bytes data;
  for (const int b : bytes) data.push_back(static_cast<std::byte>(b));
  picture.step_bytes = step == 0 ? static_cast<std::uint32_t>(data.size()) : step;
  picture.bytes = std::make_shared<const Bytes>(std::move(data));
  const auto out = decode_realsense_color(picture);
  EXPECT_TRUE(out || out.error().message.find('\n') == std::string::npos);
  return out ? out->data : ImageRgb::Values();
}

TEST(RealSenseBag, ColorEncodings) {
  const ImageRgb::Values right{1, 2, 3, 4, 5, 6};
  EXPECT_EQ(decoded("rgb8", {1, 2, 3, 4, 5, 6}), right);
  EXPECT_EQ(decoded("RGB8", {1, 2, 3, 4, 5, 6}), right);
  EXPECT_EQ(decoded("bgr8", {3, 2, 1, 6, 5, 4}), right);
  EXPECT_EQ(decoded("rgba8", {1, 2, 3, 9, 4, 5, 6, 9}), right);
  EXPECT_EQ(decoded("bgra8", {3, 2, 1, 9, 6, 5, 4, 9}), right);
  EXPECT_EQ(decoded("rgb8", {1, 2, 3, 4, 5, 6, 0, 0}, 8), right) << "gap behind the row";
  // White, then black.
  const ImageRgb::Values white_black{255, 255, 255, 0, 0, 0};
  EXPECT_EQ(decoded("YUYV", {235, 128, 16, 128}), white_black);
  EXPECT_EQ(decoded("yuv422", {128, 235, 128, 16}), white_black);
  EXPECT_THAT(decoded("rgb8", {1, 2, 3, 4, 5}), IsEmpty());
  EXPECT_THAT(decoded("rgb8", {1, 2, 3, 4, 5, 6}, 5), IsEmpty());
  EXPECT_THAT(decoded("rgb8", {1, 2, 3, 4, 5, 6}, 0xffffffff), IsEmpty());
  EXPECT_THAT(decoded("RAW10\n", {1, 2, 3}), IsEmpty());
  EXPECT_THAT(decoded("MJPEG", {1, 2, 3}), IsEmpty());

  RealSensePicture jpeg;
  jpeg.width = 32, jpeg.height = 16, jpeg.encoding = "MJPEG";
  jpeg.bytes = std::make_shared<const Bytes>(
      kit::encode_jpeg(ImageRgb(32, 16, std::uint8_t{90}), 90).operator*());
  const auto grey = decode_realsense_color(jpeg);
  ASSERT_TRUE(grey) << grey.error().message;
  EXPECT_NEAR(grey->data[0], 90, 1);
  jpeg.width = 31;
  EXPECT_FALSE(decode_realsense_color(jpeg));
  EXPECT_FALSE(decode_realsense_color({}));
}

TEST(RealSenseBag, DepthHonoursStepAndByteOrder) {
  std::vector<float> table(65536);
  std::iota(table.begin(), table.end(), 0.0f);
  RealSensePicture picture;
  picture.width = 2, picture.height = 2, picture.encoding = "mono16", picture.step_bytes = 5;
  const Bytes bytes{std::byte{1}, std::byte{2}, std::byte{3}, std::byte{4}, std::byte{99},
                    std::byte{5}, std::byte{6}, std::byte{7}, std::byte{8}};
  picture.bytes = std::make_shared<const Bytes>(bytes);
  const auto little = decode_realsense_depth(picture, table);
  ASSERT_TRUE(little) << little.error().message;
  EXPECT_EQ(little->data, (ImageDepth::Values{0x0201, 0x0403, 0x0605, 0x0807}));
  picture.big_endian = true, picture.encoding = "Z16";
  const auto big = decode_realsense_depth(picture, table);
  ASSERT_TRUE(big);
  EXPECT_EQ(big->data, (ImageDepth::Values{0x0102, 0x0304, 0x0506, 0x0708}));
  for (const std::uint32_t step : {0u, 3u, 6u, 0xffffffffu}) {
    picture.step_bytes = step;
    EXPECT_FALSE(decode_realsense_depth(picture, table)) << step;
  }
  picture.step_bytes = 5, picture.encoding = "8UC1";
  const auto other = decode_realsense_depth(picture, table);
  ASSERT_FALSE(other);
  EXPECT_THAT(other.error().message, HasSubstr("its encoding is '8UC1'"));
}

/// Which colour (by its first byte) each depth picture gets; "-": none.
std::string pairs(const std::filesystem::path& file) {
  auto recording = RealSenseRecording::open(file);
  EXPECT_TRUE(recording) << recording.error().message;
  RealSenseCaptures captures(*std::move(recording), true);
  std::string out;
  for (auto c = captures.next(); c && *c; c = captures.next())
    out += (*c)->color ? std::to_string(std::to_integer<int>((*c)->color->bytes->front())) + " "
                       : "- ";
  return out;
}

TEST(RealSenseBag, PairsDepthWithTheNearestColor) {
  const TempDir dir;
  {
    RealSenseBag bag(made());  // colour comes first, then is lost for a while
    bag.color(4990ms, pixels(1));
    for (int i = 0; i < 6; ++i) {
      bag.depth(5s + i * 33ms, counts(600));
      if (i < 2 || i > 3) bag.color(5s + i * 33ms + 15ms, pixels(10 + i));
    }
    EXPECT_EQ(pairs(write(dir, "a.bag", bag.bag.close())), "1 11 - - 14 15 ");
  }
  {
    RealSenseBag bag(made());  // depth twice as often; colour is written late
    for (int i = 0; i < 4; ++i) {
      bag.depth(5s + i * 33ms, counts(600)), bag.depth(5s + i * 33ms + 16ms, counts(600));
      bag.color(5s + i * 33ms + 1ms, pixels(10 + i));
    }
    EXPECT_EQ(pairs(write(dir, "b.bag", bag.bag.close())), "10 10 11 11 12 12 13 13 ");
  }
}

TEST(RealSenseBag, ADamagedPictureCostsItselfAlone) {
  const TempDir dir;
  RealSenseBag bag(made());
  bag.depth(5s, counts(600));
  bag.color(5s, pixels(0, 100));
  bag.picture(RealSenseBag::kDepth, {5s + 33ms, kWidth, kHeight, "mono16", Bytes(9), 2 * kWidth});
  bag.bag.message(std::string(RealSenseBag::kDepth) + "/image/data", "sensor_msgs/Image", 4133ms,
                  RosWriter().put(0u).time(5s + 66ms).text("1").put(3u).out);
  bag.depth(5s + 100ms, counts(700));
  bag.color(5s + 100ms, pixels(3));
  const auto source = open(sensor_of(write(dir, "a.bag", bag.bag.close())));
  const auto first = source->next();
  ASSERT_TRUE(first && *first) << first.error().message;
  EXPECT_TRUE((*first)->color.empty());
  ASSERT_TRUE((*first)->color_lost.has_value());
  EXPECT_THAT((*first)->color_lost->message, HasSubstr("a.bag: colour: "));
  const auto second = source->next();
  ASSERT_FALSE(second);
  EXPECT_THAT(second.error().message, HasSubstr("a.bag: depth: 9 bytes with rows of 32"));
  const auto third = source->next();
  ASSERT_FALSE(third);
  EXPECT_THAT(third.error().message, HasSubstr("a.bag: depth: its message is damaged"));
  const auto fourth = source->next();
  ASSERT_TRUE(fourth && *fourth);
  EXPECT_EQ((*fourth)->depth.data[0], 0.7f);
  EXPECT_FALSE((*fourth)->color.empty());
}

TEST(RealSenseBag, ADamagedStampCostsItsOwnPictureAlone) {
  const TempDir dir;
  for (const bool color : {false, true}) {
    RealSenseBag bag(made());
    for (int i = 0; i < 60; ++i) {
      bag.stamp_error = i == 5 && !color ? Duration(1h) : Duration{};
      bag.depth(5s + i * 33'333us, counts(600));
      bag.stamp_error = i == 5 && color ? Duration(1h) : Duration{};
      bag.color(5s + i * 33'333us + 5ms, pixels(i));
    }
    const auto source = open(sensor_of(write(dir, "a.bag", bag.bag.close())));
    int colored = 0;
    for (int i = 0; i < 60; ++i)
      if (const auto frame = source->next(); frame && *frame) colored += !(*frame)->color.empty();
    EXPECT_GE(colored, 55) << color;
  }
}

TEST(RealSenseBag, ACounterThatBeginsAnewGoesOn) {
  const TempDir dir;
  RealSenseBag bag(made());
  const Duration round = std::chrono::microseconds(std::int64_t{1} << 32);
  for (int i = 0; i < 6; ++i) {
    bag.stamp_error = i >= 3 ? -round : Duration{};
    bag.depth(round - 90ms + i * 33'333us, counts(600 + i));
  }
  const auto file = write(dir, "a.bag", bag.bag.close());
  const RealSenseHeader header = header_of(file);
  ASSERT_TRUE(header.first && header.last);
  EXPECT_EQ(*header.last - *header.first, 5 * 33'333us);
  const auto source = open(sensor_of(file));
  for (int i = 0; i < 6; ++i) {
    const auto frame = source->next();
    ASSERT_TRUE(frame && *frame) << i;
    EXPECT_EQ((*frame)->captured_at(), TimePoint(i * 33'333us));
  }
}

TEST(RealSenseBag, FirstPicturesOfAnotherClockAreLeftOut) {
  const TempDir dir;
  for (const bool index : {true, false}) {
    RealSenseBag bag(made());
    const Duration since_1970 = std::chrono::hours(24 * 365 * 50);
    for (int i = 0; i < 8; ++i) {
      bag.stamp_error = i >= 2 ? since_1970 : Duration{};
      bag.made().clock = i >= 2 ? "Global Time" : "Hardware Clock";
      bag.depth(5s + i * 33'333us, counts(600 + i));
    }
    const auto file = write(dir, "a.bag", index ? bag.bag.close() : bag.bag.kill());
    const RealSenseHeader header = header_of(file);
    EXPECT_EQ(header.first, TimePoint(since_1970 + 5s + 2 * 33'333us)) << index;
    EXPECT_EQ(header.depth->clock, "Global Time");
    EXPECT_THAT(header.notes, Contains(HasSubstr("stamped by another clock"))) << index;
    const auto source = open(sensor_of(file));
    const auto frame = source->next();
    ASSERT_TRUE(frame && *frame);
    EXPECT_EQ((*frame)->depth.data[0], static_cast<float>(602 * 0.001));
  }
}

TEST(RealSenseBag, TheUnitMayChange) {
  const TempDir dir;
  RealSenseBag bag(made());
  bag.depth(5s, counts(600));
  bag.made().unit_m = 0.0001f;
  bag.depth(5s + 33'333us, counts(6000));
  const auto source = open(sensor_of(write(dir, "a.bag", bag.bag.close())));
  for (int i = 0; i < 2; ++i) {
    const auto frame = source->next();
    ASSERT_TRUE(frame && *frame);
    EXPECT_FLOAT_EQ((*frame)->depth.data[0], 0.6f) << i;
  }
}

TEST(RealSenseBag, GapsAreGaps) {
  const TempDir dir;
  RealSenseBag bag(made());
  for (const int i : {0, 1, 3}) {
    bag.depth(5s + i * 33'333us, counts(600 + i));
    if (i != 1) bag.color(5s + i * 33'333us, pixels(i));
  }
  const auto source = open(sensor_of(write(dir, "a.bag", bag.bag.close())));
  EXPECT_FALSE((*source->next())->color.empty());
  const auto without = source->next();
  ASSERT_TRUE(without && *without);
  EXPECT_THAT((*without)->color_lost->message, HasSubstr("no picture near depth's"));
  const auto gap = source->next();
  EXPECT_TRUE(!gap && is_gap(gap.error()));
  const auto after = source->next();
  ASSERT_TRUE(after && *after);
  EXPECT_EQ((*after)->depth.data[0], static_cast<float>(0.603));
}

TEST(RealSenseBag, SkipsSeeksAndStartsAgain) {
  const TempDir dir;
  for (const bool index : {true, false}) {
    RealSenseBag bag(made());
    for (int i = 0; i < 150; ++i) bag.depth(5s + i * 33'333us, counts(600 + i));
    const auto file = write(dir, "a.bag", index ? bag.bag.close() : bag.bag.kill());
    const auto source = open(sensor_of(file, index));  // without one it does not loop here
    source->skip(100);
    auto frame = source->next();
    ASSERT_TRUE(frame && *frame) << frame.error().message;
    EXPECT_EQ((*frame)->depth.data[0], static_cast<float>(700 * 0.001)) << index;
    source->skip(48);
    frame = source->next();
    ASSERT_TRUE(frame && *frame) << frame.error().message;
    EXPECT_EQ((*frame)->depth.data[0], static_cast<float>(749 * 0.001));
    frame = source->next();
    ASSERT_TRUE(frame) << frame.error().message;
    EXPECT_EQ(frame->has_value(), index) << "the next round";
    if (!index) continue;
    EXPECT_EQ((*frame)->depth.data[0], static_cast<float>(600 * 0.001));
    EXPECT_EQ((*frame)->index, 150u);
  }
}

TEST(RealSenseBag, SeekingReadsLittle) {
  const TempDir dir;
  RealSenseBag bag(made());
  for (int i = 0; i < 300; ++i) bag.depth(5s + i * 33'333us, counts(600 + i));
  const auto file = write(dir, "a.bag", bag.bag.close());
  auto recording = RealSenseRecording::open(file);
  ASSERT_TRUE(recording);
  const TimePoint wanted(5s + 200 * 33'333us);
  ASSERT_TRUE(recording->seek(wanted));
  int read = 0;
  for (auto picture = recording->next(); picture && *picture; picture = recording->next(), ++read)
    if ((*picture)->at >= wanted) {
      EXPECT_EQ((*picture)->at, wanted);
      break;
    }
  EXPECT_LT(read, 60) << "a second and a chunk";
  EXPECT_GT(read, 10);
}

TEST(RealSenseBag, SeekingAheadWithoutAnIndexGoesOn) {
  const TempDir dir;
  RealSenseBag bag(made());
  for (int i = 0; i < 90; ++i) bag.depth(5s + i * 33'333us, counts(600 + i));
  auto recording = RealSenseRecording::open(write(dir, "a.bag", bag.bag.kill()));
  ASSERT_TRUE(recording);
  for (int i = 0; i < 30; ++i) ASSERT_TRUE(recording->next());
  ASSERT_TRUE(recording->seek(TimePoint(5s + 80 * 33'333us)));
  const auto ahead = recording->next();
  ASSERT_TRUE(ahead && *ahead);
  EXPECT_EQ((*ahead)->at, TimePoint(5s + 30 * 33'333us)) << "what was read is not read again";
  ASSERT_TRUE(recording->seek(TimePoint(5s)));
  const auto back = recording->next();
  ASSERT_TRUE(back && *back);
  EXPECT_EQ((*back)->at, TimePoint(5s));
}

// --- files that break off, are damaged, or lie

TEST(RealSenseBag, WhatWasNeverClosedIsReadAsFarAsItGoes) {
  const TempDir dir;
  for (const auto compression : {BagCompression::none, BagCompression::lz4}) {
    RealSenseBag bag(made(compression));
    for (int i = 0; i < 20; ++i) bag.depth(5s + i * 33'333us, counts(600 + i));
    const auto file = write(dir, "a.bag", bag.bag.kill());
    const RealSenseHeader header = header_of(file);
    EXPECT_THAT(header.notes, Contains(HasSubstr("was not closed properly")));
    EXPECT_FALSE(header.last.has_value());
    const auto source = open(sensor_of(file));
    int frames = 0;
    auto frame = source->next();
    for (; frame && *frame; frame = source->next()) ++frames;
    EXPECT_TRUE(frame.ok()) << frame.error().message;
    EXPECT_GE(frames, compression == BagCompression::none ? 20 : 10);
  }
}

/// Reads a file to its end: how many pictures there were, and the error's line.
std::pair<int, std::string> read_all(const std::filesystem::path& file) {
  auto recording = RealSenseRecording::open(file);
  std::pair<int, std::string> out;
  while (recording) {
    const auto picture = recording->next();
    if (!picture) out.second = picture.error().message;
    if (!picture || !*picture) break;
    ++out.first;
  }
  if (!recording) out.second = recording.error().message;
  if (!out.second.empty()) {
    EXPECT_THAT(out.second, HasSubstr(file.string() + ": "));
    EXPECT_EQ(out.second.find('\n'), std::string::npos) << out.second;
  }
  return out;
}

TEST(RealSenseBag, TruncatedAnywhereGivesWhatIsWholeAndOneLine) {
  const TempDir dir;
  for (const auto compression : {BagCompression::none, BagCompression::lz4}) {
    const Bytes whole = recorded(made(compression), 3);
    EXPECT_EQ(read_all(write(dir, "a.bag", whole)).first, 6);
    int before = 0;
    for (std::size_t size = 0; size < whole.size(); size += size < 4100 ? 397 : 41) {
      const auto [pictures, error] =
          read_all(write(dir, "a.bag", Bytes(whole.begin(), whole.begin() + std::ptrdiff_t(size))));
      EXPECT_GE(pictures, before) << size;
      before = pictures;
      // Between two records of the index nothing is missing.
      EXPECT_TRUE(pictures == 6 || error != "") << size << " of " << whole.size();
    }
    EXPECT_EQ(before, 6);
  }
}

TEST(RealSenseBag, DamagedBytesAreNoCrash) {
  const TempDir dir;
  std::mt19937 random(1);
  for (const auto compression : {BagCompression::none, BagCompression::lz4}) {
    const Bytes whole = recorded(made(compression), 2);
    for (int i = 0; i < 150; ++i) {
      Bytes bytes = whole;
      // The record at the beginning is mostly padding.
      const std::size_t from = i % 5 == 0 ? 13 : 4096;
      for (int n = 0; n < 1 + i % 3; ++n)
        bytes[from + random() % (bytes.size() - from)] = static_cast<std::byte>(random());
      read_all(write(dir, "a.bag", bytes));
    }
  }
}

/// A file of one chunk that says what it likes.
Bytes one_chunk(const std::string& compression, std::uint32_t size, const Bytes& data) {
  Bytes out = test::BagWriter(BagCompression::none).close();
  RosWriter header;
  header.field("op", std::uint8_t{5}).field("compression", compression).field("size", size);
  const Bytes chunk = RosWriter().counted(header.out).counted(data).out;
  out.insert(out.end(), chunk.begin(), chunk.end());
  return out;
}

TEST(RealSenseBag, ClaimsAreNotBelieved) {
  const TempDir dir;
  const auto error = [&](const Bytes& bytes) {
    return read_all(write(dir, "a.bag", bytes)).second;
  };
  EXPECT_THAT(error(one_chunk("lz4", 60 << 20, Bytes(100))), HasSubstr("an LZ4 chunk"));
  EXPECT_THAT(error(one_chunk("lz4", 0xffffffff, Bytes(100))), HasSubstr("more than 64 MiB"));
  EXPECT_THAT(error(one_chunk("none", 0xffffffff, {})), HasSubstr("more than 64 MiB"));
  EXPECT_THAT(error(one_chunk("zip\n", 9, Bytes(9))), HasSubstr("compressed by 'zip?'"));
  EXPECT_THAT(error(one_chunk("none", 9, Bytes(9, std::byte{255}))), HasSubstr("a chunk"));
  // A frame that holds more, or less, than the chunk says.
  const Bytes text(5000, std::byte{'a'});
  Bytes frame(LZ4F_compressFrameBound(text.size(), nullptr));
  frame.resize(LZ4F_compressFrame(frame.data(), frame.size(), text.data(), text.size(), nullptr));
  for (const std::uint32_t size : {0u, 4999u, 5001u})
    EXPECT_THAT(error(one_chunk("lz4", size, frame)), HasSubstr("an LZ4 chunk")) << size;
  Bytes long_header = test::BagWriter(BagCompression::none).close();
  const Bytes claim = RosWriter().put(0x7fffffffu).out;
  long_header.insert(long_header.end(), claim.begin(), claim.end());
  EXPECT_THAT(error(long_header), HasSubstr("no record"));
}

TEST(RealSenseBag, RefusesWhatItIsNot) {
  const TempDir dir;
  EXPECT_THAT(refusal(dir / "none.bag"), HasSubstr("none.bag: there is no such file"));
  EXPECT_THAT(refusal(dir.write("text.bag", "hello")), HasSubstr("text.bag: no ROS bag"));
  EXPECT_THAT(refusal(dir.write("old.bag", "#ROSBAG V1.2\n1234")), HasSubstr("another version"));
  EXPECT_THAT(refusal(dir.write("cut.bag", std::string("#ROSBAG V2.0\n\x45\0\0\0op=", 20))),
              HasSubstr("cut.bag: a ROS bag whose header is damaged or truncated"));
  EXPECT_THAT(refusal(write(dir, "bz2.bag", recorded(made(BagCompression::bz2), 1))),
              AllOf(HasSubstr("bz2.bag: "), HasSubstr("bz2"), HasSubstr("rosbag decompress")));
  test::BagWriter robot(BagCompression::none);
  robot.message("/odom", "nav_msgs/Odometry", 1s, Bytes(50));
  EXPECT_THAT(refusal(write(dir, "robot.bag", robot.close())),
              HasSubstr("robot.bag: no recording of a RealSense"));
}

// --- info and import

TEST(RealSenseBag, IsDescribed) {
  const TempDir dir;
  RealSenseMade of = made();
  of.device = "Intel RealSense L515", of.unit_m = 0.00025f;
  const auto file = write(dir, "my rec.bag", recorded(of, 4));
  const RecordingFormat* format = recognize(file);
  ASSERT_NE(format, nullptr);
  EXPECT_EQ(format->name, "RealSense recording (.bag)");
  const auto info = format->describe(file);
  ASSERT_TRUE(info) << info.error().message;
  const auto field = [&](const std::string& name) {
    const auto found = std::ranges::find(info->fields, name, &RecordingInfo::Field::name);
    return found == info->fields.end() ? testing::PrintToString(name) + " is missing"
                                       : testing::PrintToString(found->value);
  };
  EXPECT_THAT(field("device"), HasSubstr("L515"));
  EXPECT_THAT(field("depth_pictures"), HasSubstr("4"));
  EXPECT_THAT(field("color_pictures"), HasSubstr("4"));
  EXPECT_THAT(field("depth_unit"), HasSubstr("0.00025"));
  EXPECT_THAT(field("depth_unit_from"), HasSubstr("its pictures"));
  EXPECT_THAT(field("first_median"), HasSubstr("0.166"));
  EXPECT_THAT(field("first_color_seen_ratio"), Not(HasSubstr("missing")));
  EXPECT_THAT(info->notes, IsEmpty());
  const auto scene = format->import(file);
  ASSERT_TRUE(scene) << scene.error().message;
  ASSERT_EQ(scene->sensors.size(), 1u);
  EXPECT_EQ(scene->fps, 30);
  EXPECT_THAT(scene->sensors[0].source, HasSubstr("{type: realsense-bag, file: \""));
  EXPECT_THAT(scene->sensors[0].comments, Contains(HasSubstr("serial 123456789012")));

  Bytes cut = recorded(made(), 4);
  cut.resize(cut.size() - 3000);
  const auto broken = format->describe(write(dir, "cut.bag", cut));
  ASSERT_TRUE(broken) << broken.error().message;
  EXPECT_THAT(broken->notes, AllOf(Contains(HasSubstr("its index is damaged or missing")),
                                   Contains(HasSubstr("cut.bag: cut off after"))));
}

}  // namespace realsense_test
}  // namespace
}  // namespace mr::sensor
