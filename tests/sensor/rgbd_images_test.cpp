#include "mr/sensor/rgbd_images.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/temp_dir.h"
#include "mr/core/file.h"
#include "mr/kit/image_io.h"
#include "support/pictures.h"

namespace mr::sensor {
namespace {

using test::TempDir;
using testing::AllOf;
using testing::HasSubstr;

constexpr int kWidth = 12, kHeight = 8, kColorWidth = 20, kColorHeight = 10;

Camera camera_of(int width, int height) {
  Camera c;
  c.width = width, c.height = height;
  c.fx = c.fy = width, c.cx = width / 2, c.cy = height / 2;
  return c;
}

SensorConfig sensor_of(RgbdImagesSource source) {
  SensorConfig sensor;
  sensor.id = "a";
  if (!source.color.empty()) sensor.color_camera = camera_of(kColorWidth, kColorHeight);
  sensor.source = std::move(source);
  sensor.depth_camera = camera_of(kWidth, kHeight);
  sensor.T_world_depth = {Pose{}};
  return sensor;
}

std::string depth_of(std::uint16_t count) {
  Image<std::uint16_t, 1> image(kWidth, kHeight, count);
  return test::depth_png(image);
}

std::string jpeg_of(const ImageRgb& image) {
  const auto bytes = kit::encode_jpeg(image, 95);
  return {reinterpret_cast<const char*>(bytes->data()), bytes->size()};
}

/// The next frame, which must be there.
Frame frame_of(FrameSource& source) {
  auto frame = source.next();
  if (!frame)
    ADD_FAILURE() << frame.error().message;
  else if (!*frame)
    ADD_FAILURE() << "the source has ended";
  else
    return **frame;
  return {};
}

bool has_ended(FrameSource& source) {
  const auto frame = source.next();
  return frame.ok() && !*frame;
}

TEST(RgbdImages, ReadsPngJpegAndPgm) {
  const TempDir dir;
  const auto counts = test::counting_depth(kWidth, kHeight);
  const auto color = test::gradient(kColorWidth, kColorHeight);
  ASSERT_TRUE(kit::write_png(dir / "1.png", color).ok());
  const auto source =
      open_rgbd_images(sensor_of({.color = {dir.write("0.jpg", jpeg_of(color)), dir / "1.png"},
                                  .depth = {dir.write("0.d.png", test::depth_png(counts)),
                                            dir.write("1.pgm", test::depth_pgm(counts))}}),
                       SensorId{3}, {10});
  const Frame a = frame_of(*source), b = frame_of(*source);
  EXPECT_TRUE(has_ended(*source));
  EXPECT_TRUE(has_ended(*source));
  EXPECT_EQ(a.depth, b.depth);
  EXPECT_FLOAT_EQ(*a.depth.at(3, 0), counts.data[3] * 0.001f);
  EXPECT_EQ(b.color, color);
  EXPECT_EQ(a.color.width, kColorWidth);
  EXPECT_EQ(a.sensor, SensorId{3});
  EXPECT_EQ(a.index, 0u);
  EXPECT_EQ(b.index, 1u);
  EXPECT_EQ(b.exposure_start, TimePoint(std::chrono::milliseconds(100)));
  EXPECT_EQ(b.exposure_end, b.exposure_start);
}

TEST(RgbdImages, UnitsInvalidCountsAndRange) {
  const TempDir dir;
  Image<std::uint16_t, 1> counts(kWidth, kHeight, 2000);
  counts.data[0] = 0, counts.data[1] = 65535, counts.data[2] = 777;
  counts.data[3] = 5001, counts.data[4] = 499, counts.data[5] = 500, counts.data[6] = 5000;
  SensorConfig sensor = sensor_of({.color = {},
                                   .depth = {dir.write("d.png", test::depth_png(counts))},
                                   .depth_unit_m = 0.0002,
                                   .invalid = {0, 65535, 777}});
  sensor.depth_near_m = 0.1, sensor.depth_far_m = 1.0;
  const Frame frame = frame_of(*open_rgbd_images(sensor, SensorId{0}, {30}));
  for (const int i : {0, 1, 2, 3, 4}) EXPECT_EQ(frame.depth.data[i], 0) << i;
  EXPECT_FLOAT_EQ(frame.depth.data[5], 0.1f);
  EXPECT_FLOAT_EQ(frame.depth.data[6], 1.0f);
  EXPECT_FLOAT_EQ(frame.depth.data[7], 0.4f);
  EXPECT_TRUE(frame.color.empty());
}

TEST(RgbdImages, ABadPictureLosesItsFrameOnly) {
  const TempDir dir;
  const std::string depth = depth_of(1000);
  const std::string jpeg = jpeg_of(test::gradient(kColorWidth, kColorHeight));
  const auto good_color = dir.write("good.jpg", jpeg), good_depth = dir.write("good.png", depth);
  const std::string pgm = test::depth_pgm(test::counting_depth(kWidth, kHeight));
  const auto cut = [](const std::string& s) { return s.substr(0, s.size() * 2 / 3); };
  const std::vector<std::pair<std::filesystem::path, std::filesystem::path>> items{
      {dir.write("cut.jpg", cut(jpeg)), good_depth},
      {good_color, dir.write("cut.png", cut(depth))},
      {good_color, dir.write("cut.pgm", cut(pgm))},
      {dir.write("text.jpg", "no picture"), good_depth},
      {good_color, dir / "missing.png"},
      {good_color, good_depth}};
  RgbdImagesSource files;
  for (const auto& [color, d] : items) files.color.push_back(color), files.depth.push_back(d);
  const auto source = open_rgbd_images(sensor_of(files), SensorId{0}, {30});
  for (const char* name : {"cut.jpg", "cut.png", "cut.pgm", "text.jpg", "missing.png"}) {
    const auto lost = source->next();
    ASSERT_FALSE(lost) << name;
    EXPECT_THAT(lost.error().message, HasSubstr(name));
  }
  EXPECT_EQ(frame_of(*source).index, 5u);
  EXPECT_TRUE(has_ended(*source));
}

TEST(RgbdImages, WhatIsLostIsNamedByItsPlaceInTheRecording) {
  const TempDir dir;
  const auto good = dir.write("good.png", depth_of(1000)), bad = dir.write("bad.png", "x");
  SensorConfig sensor = sensor_of({.color = {}, .depth = {good, good, bad}, .loop = true});
  sensor.T_world_depth.assign(3, Pose{});
  sensor.lost_poses[1] = {Error::Cause::not_found, "no such file: '1.txt'"};
  const auto source = open_rgbd_images(sensor, SensorId{0}, {30});
  for (std::uint64_t round = 0; round < 2; ++round) {
    EXPECT_EQ(frame_of(*source).index, 3 * round);
    const auto without_pose = source->next(), broken = source->next();
    ASSERT_FALSE(without_pose);
    EXPECT_EQ(without_pose.error().message,
              "no such file: '1.txt' (frame 1 of sensor 'a' is lost)");
    EXPECT_EQ(without_pose.error().cause, Error::Cause::not_found);
    ASSERT_FALSE(broken);
    EXPECT_THAT(broken.error().message,
                AllOf(HasSubstr("bad.png"), testing::EndsWith("(frame 2 of sensor 'a' is lost)")));
  }
}

TEST(RgbdImages, AWrongSizeNamesFileAndBothSizes) {
  const TempDir dir;
  const auto depth = dir.write("d.png", depth_of(1000));
  const auto small = dir.write("small.png", test::depth_png(test::counting_depth(6, 4)));
  const auto wide = dir.write("wide.jpg", jpeg_of(test::gradient(40, 10)));
  const auto source = open_rgbd_images(sensor_of({.color = {wide, wide}, .depth = {small, depth}}),
                                       SensorId{0}, {30});
  const auto first = source->next(), second = source->next();
  ASSERT_FALSE(first);
  EXPECT_THAT(first.error().message,
              AllOf(HasSubstr("small.png"), HasSubstr("12x8"), HasSubstr("6x4")));
  ASSERT_FALSE(second);
  EXPECT_THAT(second.error().message,
              AllOf(HasSubstr("wide.jpg"), HasSubstr("20x10"), HasSubstr("40x10")));
}

TEST(RgbdImages, LoopsGoOnCounting) {
  const TempDir dir;
  RgbdImagesSource files{
      .color = {},
      .depth = {dir.write("0.png", depth_of(1000)), dir.write("1.png", depth_of(2000))},
      .loop = true};
  SensorConfig sensor = sensor_of(files);
  sensor.T_world_depth.assign(2, Pose{});
  sensor.T_world_depth[1].translation = {1, 2, 3};
  sensor.clock_offset_ms = -5;
  const auto source = open_rgbd_images(sensor, SensorId{0}, {100});
  for (std::uint64_t i = 0; i < 5; ++i) {
    const Frame frame = frame_of(*source);
    EXPECT_EQ(frame.index, i);
    EXPECT_FLOAT_EQ(frame.depth.data[0], i % 2 == 0 ? 1.0f : 2.0f);
    EXPECT_EQ(frame.T_world_depth, sensor.T_world_depth[i % 2]);
    EXPECT_EQ(frame.captured_at(),
              TimePoint(std::chrono::milliseconds(10 * static_cast<int>(i) - 5)));
  }
}

TEST(RgbdImages, AStillMayLoopAndAStaticPoseServesAllItems) {
  const TempDir dir;
  SensorConfig still =
      sensor_of({.color = {}, .depth = {dir.write("0.png", depth_of(1000))}, .loop = true});
  still.T_world_depth[0].translation = {4, 5, 6};
  const auto source = open_rgbd_images(still, SensorId{0}, {30});
  for (int i = 0; i < 3; ++i) EXPECT_EQ(frame_of(*source).T_world_depth, still.T_world_depth[0]);
  EXPECT_TRUE(has_ended(
      *open_rgbd_images(sensor_of({.color = {}, .depth = {}, .loop = true}), SensorId{0}, {30})));
}

}  // namespace
}  // namespace mr::sensor
