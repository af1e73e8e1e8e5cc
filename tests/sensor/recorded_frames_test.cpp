#include "mr/sensor/recorded_frames.h"

#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "mr/sensor/timelines.h"

namespace mr::sensor {
namespace {

using namespace std::chrono_literals;

/// Captures at given times, told apart by their exposure.
struct TestClip {
  static constexpr std::string_view kType = "test";
  std::vector<Duration> times;
  bool loops = false;
  std::string domain = "test";
  bool knows_end = true;

  SourceContent content() const { return {0, loops}; }
  SourceClock clock() const {
    return {domain, TimePoint(times.front()),
            knows_end ? std::optional(TimePoint(times.back())) : std::nullopt};
  }
  friend bool operator==(const TestClip&, const TestClip&) = default;
};

class ClipReader final : public RecordingReader {
 public:
  explicit ClipReader(std::vector<Duration> times) : times_(std::move(times)) {}

  Result<std::optional<Capture>> peek() override {
    if (next_ == times_.size()) return std::optional<Capture>();
    return std::optional(Capture{TimePoint(times_[next_]), next_});
  }
  Result<Frame> take() override {
    Frame frame;
    frame.exposure_start = frame.exposure_end = TimePoint(times_[next_++]);
    frame.depth = ImageDepth(1, 1, static_cast<float>(next_ - 1));
    return frame;
  }
  void drop() override { ++next_; }
  Status seek(TimePoint time) override {
    next_ = 0;
    while (next_ + 1 < times_.size() && TimePoint(times_[next_ + 1]) <= time) ++next_;
    return {};
  }

