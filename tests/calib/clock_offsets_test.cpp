#include "mr/calib/clock_offsets.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numbers>
#include <vector>

#include "support/depth_pictures.h"

namespace mr::calib {
namespace {

using testing::HasSubstr;

constexpr double kFps = 30;

Camera small_camera() {
  Camera camera;
  camera.width = 160, camera.height = 120;
  camera.fx = camera.fy = 120;
  camera.cx = 79.5, camera.cy = 59.5;
  return camera;
}

/// Cameras on a circle of 2.2 m, looking at its middle; an angle in degrees each.
Pose standing_at(double degrees, Vec3d target = {0, 0, 1}) {
  const double a = degrees * std::numbers::pi / 180;
  return look_at({2.2 * std::cos(a), 2.2 * std::sin(a), 1.4}, target, {0, 0, 1});
}

double swing(double hertz, double phase, double time_s) {
  return std::sin(2 * std::numbers::pi * hertz * time_s + phase);
}

/// A ball and a box that wander about a room at up to 1.3 m/s, and a box that stands there.
test::Solids moving_things(double time_s) {
  const Vec3d p{0.45 * swing(0.35, 0, time_s), 0.4 * swing(0.3, 1, time_s),
                1 + 0.15 * swing(0.5, 2, time_s)};
  const Vec3d q{0.3 * swing(0.4, 3, time_s), 0.35 * swing(0.33, 4, time_s), 0.35};
  return {Box3d{{-3, -3, 0}, {3, 3, 2.8}},
          {Box3d{q - Vec3d{0.2, 0.15, 0.2}, q + Vec3d{0.2, 0.15, 0.2}},
           Box3d{{-1.9, -1.9, 0}, {-1.4, -1.2, 0.8}}},
          {{p, 0.3}}};
}

test::Solids resting_things(double) { return moving_things(0.2); }

struct TestSensor {
  double degrees = 0;
  double offset_s = 0;  ///< how much later than stated it captures
  Pose stated_error{};
  double fps = kFps, start_s = 0;
  bool looks_away = false;
};

struct Recording {
  std::vector<TestSensor> sensors;
  double seconds = 2, noise_m = 0;
  std::function<test::Solids(double)> things = moving_things;
  std::size_t lost_from = 1000, lost_to = 1000;  ///< frames of the last sensor

  std::vector<DepthTrack> tracks() const {
    std::vector<DepthTrack> out;
    for (std::size_t s = 0; s < sensors.size(); ++s) out.push_back(track(s));
    return out;
  }

  DepthTrack track(std::size_t s) const {
    const TestSensor& sensor = sensors[s];
    const Pose T =
        standing_at(sensor.degrees, sensor.looks_away ? Vec3d{9, 9, 1} : Vec3d{0, 0, 0.8});
    DepthTrack out = make_depth_track(small_camera(), T * sensor.stated_error, {});
    for (std::size_t k = 0; k / sensor.fps < seconds; ++k) {
      if (s + 1 == sensors.size() && k >= lost_from && k < lost_to) continue;
      const double stated_s = sensor.start_s + static_cast<double>(k) / sensor.fps;
      ImageDepth depth = test::depth_picture(things(stated_s + sensor.offset_s), small_camera(), T);
      if (noise_m > 0) depth = test::with_noise(std::move(depth), noise_m, 1000 * s + k);
      append(out, TimePoint(Duration(std::llround(1e9 * stated_s))), depth);
    }
    return out;
  }

