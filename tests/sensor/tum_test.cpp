#include "mr/sensor/folders/tum.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "core/temp_dir.h"
#include "mr/sensor/timelines.h"
#include "mr/yaml/tree.h"
#include "support/pictures.h"

namespace mr::sensor {
namespace {

using namespace std::chrono_literals;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Optional;

constexpr int kTumWidth = 4, kTumHeight = 3;

std::vector<TimedFile> at(std::initializer_list<int> times_ms) {
  std::vector<TimedFile> out;
  for (const int ms : times_ms)
    out.push_back({TimePoint(std::chrono::milliseconds(ms)), std::to_string(ms) + ".png"});
  return out;
}

TEST(TumAssociation, TakesTheNearestPairsFirstAndNoColourTwice) {
  // Depth 100 is nearer to 96 than 90 is, so 90 gets 80; 300 has none within 20 ms.
  EXPECT_THAT(associate(at({90, 100, 300}), at({80, 96, 330}), 20ms),
              ElementsAre(Optional(0u), Optional(1u), std::nullopt));
  // Both would like 100; the nearer one has it.
  EXPECT_THAT(associate(at({95, 101}), at({100}), 20ms), ElementsAre(std::nullopt, Optional(0u)));
  EXPECT_THAT(associate(at({0}), at({20}), 20ms), ElementsAre(Optional(0u))) << "as far as allowed";
  EXPECT_THAT(associate(at({0}), at({21}), 20ms), ElementsAre(std::nullopt));
}

TEST(TumAssociation, ListsAreSortedAndHaveComments) {
  const auto list = parse_file_list(
      "# depth maps\n2.5 depth/b.png\n1.25\tdepth/a.png extra\n\n2.5 depth/c.png\n", "depth.txt");
  ASSERT_TRUE(list) << list.error().message;
  ASSERT_EQ(list->size(), 2u) << "of one time the first is kept";
  EXPECT_EQ((*list)[0].name, "depth/a.png");
  EXPECT_EQ((*list)[1].name, "depth/b.png");
  EXPECT_EQ((*list)[0].at, TimePoint(1250ms));
  const auto error = [](const std::string& text) {
    const auto read = parse_file_list(text, "depth.txt");
    return read ? "" : read.error().message;
  };
  EXPECT_THAT(error("1 a.png\nsoon b.png\n"), HasSubstr("depth.txt: line 2 must hold a time"));
  EXPECT_THAT(error("1\n"), HasSubstr("line 1"));
  EXPECT_THAT(error("# none\n"), HasSubstr("lists no pictures"));
}

/// A recording of three pairs at 10 Hz from 1000 s on, with a depth picture more.
class TumFolder : public testing::Test {
 protected:
  TumFolder() {
    dir_.write("rgb.txt", "1000.010 rgb/0.png\n1000.110 rgb/1.png\n1000.210 rgb/2.png\n");
    dir_.write("depth.txt",
               "1000.000 depth/0.png\n1000.050 depth/x.png\n1000.100 depth/1.png\n1000.200 "
               "depth/2.png\n");
    std::string rows;
    for (int y = 0; y < kTumHeight; ++y) rows += '\0' + std::string(3 * kTumWidth, '\x40');
    for (int i = 0; i < 3; ++i) {
      Image<std::uint16_t, 1> depth(kTumWidth, kTumHeight,
                                    static_cast<std::uint16_t>(5000 + 5000 * i));
      depth.data[0] = 0, depth.data[1] = 7777;
      dir_.write("depth/" + std::to_string(i) + ".png", test::depth_png(depth));
      dir_.write("rgb/" + std::to_string(i) + ".png",
                 test::png_file(kTumWidth, kTumHeight, 8, 2, rows));
    }
  }

  SourceKeys read(const std::string& keys) {
    const yaml::Tree tree = yaml::parse_yaml(keys);
    yaml::Report report(dir_ / "scene.yaml", {});
    SourceKeys out;
    {
      yaml::MapReader map(report, tree.root, "source");
      out = read_tum(map, "sensors.a.source");
    }
    problems_.clear(), notices_.clear();
    for (const auto& problem : report.take_problems()) problems_.push_back(problem.message);
    for (const auto& notice : report.take_notices()) notices_.push_back(notice.message);
    return out;
  }

  std::unique_ptr<FrameSource> open(const std::string& keys, double fps) {
    sensor_.id = "a";
    sensor_.source = read(keys).config;
    sensor_.depth_camera.width = kTumWidth, sensor_.depth_camera.height = kTumHeight;
    sensor_.color_camera = sensor_.depth_camera;
    sensor_.T_world_depth = {Pose{}};
    return open_tum(sensor_, SensorId{}, timelines({&sensor_, 1}, fps)[0]);
  }

