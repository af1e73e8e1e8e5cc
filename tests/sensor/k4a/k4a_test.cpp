#include <gmock/gmock.h>

#include <algorithm>
#include <chrono>
#include <cstring>
#include <functional>

#include "k4a_rig.h"
#include "mr/sensor/k4a/calibration_check.h"
#include "mr/yaml/tree.h"

namespace mr::sensor {
namespace {

using namespace std::chrono_literals;
using testing::AllOf;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

// -------------------------------------------------- keys

struct ReadKeys {
  K4aSource source;
  bool has_color = false;
  std::vector<std::string> problems;
};

ReadKeys read(const std::string& yaml) {
  const yaml::Tree tree = yaml::parse_yaml(yaml);
  yaml::Report report("scene.yaml", {});
  ReadKeys out;
  {
    yaml::MapReader map(report, tree.root, "source");
    const SourceKeys keys = read_k4a(map, "sensors.a.source");
    out.source = *keys.config.get_if<K4aSource>();
    out.has_color = keys.has_color;
    EXPECT_FALSE(keys.cameras) << "the scene states them";
  }
  for (const yaml::Problem& problem : report.take_problems())
    out.problems.push_back(problem.message);
  return out;
}

TEST(K4aKeys, AreRead) {
  const ReadKeys keys = read(
      "{serial: \"000123\", depth_mode: wfov, color: 2160p, fps: 15, sync: subordinate, "
      "subordinate_delay_us: 320, depth_delay_us: -160, exposure_us: 8330, gain: 40, "
      "white_balance_k: 4500, powerline_hz: 50, depth_unit_m: 0.00025}");
  EXPECT_THAT(keys.problems, IsEmpty());
  EXPECT_TRUE(keys.has_color);
  const K4aSource& s = keys.source;
  EXPECT_EQ(s.serial, "000123") << "leading zeros count";
  EXPECT_EQ(s.depth().name, "WFOV_UNBINNED");
  EXPECT_EQ(s.color_mode()->width, 3840);
  EXPECT_EQ(s.fps, 15);
  EXPECT_EQ(s.sync, K4aSource::Sync::subordinate);
  EXPECT_EQ(s.subordinate_delay_us, 320);
  EXPECT_EQ(s.depth_delay_us, -160);
  EXPECT_EQ(s.exposure_us, 8330);
  EXPECT_EQ(s.gain, 40);
  EXPECT_EQ(s.white_balance_k, 4500);
  EXPECT_EQ(s.powerline_hz, 50);
  EXPECT_EQ(s.depth_unit_m, 0.00025);
  EXPECT_EQ(s.content().items, 0u);
}

TEST(K4aKeys, LeftOutAreTheUsualOnes) {
  const ReadKeys keys = read("{device: 1}");
  EXPECT_THAT(keys.problems, IsEmpty());
  EXPECT_FALSE(keys.has_color);
  EXPECT_EQ(keys.source.device, 1);
  EXPECT_EQ(keys.source.depth().name, "NFOV_UNBINNED");
  EXPECT_EQ(keys.source.color_mode(), nullptr);
  EXPECT_FALSE(keys.source.exposure_us || keys.source.gain || keys.source.white_balance_k);
}

TEST(K4aKeys, ProblemsNameTheKey) {
  const auto problem = [](const std::string& keys) {
    const auto problems = read("{device: 0, " + keys + "}").problems;
    return problems.size() == 1 ? problems[0] : std::to_string(problems.size()) + " problems";
  };
  EXPECT_THAT(problem("serial: \"1\""), HasSubstr("both serial and device"));
  EXPECT_THAT(read("{}").problems, ElementsAre(HasSubstr("needs serial")));
  EXPECT_THAT(problem("fps: 20"), HasSubstr("fps must be 5, 15 or 30"));
  EXPECT_THAT(problem("depth_mode: wfov"), HasSubstr("depth_mode wfov has at most 15 fps"));
  EXPECT_THAT(problem("color: 3072p"), HasSubstr("color 3072p has at most 15 fps"));
  EXPECT_THAT(problem("color: 4k"), HasSubstr("color"));
  EXPECT_THAT(problem("sync: master"), HasSubstr("master needs color"));
  EXPECT_THAT(problem("subordinate_delay_us: 160"), HasSubstr("needs sync: subordinate"));
  EXPECT_THAT(problem("sync: subordinate, subordinate_delay_us: 40000"),
              HasSubstr("subordinate_delay_us must be between 0 and 33333"));
  EXPECT_THAT(problem("color: 720p, depth_delay_us: -40000"), HasSubstr("depth_delay_us"));
  EXPECT_THAT(problem("color: 720p, exposure_us: 40000"), HasSubstr("at most 33333"));
  EXPECT_THAT(problem("color: 720p, exposure_us: 100"), HasSubstr("exposure_us"));
  EXPECT_THAT(problem("color: 720p, gain: 10"), HasSubstr("gain needs exposure_us"));
  EXPECT_THAT(problem("color: 720p, white_balance_k: 4501"), HasSubstr("multiple of 10"));
  EXPECT_THAT(problem("color: 720p, powerline_hz: 55"), HasSubstr("50 or 60"));
  EXPECT_THAT(problem("exposure_us: 8000"), HasSubstr("need color"));
  EXPECT_THAT(problem("depth_unit_m: 0"), HasSubstr("depth_unit_m"));
}

TEST(K4aKeys, ScenesBuiltInCodeAreCheckedAsWell) {
  K4aSource source;
  EXPECT_THAT(source.problems(), IsEmpty());
  source.fps = 20, source.gain = 300;
  EXPECT_THAT(source.problems(),
              AllOf(Contains(HasSubstr("fps")), Contains(HasSubstr("gain must be between"))));
}

// -------------------------------------------------- frames

using K4aTest = K4aRig;

TEST_F(K4aTest, GivesDepthInMetresAndColour) {
  fake_k4a::plug(device("17"));
  const auto frames = open(sensor(source("17")));
  EXPECT_TRUE(frames->is_live() && frames->endless());
  fake_k4a::FakeCapture capture = wall(1500, 1'000'000);
  capture.depth = fake_k4a::flat_depth(320, 288, 1500, 1'000'000, 64);  // rows with gaps
  const std::uint16_t near = 499, far = 5001, none = 0;
  std::memcpy(capture.depth->bytes.data(), &near, 2);
  std::memcpy(capture.depth->bytes.data() + 2, &far, 2);
  std::memcpy(capture.depth->bytes.data() + 4, &none, 2);
  fake_k4a::deliver("17", capture);
  const auto frame = frames->next();
  ASSERT_TRUE(frame.ok() && *frame) << message(frame);
  EXPECT_EQ((*frame)->index, 0u);
  EXPECT_EQ((*frame)->depth.width, 320);
  EXPECT_EQ((*frame)->depth.height, 288);
  for (int x = 0; x < 3; ++x) EXPECT_EQ(*(*frame)->depth.at(x, 0), 0) << x;
  EXPECT_FLOAT_EQ(*(*frame)->depth.at(3, 0), 1.5f);
  EXPECT_FLOAT_EQ(*(*frame)->depth.at(319, 287), 1.5f);
  EXPECT_EQ((*frame)->color.width, 1280);
  EXPECT_NEAR(*(*frame)->color.at(640, 360), 200, 2);
}

TEST_F(K4aTest, TheUnitOfDepthIsTheDevices) {
  fake_k4a::plug(device("17"));
  K4aSource finer = source("17", false);
  finer.depth_unit_m = 0.00025;
  const auto frames = open(sensor(finer));
  fake_k4a::deliver("17", wall(8000, 0, false));
  EXPECT_FLOAT_EQ(*(*frames->next())->depth.at(9, 9), 2.0f);
}

TEST_F(K4aTest, TimesAreThoseOfTheDevicesClock) {
  fake_k4a::plug(device("17"));
  SensorConfig late = sensor(source("17", false));
  late.clock_offset_ms = 4;
  const auto frames = open(late);
  const auto now = std::chrono::steady_clock::now().time_since_epoch();
  std::vector<Frame> got;
  for (int i = 0; i < 10; ++i) {
    auto capture = wall(1500, 5'000'000 + 33'333 * static_cast<std::uint64_t>(i), false);
    const auto jitter = i % 3 * 9ms;
    capture.depth->arrived = now - 1s + i * 33'333us + jitter;
    fake_k4a::deliver("17", capture);
    auto frame = frames->next();
    ASSERT_TRUE(frame.ok() && *frame) << message(frame);
    got.push_back(**std::move(frame));
  }
  for (std::size_t i = 1; i < got.size(); ++i) {
    EXPECT_EQ(got[i].index, i);
    const Duration apart = got[i].captured_at() - got[i - 1].captured_at();
    EXPECT_LT(std::chrono::abs(apart - 33'333us), 100us) << i;
  }
  EXPECT_EQ(got[0].exposure_end - got[0].exposure_start, 12'800us);
  // The first arrived 1 s ago by the steady clock.
  const Duration age = std::chrono::system_clock::now() - got[0].captured_at();
  EXPECT_GT(age, 990ms);
  EXPECT_LT(age, 10s);
}

TEST_F(K4aTest, AFrameIsLostAndTheStreamGoesOn) {
  fake_k4a::plug(device("17"));
  const auto frames = open(sensor(source("17")));
  const auto after = [&](const std::function<void(fake_k4a::FakeCapture&)>& break_it) {
    fake_k4a::FakeCapture capture = wall(1500, 0);
    break_it(capture);
    fake_k4a::deliver("17", capture);
    return message(frames->next());
  };
  const auto in_line = [](const char* what) {
    return AllOf(HasSubstr("sensor 'cam': k4a device 17: "), HasSubstr(what), HasSubstr("lost"),
                 Not(HasSubstr("\n")));
  };
  EXPECT_THAT(after([](auto& c) { c.depth.reset(); }), in_line("without depth"));
  EXPECT_THAT(after([](auto& c) { c.color.reset(); }), in_line("without colour"));
  EXPECT_THAT(after([](auto& c) { c.color->bytes.resize(100); }), in_line("its colour picture"));
  EXPECT_THAT(after([](auto& c) { c.color->bytes.clear(); }), in_line("its colour picture"));
  EXPECT_THAT(after([](auto& c) { c.depth->bytes.resize(1000); }), in_line("cut off"));
  EXPECT_THAT(after([](auto& c) { c.depth->stride_bytes = -640; }), in_line("cut off"));
  EXPECT_THAT(after([](auto& c) { c.depth->width = 640; }), in_line("320x288"));
  EXPECT_THAT(after([](auto& c) {
                c.color = fake_k4a::image_of(*kit::encode_jpeg(ImageRgb(64, 64, 0), 80), 64, 64, 0);
              }),
              in_line("1280x720"));
  EXPECT_EQ(after([](auto&) {}), "");
}

// -------------------------------------------------- devices

TEST_F(K4aTest, IsFoundByItsSerialNumber) {
  fake_k4a::plug(device("1"));
  fake_k4a::plug(device("2"));
  fake_k4a::plug(device("22"));
  const auto frames = open(sensor(source("2", false)));
  fake_k4a::deliver("2", wall(1234, 0, false));
  EXPECT_FLOAT_EQ(*(*frames->next())->depth.at(5, 5), 1.234f);
  EXPECT_EQ(fake_k4a::open_devices(), 1) << "those that it looked at are closed";
}

TEST_F(K4aTest, SaysWhyItCannotBeOpened) {
  const auto frames = open(sensor(source("2")));
  EXPECT_THAT(message(frames->next()),
              AllOf(HasSubstr("sensor 'cam': k4a device 2 cannot be opened: 0 devices"),
                    HasSubstr("trying again")));
  fake_k4a::FakeDevice busy = device("2");
  busy.in_use = true;
  fake_k4a::plug(busy);
  EXPECT_THAT(message(open(sensor(source("2")))->next()),
              AllOf(HasSubstr("of which 1 cannot be opened"), HasSubstr("the SDK: device is busy"),
                    Not(HasSubstr("\n"))));
}

TEST_F(K4aTest, TheCamerasAreStartedAsTheSceneSays) {
  fake_k4a::plug(device("17"));
  K4aSource s = source("17");
  s.depth_mode = K4aSource::DepthMode::wfov_binned;
  s.color = K4aSource::Color::p1536;
  s.fps = 15;
  s.sync = K4aSource::Sync::subordinate;
  s.subordinate_delay_us = 320;
  s.depth_delay_us = -80;
  const auto frames = open(sensor(s));
  EXPECT_THAT(message(frames->next()), HasSubstr("waits for its master's pulses"));
  const auto started = fake_k4a::started();
  ASSERT_EQ(started.size(), 1u);
  const k4a_device_configuration_t& c = started[0].configuration;
  EXPECT_EQ(c.depth_mode, K4A_DEPTH_MODE_WFOV_2X2BINNED);
  EXPECT_EQ(c.color_resolution, K4A_COLOR_RESOLUTION_1536P);
  EXPECT_EQ(c.color_format, K4A_IMAGE_FORMAT_COLOR_MJPG);
  EXPECT_EQ(c.camera_fps, K4A_FRAMES_PER_SECOND_15);
  EXPECT_EQ(c.wired_sync_mode, K4A_WIRED_SYNC_MODE_SUBORDINATE);
  EXPECT_EQ(c.subordinate_delay_off_master_usec, 320u);
  EXPECT_EQ(c.depth_delay_off_color_usec, -80);
}

TEST_F(K4aTest, AMasterStartsAfterTheSubordinates) {
  for (const char* serial : {"1", "2", "3"}) fake_k4a::plug(device(serial));
  K4aSource master = source("1"), second = source("2"), third = source("3");
  master.sync = K4aSource::Sync::master;
  second.sync = third.sync = K4aSource::Sync::subordinate;
  // In lockstep all are read by one thread, the master first.
  const auto a = open(sensor(master)), b = open(sensor(second)), c = open(sensor(third));
  for (const char* serial : {"1", "2", "3"}) fake_k4a::deliver(serial, wall(1500, 0));
  EXPECT_EQ(message(a->next()), "");
  std::vector<std::string> order;
  for (const auto& started : fake_k4a::started()) order.push_back(started.serial);
  EXPECT_THAT(order, ElementsAre("2", "3", "1"));
  EXPECT_EQ(message(b->next()), "");
  EXPECT_EQ(message(c->next()), "");
  EXPECT_EQ(fake_k4a::started().size(), 3u) << "each once";
}

TEST_F(K4aTest, ExposureWhiteBalanceAndGainAreLocked) {
  fake_k4a::plug(device("17"));
  K4aSource s = source("17");
  s.exposure_us = 8330, s.gain = 40, s.white_balance_k = 4500, s.powerline_hz = 60;
  const auto frames = open(sensor(s));
  fake_k4a::deliver("17", wall(1500, 0));
  EXPECT_EQ(message(frames->next()), "");
  const auto is_set = [](k4a_color_control_command_t command, int value) {
    const auto all = fake_k4a::controls();
    return std::ranges::any_of(all, [&](const fake_k4a::SetControl& c) {
      return c.command == command && c.mode == K4A_COLOR_CONTROL_MODE_MANUAL && c.value == value;
    });
  };
  EXPECT_TRUE(is_set(K4A_COLOR_CONTROL_EXPOSURE_TIME_ABSOLUTE, 8330));
  EXPECT_TRUE(is_set(K4A_COLOR_CONTROL_GAIN, 40));
  EXPECT_TRUE(is_set(K4A_COLOR_CONTROL_WHITEBALANCE, 4500));
  EXPECT_TRUE(is_set(K4A_COLOR_CONTROL_POWERLINE_FREQUENCY, 2));
}

TEST_F(K4aTest, WhatIsNotLockedIsAutomaticAgain) {
  fake_k4a::plug(device("17"));
  const auto frames = open(sensor(source("17")));
  fake_k4a::deliver("17", wall(1500, 0));
  EXPECT_EQ(message(frames->next()), "");
  const auto controls = fake_k4a::controls();
  ASSERT_EQ(controls.size(), 2u) << "exposure and white balance";
  for (const fake_k4a::SetControl& c : controls) EXPECT_EQ(c.mode, K4A_COLOR_CONTROL_MODE_AUTO);
}

TEST_F(K4aTest, ARefusedControlIsToldOnceAndFramesGoOn) {
  fake_k4a::FakeDevice picky = device("17");
  picky.refused = {K4A_COLOR_CONTROL_WHITEBALANCE};
  fake_k4a::plug(picky);
  K4aSource s = source("17");
  s.white_balance_k = 4500;
  const auto frames = open(sensor(s));
  fake_k4a::deliver("17", wall(1500, 0));
  EXPECT_THAT(message(frames->next()),
              AllOf(HasSubstr("white_balance_k 4500 is refused"), HasSubstr("frames go on")));
  EXPECT_EQ(message(frames->next()), "");
}

TEST_F(K4aTest, SilenceIsAnErrorASecondAndThenTheDeviceIsOpenedAgain) {
  fake_k4a::plug(device("17"));
  const auto frames = open(sensor(source("17")));
  for (int i = 0; i < 4; ++i) EXPECT_THAT(message(frames->next()), HasSubstr("no frame for 1 s"));
  EXPECT_THAT(message(frames->next()), HasSubstr("opening it again"));
  EXPECT_EQ(fake_k4a::open_devices(), 0);
  fake_k4a::deliver("17", wall(1500, 0));
  EXPECT_EQ(message(frames->next()), "");
  EXPECT_EQ(fake_k4a::started().size(), 2u);
}

TEST_F(K4aTest, AnUnpluggedDeviceComesBack) {
  fake_k4a::plug(device("17"));
  const auto frames = open(sensor(source("17")));
  fake_k4a::deliver("17", wall(1500, 90'000'000));
  EXPECT_EQ(message(frames->next()), "");
  fake_k4a::unplug("17");
  EXPECT_THAT(message(frames->next()),
              AllOf(HasSubstr("k4a device 17: the connection is lost"), HasSubstr("trying again")));
  EXPECT_EQ(fake_k4a::open_devices(), 0);
  fake_k4a::plug(device("17"));
  fake_k4a::deliver("17", wall(1400, 1'000'000));  // its clock begins anew
  const auto before = std::chrono::system_clock::now();
  const auto frame = frames->next();
  ASSERT_TRUE(frame.ok() && *frame) << message(frame);
  EXPECT_EQ((*frame)->index, 1u);
  EXPECT_LT(std::chrono::abs((*frame)->captured_at() - before), 10s);
}

TEST_F(K4aTest, CamerasThatStayOffAreTriedAgain) {
  fake_k4a::FakeDevice dead = device("17");
  dead.starts = false;
  fake_k4a::plug(dead);
  const auto frames = open(sensor(source("17")));
  EXPECT_THAT(message(frames->next()), HasSubstr("its cameras do not start"));
  EXPECT_EQ(fake_k4a::open_devices(), 0) << "another program may open it meanwhile";
}

// -------------------------------------------------- calibration

TEST_F(K4aTest, AnotherDevicesCamerasAreToldOnceAndFramesGoOn) {
  fake_k4a::plug(device("17"));
  SensorConfig other = sensor(source("17"));
  other.depth_camera.cx += 5;
  other.T_color_depth.translation.x += 0.1;
  const auto frames = open(other);
  fake_k4a::deliver("17", wall(1500, 0));
  EXPECT_THAT(message(frames->next()),
              AllOf(HasSubstr("depth_camera differs from the device's by up to 5.0 px"),
                    HasSubstr("meshreduce devices")));
  EXPECT_THAT(message(frames->next()),
              HasSubstr("T_color_depth differs from the device's by 100 mm"));
  EXPECT_EQ(message(frames->next()), "");
}

TEST_F(K4aTest, ADeviceWithoutCalibrationIsUsed) {
  fake_k4a::FakeDevice bare = device("17");
  bare.calibration.clear();
  fake_k4a::plug(bare);
  const auto frames = open(sensor(source("17")));
  fake_k4a::deliver("17", wall(1500, 0));
  EXPECT_THAT(message(frames->next()), HasSubstr("calibration.json"));
  EXPECT_EQ(message(frames->next()), "");
}

TEST_F(K4aTest, CamerasOfAnotherModeEndIt) {
  fake_k4a::plug(device("17"));
  SensorConfig wrong = sensor(source("17"));
  wrong.depth_camera.width = 640;
  const auto frames = open(wrong);
  EXPECT_THAT(message(frames->next()), AllOf(HasSubstr("sensor 'cam': depth_mode nfov_binned"),
                                             HasSubstr("640x288"), HasSubstr("320x288")));
  const auto after = frames->next();
  EXPECT_TRUE(after.ok() && !*after);
  EXPECT_EQ(fake_k4a::open_devices(), 0);
}

TEST(CalibrationCheck, MeasuresHowFarLensesDiffer) {
  const auto calibration = *parse_kinect_calibration(fake_k4a::example_calibration());
  const Camera camera = *depth_camera(calibration, *find_depth_mode("NFOV_UNBINNED"));
  EXPECT_NEAR(*lens_difference_px(camera, camera), 0, 1e-3);
  Camera moved = camera;
  moved.cx += 3, moved.cy -= 4;
  EXPECT_NEAR(*lens_difference_px(camera, moved), 5, 1e-3);
  Camera longer = camera;
  longer.fx *= 1.01;
  EXPECT_NEAR(*lens_difference_px(camera, longer), 2.4, 0.3) << "240 px from the middle";
  Camera stated = camera;
  stated.most_radius = 0.5;
  EXPECT_NEAR(*lens_difference_px(camera, stated), 0, 1e-3) << "where both see";
  EXPECT_NEAR(*lens_difference_px(stated, camera), 0, 1e-3);
  Camera larger = camera;
  larger.width = 1024;
  EXPECT_EQ(lens_difference_px(camera, larger), std::nullopt);
}

TEST_F(K4aTest, DevicesAreListed) {
  fake_k4a::FakeDevice first = device("000123"), second = device("000124"), third = device("3");
  first.sync_out = true;
  second.sync_in = second.in_use = true;
  third.calibration = "{}";
  for (const auto& d : {first, second, third}) fake_k4a::plug(d);
  const auto found = find_k4a_devices();
  ASSERT_TRUE(found.ok());
  ASSERT_EQ(found->size(), 3u);
  EXPECT_EQ((*found)[0].serial, "000123");
  EXPECT_EQ((*found)[0].color_firmware, "1.6.110");
  EXPECT_EQ((*found)[0].depth_firmware, "1.6.79");
  EXPECT_TRUE((*found)[0].sync_out && !(*found)[0].sync_in);
  EXPECT_TRUE((*found)[0].calibration);
  EXPECT_EQ((*found)[0].problem, "");
  EXPECT_THAT((*found)[1].problem, HasSubstr("in use"));
  EXPECT_THAT((*found)[2].problem, HasSubstr("calibration.json"));
}

}  // namespace
}  // namespace mr::sensor