  /// The largest error against the first sensor; all must be known.
  double worst_error_s(const ClockEstimate& estimate) const {
    double worst = 0;
    for (std::size_t i = 0; i < sensors.size(); ++i) {
      if (!estimate.clocks[i].offset_s) return 1e9;
      const double truth_s = sensors[i].offset_s - sensors[0].offset_s;
      worst = std::max(worst, std::abs(*estimate.clocks[i].offset_s - truth_s));
    }
    return worst;
  }
};

TEST(ClockOffsets, ExactPicturesGiveExactOffsets) {
  const Recording recording{{{0, 0}, {70, 0.0124}, {-60, -0.047}}};
  const ClockEstimate estimate = estimate_clock_offsets(recording.tracks());
  EXPECT_EQ(estimate.reference, 0u);
  EXPECT_LT(recording.worst_error_s(estimate), 0.001);
  EXPECT_EQ(estimate.clocks[0].offset_s, 0.0);
  for (const ClockOffset& clock : estimate.clocks) {
    EXPECT_LT(clock.sigma_s, 0.001);
    EXPECT_GT(clock.shared_points, 1000u);
    EXPECT_EQ(clock.problem, "");
  }
}

TEST(ClockOffsets, NoiseAndCalibrationErrorsDoNotBiasThem) {
  Recording recording{{{0, 0.008}, {65, -0.009}}};
  recording.noise_m = 0.006;
  Pose& error = recording.sensors[1].stated_error;
  const double a = 0.005;
  error.rotation = {{std::cos(a), -std::sin(a), 0, std::sin(a), std::cos(a), 0, 0, 0, 1}};
  error.translation = {0.006, -0.004, 0.007};
  EXPECT_LT(recording.worst_error_s(estimate_clock_offsets(recording.tracks())), 0.003);
}

TEST(ClockOffsets, FindsOffsetsOfSeveralFrames) {
  Recording recording{{{0, -0.1}, {60, 0.145}}};
  recording.noise_m = 0.004;
  EXPECT_LT(recording.worst_error_s(estimate_clock_offsets(recording.tracks())), 0.003);
}

TEST(ClockOffsets, GoesByStampsNotByIndices) {
  Recording recording{{{0, 0}, {60, 0.02}}};
  recording.sensors[1].fps = 25, recording.sensors[1].start_s = 0.113;
  recording.lost_from = 14, recording.lost_to = 22;
  EXPECT_LT(recording.worst_error_s(estimate_clock_offsets(recording.tracks())), 0.0015);
}

TEST(ClockOffsets, WithoutMotionThereIsNoEstimate) {
  Recording recording{{{0, 0}, {60, 0.02}}};
  recording.noise_m = 0.004, recording.things = resting_things;
  const ClockEstimate estimate = estimate_clock_offsets(recording.tracks());
  EXPECT_EQ(estimate.reference, std::nullopt);
  EXPECT_EQ(estimate.problem, "nothing moves");
  for (const ClockOffset& clock : estimate.clocks) {
    EXPECT_EQ(clock.offset_s, std::nullopt);
    EXPECT_THAT(clock.problem, HasSubstr("nothing that moves"));
  }
}

TEST(ClockOffsets, ASensorThatSeesNothingOfItHasNone) {
  Recording recording{{{0, 0}, {30, 0.02}, {90, 0.01}}};
  recording.sensors[0].looks_away = true;
  const ClockEstimate estimate = estimate_clock_offsets(recording.tracks());
  EXPECT_EQ(estimate.reference, 1u);
  EXPECT_EQ(estimate.clocks[0].offset_s, std::nullopt);
  EXPECT_THAT(estimate.clocks[0].problem, HasSubstr("nothing that moves"));
  ASSERT_TRUE(estimate.clocks[2].offset_s);
  EXPECT_NEAR(*estimate.clocks[2].offset_s, -0.01, 0.001);
}

TEST(ClockOffsets, SensorsThatSeeOppositeSidesHaveNone) {
  const Recording recording{{{0, 0}, {180, 0.02}}};
  const ClockEstimate estimate = estimate_clock_offsets(recording.tracks());
  EXPECT_EQ(estimate.reference, std::nullopt);
  EXPECT_EQ(estimate.problem, "no two sensors see the same things move");
}

TEST(ClockOffsets, EmptyTracksAreTaken) {
  EXPECT_EQ(estimate_clock_offsets({}).problem, "nothing moves");
  const std::vector<DepthTrack> tracks(2, make_depth_track(small_camera(), {}, {}));
  const ClockEstimate estimate = estimate_clock_offsets(tracks);
  EXPECT_EQ(estimate.reference, std::nullopt);
  EXPECT_THAT(estimate.clocks[1].problem, HasSubstr("too few pictures"));
}

TEST(DepthTrack, LargePicturesAreThinnedWithTheirCamera) {
  Camera camera = small_camera();
  camera.width = 641, camera.height = 576, camera.cx = 320;
  DepthTrack track = make_depth_track(camera, {}, {});
  EXPECT_EQ(track.step_px, 2);
  ImageDepth depth(641, 576, 1.5f);
  *depth.at(200, 100) = 2.25f;
  *depth.at(202, 100) = 60;  // too far to be kept
  ASSERT_TRUE(append(track, TimePoint{}, depth));
  ASSERT_EQ(track.depth[0].width, 321);
  EXPECT_EQ(*track.depth[0].at(100, 50), 11250);
  EXPECT_EQ(*track.depth[0].at(101, 50), 0);
  const Vec3d kept = unproject(track.camera, {100, 50}), all = unproject(camera, {200, 100});
  EXPECT_NEAR(length(kept - all), 0, 1e-12);
}

TEST(DepthTrack, PicturesOfThePastAreLeftOut) {
  DepthTrack track = make_depth_track(small_camera(), {}, {});
  const ImageDepth depth(160, 120, 1);
  EXPECT_TRUE(append(track, TimePoint(Duration(5)), depth));
  EXPECT_FALSE(append(track, TimePoint(Duration(5)), depth));
  EXPECT_FALSE(append(track, TimePoint(Duration(4)), depth));
  EXPECT_EQ(track.depth.size(), 1u);
}

TEST(DepthTrack, DepthBesideJumpsAndHolesIsNotSmooth) {
  ImageDepth depth(4, 3, 2);
  *depth.at(1, 0) = 2.02f, *depth.at(2, 0) = 2.5f, *depth.at(0, 2) = 0;
  EXPECT_NEAR(*smooth_depth(depth, 1, {0.5, 0}, 0.05), 2.01, 1e-6);
  EXPECT_FALSE(smooth_depth(depth, 1, {1.5, 0}, 0.05));
  EXPECT_FALSE(smooth_depth(depth, 1, {0.5, 1.5}, 0.05));
  EXPECT_FALSE(smooth_depth(depth, 1, {3, 1}, 0.05));
  EXPECT_FALSE(smooth_depth(depth, 1, {-0.1, 1}, 0.05));
}

}  // namespace
}  // namespace mr::calib