  test::TempDir dir_;
  SensorConfig sensor_;
  std::vector<std::string> problems_, notices_;
};

TEST_F(TumFolder, KeysNameTheFolder) {
  const SourceKeys keys = read("{folder: .}");
  EXPECT_THAT(problems_, IsEmpty());
  EXPECT_THAT(notices_, ElementsAre(HasSubstr("1 of the 4 depth pictures are left out")));
  EXPECT_TRUE(keys.has_color);
  const auto* tum = keys.config.get_if<TumSource>();
  ASSERT_TRUE(tum);
  EXPECT_EQ(tum->pictures.depth_unit_m, 0.0002);
  EXPECT_EQ(tum->without_color, 1u);
  EXPECT_EQ(keys.config.content().items, 3u);
  const auto clock = keys.config.clock();
  ASSERT_TRUE(clock);
  EXPECT_EQ(*clock, (SourceClock{"unix", TimePoint(1000s), TimePoint(1000200ms)}));

  read("{folder: ., max_apart_ms: 45}");
  EXPECT_THAT(notices_, ElementsAre(HasSubstr("within 45 ms")));
  read("{folder: ., max_apart_ms: 0}");
  EXPECT_THAT(problems_, ElementsAre(HasSubstr("max_apart_ms")));
  read("{folder: none}");
  EXPECT_THAT(problems_, ElementsAre(AllOf(HasSubstr("none/depth.txt"), HasSubstr("rgb.txt"))));
  dir_.write("rgb.txt", "5 rgb/0.png\n");
  read("{folder: .}");
  EXPECT_THAT(problems_, ElementsAre(HasSubstr("no picture of rgb.txt is within 20 ms")));
}

TEST_F(TumFolder, FramesHaveTheTimesAndDepthsOfTheRecording) {
  auto source = open("{folder: ., invalid: [7777]}", 10);
  for (int i = 0; i < 3; ++i) {
    const auto frame = source->next();
    ASSERT_TRUE(frame) << frame.error().message;
    ASSERT_TRUE(*frame);
    EXPECT_EQ((*frame)->captured_at(), TimePoint(i * 100ms));
    EXPECT_EQ((*frame)->depth.data[0], 0);
    EXPECT_EQ((*frame)->depth.data[1], 0) << "an invalid count";
    EXPECT_NEAR((*frame)->depth.data[2], 1 + i, 1e-6);
    EXPECT_EQ((*frame)->color.width, kTumWidth);
  }
  const auto end = source->next();
  ASSERT_TRUE(end);
  EXPECT_FALSE(*end);
}

TEST_F(TumFolder, FramesBetweenCapturesAreGapsAndLoopsGoOn) {
  auto source = open("{folder: ., loop: true}", 20);
  std::vector<int> depths;
  for (int i = 0; i < 12; ++i) {
    const auto frame = source->next();
    depths.push_back(frame ? static_cast<int>((*frame)->depth.data[2] + 0.5f) : 0);
  }
  EXPECT_THAT(depths, ElementsAre(1, 0, 2, 0, 3, 1, 0, 2, 0, 3, 1, 0));
}

TEST_F(TumFolder, MissingAndBrokenPicturesCostTheirFrames) {
  std::filesystem::remove(dir_ / "depth/1.png");
  dir_.write("rgb/2.png", "no picture");
  auto source = open("{folder: .}", 10);
  EXPECT_THAT(problems_, IsEmpty());
  EXPECT_THAT(notices_, testing::Contains(AllOf(HasSubstr("sensors.a.source.depth: 1 of the 3"),
                                                HasSubstr("depth/1.png"))));
  EXPECT_TRUE(source->next());
  const auto missing = source->next();
  ASSERT_FALSE(missing);
  EXPECT_THAT(missing.error().message,
              AllOf(HasSubstr("depth/1.png"), HasSubstr("of sensor 'a' is lost")));
  const auto broken = source->next();
  ASSERT_FALSE(broken);
  EXPECT_THAT(broken.error().message, HasSubstr("rgb/2.png"));
  const auto end = source->next();
  ASSERT_TRUE(end);
  EXPECT_FALSE(*end);
}

TEST_F(TumFolder, PicturesOfOtherFoldersMayHaveTimesToo) {
  const auto read_images = [&](const std::string& keys) {
    const yaml::Tree tree = yaml::parse_yaml(keys);
    yaml::Report report(dir_ / "scene.yaml", {});
    yaml::MapReader map(report, tree.root, "source");
    const SourceKeys out = read_rgbd_images(map, "sensors.a.source");
    problems_.clear();
    for (const auto& problem : report.take_problems()) problems_.push_back(problem.message);
    return out;
  };
  const std::string images =
      "{depth: {pattern: depth/%d.png, first: 0, last: 2}, depth_unit_m: 0.0002, times: t.txt}";
  dir_.write("t.txt", "# seconds\n7\n7.1 0.png\n7.25\n");
  sensor_.source = read_images(images).config;
  EXPECT_THAT(problems_, IsEmpty());
  sensor_.depth_camera.width = kTumWidth, sensor_.depth_camera.height = kTumHeight;
  sensor_.T_world_depth = {Pose{}};
  const auto source = open_rgbd_images(sensor_, SensorId{}, timelines({&sensor_, 1}, 20)[0]);
  std::vector<Duration> times;
  for (int i = 0; i < 6; ++i)
    if (const auto frame = source->next(); frame && *frame)
      times.push_back((*frame)->captured_at().time_since_epoch());
  EXPECT_THAT(times, ElementsAre(0ms, 100ms, 250ms));

  dir_.write("t.txt", "7\n7.1\n");
  read_images(images);
  EXPECT_THAT(problems_, ElementsAre(HasSubstr("2 times for 3 items; they must be as many")));
  dir_.write("t.txt", "7\n7.1\n7.1\n");
  read_images(images);
  EXPECT_THAT(problems_, ElementsAre(HasSubstr("line 3 must be later")));
}

}  // namespace
}  // namespace mr::sensor
