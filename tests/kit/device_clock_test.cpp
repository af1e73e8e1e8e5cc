#include "mr/kit/device_clock.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <functional>
#include <random>

namespace mr::kit {
namespace {

using namespace std::chrono_literals;

constexpr Duration kPeriod = 33'333'333ns;
const TimePoint kSystemStart{1'700'000'000s};

double ms(Duration d) { return std::chrono::duration<double, std::milli>(d).count(); }

/// A device whose frames are read in made-up time.
class DeviceClockTest : public testing::Test {
 protected:
  /// The clocks' true relation: device time 0 is kSystemStart; `drift`: how much too slow it runs.
  TimePoint true_time(Duration device) const {
    return kSystemStart + device + Duration(static_cast<std::int64_t>(device.count() * drift_));
  }
  /// The most that the times are later and earlier than true ones, from `from` on.
  struct Errors {
    double latest_ms = -1e9, earliest_ms = 1e9;
    double spread_ms() const { return latest_ms - earliest_ms; }
  };
  Errors run(Duration from, Duration to, const std::function<Duration()>& latency,
             Duration settled) {
    Errors out;
    for (Duration device = from; device < to; device += kPeriod) {
      const TimePoint t = clock_.system_time(device, true_time(device) + latency());
      if (device < settled) continue;
      out.latest_ms = std::max(out.latest_ms, ms(t - true_time(device)));
      out.earliest_ms = std::min(out.earliest_ms, ms(t - true_time(device)));
    }
    return out;
  }
  /// 15 ms, and up to 20 ms more; now and then far more.
  Duration jittery() {
    const double more = std::uniform_real_distribution<>(0, 20)(random_);
    const bool stalls = std::uniform_int_distribution<>(0, 99)(random_) == 0;
    return 15ms +
           std::chrono::duration_cast<Duration>(std::chrono::duration<double, std::milli>(more)) +
           (stalls ? 150ms : 0ms);
  }

  DeviceClock clock_;
  double drift_ = 0;
  std::mt19937 random_{1};
};

TEST_F(DeviceClockTest, ConstantLatencyIsKeptExactly) {
  const Errors errors = run(
      0s, 30s, [] { return Duration(20ms); }, 0s);
  EXPECT_DOUBLE_EQ(errors.latest_ms, 20);
  EXPECT_DOUBLE_EQ(errors.earliest_ms, 20);
}

TEST_F(DeviceClockTest, JitterOfArrivalsDoesNotShakeTheTimes) {
  const Errors errors = run(
      0s, 120s, [&] { return jittery(); }, 10s);
  EXPECT_LT(errors.spread_ms(), 1.5) << "arrivals jitter by 20 to 170 ms";
  EXPECT_GE(errors.earliest_ms, 15) << "no frame arrives before its exposure";
  EXPECT_LT(errors.latest_ms, 17);
}

TEST_F(DeviceClockTest, DriftOfTheClockIsFollowed) {
  for (const double ppm : {-100, 100}) {
    clock_ = {}, drift_ = ppm * 1e-6;
    const Errors errors = run(
        0s, 600s, [&] { return jittery(); }, 10s);
    EXPECT_GT(errors.earliest_ms, 15 - 1.2) << "a window's drift is 1 ms";
    EXPECT_LT(errors.latest_ms, 15 + 2.5);
  }
}

TEST_F(DeviceClockTest, ConsecutiveTimesKeepTheirDistance) {
  TimePoint last{};
  for (int i = 0; i < 900; ++i) {
    const Duration device = i * kPeriod;
    const TimePoint t = clock_.system_time(device, true_time(device) + jittery());
    if (i > 100) {
      EXPECT_LT(std::abs(ms(t - last) - ms(kPeriod)), 0.05) << i;
    }
    last = t;
  }
}

TEST_F(DeviceClockTest, ADeviceThatStartsAgainIsTakenAtOnce) {
  run(
      0s, 60s, [] { return Duration(20ms); }, 0s);
  const TimePoint later = kSystemStart + 70s;
  EXPECT_EQ(clock_.system_time(5ms, later + 20ms), later + 20ms);
  EXPECT_EQ(clock_.system_time(5ms + kPeriod, later + kPeriod + 18ms), later + kPeriod + 18ms);
}

TEST_F(DeviceClockTest, AClockThatIsSetIsTakenOver) {
  run(
      0s, 20s, [] { return Duration(20ms); }, 0s);
  // This computer's clock is set back: at once; forwards: a stall looks the same for 2 s.
  EXPECT_EQ(clock_.system_time(20s, true_time(20s) - 1h), true_time(20s) - 1h);
  Duration device = 20s + kPeriod;
  for (; device < 22s; device += kPeriod) clock_.system_time(device, true_time(device));
  device += 5 * kPeriod;
  EXPECT_EQ(clock_.system_time(device, true_time(device)), true_time(device));
}

TEST_F(DeviceClockTest, AStallOfArrivalsIsNoClockThatWasSet) {
  run(
      0s, 20s, [] { return Duration(20ms); }, 0s);
  const Errors stalled = run(
      20s, 21500ms, [] { return Duration(700ms); }, 20s);
  const Errors after = run(
      21500ms, 25s, [] { return Duration(20ms); }, 20s);
  EXPECT_DOUBLE_EQ(stalled.latest_ms, 20);
  EXPECT_DOUBLE_EQ(after.latest_ms, 20);
}

}  // namespace
}  // namespace mr::kit