 private:
  std::vector<Duration> times_;
  std::size_t next_ = 0;
};

SensorConfig sensor_of(TestClip clip) {
  SensorConfig sensor;
  sensor.id = "cam";
  sensor.T_world_depth = {Pose{}};
  sensor.source = std::move(clip);
  return sensor;
}

RecordedFrames frames_of(const SensorConfig& sensor, Timeline timeline) {
  return {
      std::make_unique<ClipReader>(sensor.source.get_if<TestClip>()->times), sensor, {}, timeline};
}

/// Of each of `count` frames the capture that it is; -1: a gap; -2: the end.
std::vector<int> captures(RecordedFrames& source, int count) {
  std::vector<int> out;
  for (int i = 0; i < count; ++i) {
    const auto frame = source.next();
    if (!frame) {
      EXPECT_TRUE(is_gap(frame.error())) << frame.error().message;
    }
    out.push_back(!frame ? -1 : !*frame ? -2 : static_cast<int>(*(*frame)->depth.at(0, 0)));
  }
  return out;
}

TEST(RecordedFrames, TakesTheCaptureNearestToEachTickAndKeepsItsOwnTime) {
  const SensorConfig sensor = sensor_of({{1000ms, 1098ms, 1203ms, 1400ms, 1404ms}});
  RecordedFrames source = frames_of(sensor, timelines(std::span(&sensor, 1), 10)[0]);
  const auto first = source.next(), second = source.next();
  EXPECT_EQ((*first)->captured_at(), TimePoint(0ms));
  EXPECT_EQ((*second)->captured_at(), TimePoint(98ms));
  EXPECT_EQ((*second)->index, 1u);
  EXPECT_EQ(captures(source, 4), (std::vector{2, -1, 3, -2}));
}

TEST(RecordedFrames, ASlowerSensorHasGaps) {
  const SensorConfig sensor = sensor_of({{0ms, 100ms, 200ms}});
  RecordedFrames source = frames_of(sensor, timelines(std::span(&sensor, 1), 30)[0]);
  EXPECT_EQ(captures(source, 8), (std::vector{0, -1, -1, 1, -1, -1, 2, -2}));
}

TEST(RecordedFrames, AddsOffsetAndDrift) {
  SensorConfig sensor = sensor_of({{0ms, 10'000ms}});
  sensor.clock_offset_ms = 25, sensor.clock_drift_ppm = 100;
  RecordedFrames source = frames_of(sensor, {.fps = 100});
  EXPECT_EQ(captures(source, 3), (std::vector{-1, -1, -1}));  // to 20 ms; it is stamped 25 ms
  EXPECT_EQ((*source.next())->captured_at(), TimePoint(25ms));
  source.skip(999);  // frame 1003: 10.03 s
  const auto late = source.next();
  ASSERT_TRUE(late && *late);
  EXPECT_EQ((*late)->captured_at(), TimePoint(10'026ms));
}

TEST(RecordedFrames, StartsAgainInStepWithTheOthersOfItsClock) {
  const std::vector<SensorConfig> rig{sensor_of({{5000ms, 5100ms, 5200ms}, true}),
                                      sensor_of({{5100ms, 5200ms, 5300ms}, true})};
  const auto lines = timelines(rig, 10);
  EXPECT_EQ(lines[0].length, 400ms);
  RecordedFrames a = frames_of(rig[0], lines[0]), b = frames_of(rig[1], lines[1]);
  EXPECT_EQ(captures(a, 9), (std::vector{0, 1, 2, -1, 0, 1, 2, -1, 0}));
  EXPECT_EQ(captures(b, 9), (std::vector{-1, 0, 1, 2, -1, 0, 1, 2, -1}));
  a.skip(1'000'000'000);  // 1,000,000,009: at 3 years; 9 mod 4 = 1
  const auto later = a.next();
  ASSERT_TRUE(later && *later);
  EXPECT_EQ(*(*later)->depth.at(0, 0), 1);
  EXPECT_EQ((*later)->captured_at().time_since_epoch(), 1'000'000'009 * 100ms);
}

TEST(RecordedFrames, FindsOutWhereItEnds) {
  SensorConfig sensor = sensor_of({{0ms, 100ms, 200ms}, true});
  sensor.source.get_if<TestClip>()->knows_end = false;
  RecordedFrames source = frames_of(sensor, timelines(std::span(&sensor, 1), 10)[0]);
  EXPECT_EQ(captures(source, 7), (std::vector{0, 1, 2, 0, 1, 2, 0}));
  source.skip(500);
  EXPECT_EQ(captures(source, 2), (std::vector{0, 1}));  // frame 507 is a multiple of three
}

TEST(RecordedFrames, TakesThePoseOfTheCapturesOwnTime) {
  SensorConfig sensor = sensor_of({{1000ms, 1050ms, 1900ms}});
  sensor.trajectory =
      Trajectory({{TimePoint(1000ms), {{}, {0, 0, 0}}}, {TimePoint(1100ms), {{}, {1, 0, 0}}}});
  RecordedFrames source = frames_of(sensor, timelines(std::span(&sensor, 1), 20)[0]);
  EXPECT_EQ((*source.next())->T_world_depth.translation.x, 0);
  EXPECT_NEAR((*source.next())->T_world_depth.translation.x, 0.5, 1e-12);
  source.skip(16);
  const auto lost = source.next();
  ASSERT_FALSE(lost.ok());
  EXPECT_NE(lost.error().message.find("no pose at 1.9"), std::string::npos) << lost.error().message;
}

/// A reader that fails after its first capture.
class BrokenReader final : public RecordingReader {
 public:
  Result<std::optional<Capture>> peek() override {
    EXPECT_FALSE(failed_) << "asked again after an error";
    if (taken_ == 0) return std::optional(Capture{TimePoint(), 0});
    failed_ = true;
    return Error{Error::Cause::corrupt, "damaged"};
  }
  Result<Frame> take() override {
    ++taken_;
    return Frame{};
  }
  void drop() override { ++taken_; }
  Status seek(TimePoint) override { return {}; }

 private:
  int taken_ = 0;
  bool failed_ = false;
};

TEST(RecordedFrames, DamageIsToldOnceAndIsTheEnd) {
  RecordedFrames source(std::make_unique<BrokenReader>(), sensor_of({{0ms}}), {}, {.fps = 10});
  EXPECT_TRUE(source.next().ok());
  const auto broken = source.next();
  ASSERT_FALSE(broken.ok());
  EXPECT_EQ(broken.error().message, "damaged");
  const auto end = source.next();
  EXPECT_TRUE(end && !*end);
}

TEST(RecordedFrames, ACaptureStampedFarAheadDoesNotHideThoseBehindIt) {
  const SensorConfig sensor = sensor_of({{0ms, 24h, 200ms, 300ms}});
  RecordedFrames source = frames_of(sensor, {.fps = 10});
  EXPECT_TRUE(source.next().ok());
  const auto astray = source.next();
  ASSERT_FALSE(astray.ok());
  EXPECT_FALSE(is_gap(astray.error()));
  EXPECT_EQ(captures(source, 2), (std::vector{2, 3}));
}

TEST(RecordedFrames, ACaptureStampedLongBeforeCostsItselfAlone) {
  const SensorConfig sensor =
      sensor_of({{1'000'000ms, 1'000'100ms, 0ms, 1'000'300ms, 1'000'400ms}});
  RecordedFrames source = frames_of(sensor, timelines(std::span(&sensor, 1), 10)[0]);
  EXPECT_EQ(captures(source, 5), (std::vector{0, 1, -1, 3, 4}));
}

TEST(RecordedFrames, CapturesAreCountedByTimesThatCanBeBelieved) {
  EXPECT_EQ(captures_of(TimePoint(5s), TimePoint(6s), 100ms), 11u);
  EXPECT_EQ(captures_of(TimePoint(6s), TimePoint(5s), 100ms), 0u);
  EXPECT_EQ(captures_of(TimePoint(5s), std::nullopt, 100ms), 0u);
  EXPECT_EQ(captures_of(TimePoint(0s), TimePoint(4'294'967s), 1ms), 0u);
}

TEST(Timelines, SessionsFarApartAndOtherClocksBeginByThemselves) {
  const std::vector<SensorConfig> rig{sensor_of({{100s, 110s}}), sensor_of({{109s, 130s}}),
                                      sensor_of({{500s, 510s}}),
                                      sensor_of({{7s, 8s}, false, "other"}), SensorConfig{}};
  const auto lines = timelines(rig, 30);
  EXPECT_EQ(lines[0].start, TimePoint(100s));
  EXPECT_EQ(lines[1].start, TimePoint(100s));
  EXPECT_EQ(lines[2].start, TimePoint(500s));
  EXPECT_EQ(lines[3].start, TimePoint(7s));
  EXPECT_EQ(lines[4].start, TimePoint());
}

}  // namespace
}  // namespace mr::sensor
