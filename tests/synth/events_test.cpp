// What happens in a rig: each event changes what it should, when it should, and nothing else.

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>

#include "mr/core/parallel.h"
#include "mr/synth/doorway.h"
#include "mr/synth/export_rig.h"
#include "mr/synth/rig_errors.h"
#include "mr/synth/room.h"
#include "mr/synth/sensor_effects.h"
#include "mr/synth/truth.h"
#include "support/rig_scene.h"

namespace mr::synth {
namespace {

using test::small_rig;

constexpr double kFps = 10;

std::unique_ptr<FrameSource> open_sensor(const RigConfig& rig, std::uint32_t sensor) {
  const std::vector<SensorConfig> sensors = rig_sensors(rig);
  const SensorId wanted[] = {SensorId{sensor}};
  return std::move(open_rig(rig, sensors, wanted, kFps, {}).front());
}

/// Frames of one sensor by their numbers, which increase; each is skipped to.
std::vector<Frame> frames_at(const RigConfig& rig, std::vector<int> numbers,
                             std::uint32_t sensor = 0) {
  const auto source = open_sensor(rig, sensor);
  std::vector<Frame> out;
  int next = 0;
  for (const int number : numbers) {
    source->skip(static_cast<std::uint64_t>(number - next));
    auto frame = source->next();
    if (frame.ok() && *frame) out.push_back(std::move(**frame));
    next = number + 1;
  }
  EXPECT_EQ(out.size(), numbers.size());
  return out;
}

/// Pixels whose depth differs by more than 2 cm, or is there in one picture only.
int changed(const Frame& a, const Frame& b) {
  int sum = 0;
  for (std::size_t i = 0; i < a.depth.data.size(); ++i)
    sum += std::abs(a.depth.data[i] - b.depth.data[i]) > 0.02f;
  return sum;
}

double brightness(const Frame& frame) {
  return std::accumulate(frame.color.data.begin(), frame.color.data.end(), 0.0) /
         static_cast<double>(frame.color.data.size());
}

TEST(Events, AChairIsMovedOnce) {
  const RigConfig rig = small_rig(40, {test::chair_moved(10, 10)});
  int seen = 0;
  for (const std::uint32_t sensor : {0u, 1u}) {
    const auto frames = frames_at(rig, {0, 10, 15, 20, 39}, sensor);
    EXPECT_EQ(frames[0].depth, frames[1].depth);
    EXPECT_EQ(frames[3].depth, frames[4].depth);
    seen += changed(frames[1], frames[4]) > 60 && changed(frames[1], frames[2]) > 20;
    EXPECT_LT(changed(frames[1], frames[4]), 160 * 144 / 5);
  }
  EXPECT_GE(seen, 1);
}

TEST(Events, ADoorOpensAndCloses) {
  const RigConfig rig = small_rig(60, {test::door_opens(10, 20)});
  const auto frames = frames_at(rig, {0, 10, 20, 30, 40, 59});
  EXPECT_EQ(frames[0].depth, frames[1].depth);
  EXPECT_EQ(frames[2].depth, frames[3].depth);
  EXPECT_EQ(frames[1].depth, frames[4].depth);
  EXPECT_EQ(frames[4].depth, frames[5].depth);
  EXPECT_GT(changed(frames[1], frames[2]), 50);
  Truth truth(rig, kFps);  // sees beyond the sensor's range
  const SensorConfig sensor = rig_sensors(rig)[0];
  const auto view = truth.view(sensor.depth_camera, sensor.T_world_depth[0]);
  const TruthPicture closed = view->at(10), open = view->at(20);
  int farther = 0;
  for (std::size_t i = 0; i < closed.depth.data.size(); ++i)
    farther += open.depth.data[i] > closed.depth.data[i] + 0.1f;
  EXPECT_GT(farther, 30);  // one sees into the vestibule
}

TEST(Events, TheDoorIsOneOfTheRoomsInEveryKindOfRoom) {
  using Kind = RigConfig::Kind;
  for (const Kind kind :
       {Kind::room, Kind::conference, Kind::office, Kind::corridor, Kind::hallway}) {
    RigConfig rig = small_rig(10, {test::door_opens(5, 2)});
    rig.kind = kind, rig.room_m = usual_room_m(kind);
    const auto doorway = doorway_of(rig);
    ASSERT_TRUE(doorway);
    // The frame's posts, and behind them the vestibule.
    const Room room = build_room(rig);
    const Pose T_wall_world = (room.T_world_room * doorway->T_room_wall).inverse();
    int posts = 0;
    double deepest = 0;
    for (const Vec3f p : room.mesh.positions) {
      const Vec3d q = T_wall_world * vec_cast<double>(p);
      posts += std::abs(std::abs(q.x - doorway->x) - 0.45) < 1e-4 && std::abs(q.y + 0.03) < 1e-4;
      if (std::abs(q.x - doorway->x) < 0.5) deepest = std::max(deepest, q.y);
    }
    EXPECT_GT(posts, 20);
    EXPECT_NEAR(deepest, 2, 1e-4);
    RigConfig without = rig;
    without.events.clear();
    EXPECT_FALSE(doorway_of(without));
    for (std::size_t i = 0; i < 2; ++i)  // cameras stay where they are
      EXPECT_EQ(exact_sensors(rig)[i].T_world_depth, exact_sensors(without)[i].T_world_depth);
  }
}

TEST(Events, SomebodySitsStillAndLeaves) {
  const RigConfig rig = small_rig(320, {test::sits_still(150, 50)});
  const auto frames = frames_at(rig, {0, 20, 145, 150, 175, 199, 204, 300, 319});
  EXPECT_EQ(frames[0].depth, frames[1].depth);  // not yet there
  EXPECT_EQ(frames[3].depth, frames[4].depth);
  EXPECT_EQ(frames[3].color, frames[5].color);
  EXPECT_GT(changed(frames[2], frames[3]), 20);  // still sitting down
  EXPECT_GT(changed(frames[5], frames[6]), 20);
  EXPECT_GT(changed(frames[0], frames[4]), 150);
  EXPECT_LT(changed(frames[0], frames[4]), 160 * 144 / 5);
  EXPECT_EQ(frames[0].depth, frames[7].depth);  // the chair stays, as it was
  EXPECT_EQ(frames[0].color, frames[8].color);
}

TEST(Events, ABoxIsCarriedAway) {
  const RigConfig rig = small_rig(240, {test::box_carried_away(120)});
  const auto frames = frames_at(rig, {0, 10, 119, 125, 230});
  EXPECT_EQ(frames[0].depth, frames[1].depth);
  EXPECT_GT(changed(frames[1], frames[2]), 100);  // a person stoops
  EXPECT_GT(changed(frames[2], frames[3]), 100);
  EXPECT_GT(changed(frames[1], frames[4]), 30);
  EXPECT_LT(changed(frames[1], frames[4]), 1500);
}

TEST(Events, ABoxIsGoneBehindSomebodysBack) {
  const RigConfig plain = small_rig(260, {test::box_gone(130)});
  const RigConfig hidden = small_rig(260, {test::box_gone(130, 40, "cam-0")});
  for (const std::uint32_t sensor : {0u, 1u}) {
    const auto frames = frames_at(plain, {0, 129, 130, 259}, sensor);
    EXPECT_EQ(frames[0].depth, frames[1].depth);
    EXPECT_EQ(frames[2].depth, frames[3].depth);
    EXPECT_GT(changed(frames[1], frames[2]), 30);
  }
  const auto behind = frames_at(hidden, {20, 129, 130, 169, 259}, 0),
             other = frames_at(hidden, {20, 129, 130, 169, 259}, 1);
  EXPECT_GT(changed(other[1], other[2]), 30);
  EXPECT_LT(changed(behind[1], behind[2]), changed(other[1], other[2]) / 5);
  EXPECT_EQ(behind[2].depth, behind[3].depth);
  EXPECT_GT(changed(behind[0], behind[4]), 30);  // seen when who hid it has left
}

TEST(Events, TheLightGoesOffAndOn) {
  const RigConfig rig = small_rig(30, {test::light_off(10, 10)});
  const auto frames = frames_at(rig, {9, 10, 19, 20});
  EXPECT_EQ(frames[0].color, frames[3].color);
  EXPECT_EQ(frames[1].color, frames[2].color);
  EXPECT_LT(brightness(frames[1]), 0.65 * brightness(frames[0]));
  EXPECT_EQ(frames[0].depth, frames[1].depth);
  Truth truth(rig, kFps);
  const SensorConfig sensor = rig_sensors(rig)[0];
  const auto lit = truth.render(sensor.depth_camera, sensor.T_world_depth[0], 9);
  const auto dark = truth.render(sensor.depth_camera, sensor.T_world_depth[0], 10);
  EXPECT_EQ(lit.depth, dark.depth);
  EXPECT_NE(lit.color, dark.color);
  EXPECT_LT(truth.surface(10).colors[0][1], truth.surface(9).colors[0][1]);
}

TEST(Events, AScreenPlaysAndStandsStill) {
  const RigConfig rig = small_rig(40, {test::screen_plays(10, 20)});
  int seen = 0;
  for (const std::uint32_t sensor : {0u, 1u}) {
    const auto frames = frames_at(rig, {0, 10, 11, 12, 30, 39}, sensor);
    EXPECT_EQ(frames[0].color, frames[1].color);
    EXPECT_EQ(frames[4].color, frames[5].color);
    for (const Frame& frame : frames) EXPECT_EQ(frame.depth, frames[0].depth);
    seen += frames[1].color != frames[2].color && frames[2].color != frames[3].color;
  }
  EXPECT_GE(seen, 1);
}

TEST(Events, APushedCameraDoesNotSaySo) {
  const RigConfig rig = small_rig(20, {test::pushed_camera(10, 30, 2)});
  const auto frames = frames_at(rig, {9, 10, 19}, 1), other = frames_at(rig, {9, 10}, 0);
  EXPECT_EQ(other[0].depth, other[1].depth);
  EXPECT_EQ(frames[0].T_world_depth, frames[1].T_world_depth);
  EXPECT_GT(changed(frames[0], frames[1]), 500);
  EXPECT_EQ(frames[1].depth, frames[2].depth);
  const Pose push = push_of(rig, rig.events[0], 1);
  EXPECT_NEAR(length(push.translation), 0.03, 1e-9);
  const double trace = push.rotation(0, 0) + push.rotation(1, 1) + push.rotation(2, 2);
  EXPECT_NEAR(std::acos((trace - 1) / 2), 2 * 3.14159265 / 180, 1e-6);
  // Seen from where it truly stands, it measures the truth.
  Truth truth(rig, kFps);
  const SensorConfig sensor = exact_sensors(rig)[1];
  const auto picture = truth.render(sensor.depth_camera, sensor.T_world_depth[0] * push, 10);
  int wrong = 0;
  for (std::size_t i = 0; i < picture.depth.data.size(); ++i)
    wrong += frames[1].depth.data[i] > 0 && frames[1].depth.data[i] != picture.depth.data[i];
  EXPECT_EQ(wrong, 0);
}

TEST(Events, DepthDropsOutForAWhile) {
  const RigConfig rig = small_rig(30, {test::depth_dropout(10, 10, "cam-1")});
  const auto frames = frames_at(rig, {9, 10, 19, 20}, 1);
  EXPECT_EQ(frames[0].depth, frames[3].depth);
  EXPECT_EQ(frames[0].color, frames[1].color);
  for (const int i : {1, 2})
    for (const float d : frames[i].depth.data) ASSERT_EQ(d, 0);
  const auto other = frames_at(rig, {9, 10}, 0);
  EXPECT_EQ(other[0].depth, other[1].depth);
}

TEST(Events, ExposureJumpsAndHunts) {
  const RigConfig rig = small_rig(
      60, {test::exposure_jump(10, 10, -1), test::exposure_hunt(30, 20, 0.5, 1, "cam-0")});
  const auto frames = frames_at(rig, {9, 10, 20, 32, 37, 50});
  EXPECT_LT(brightness(frames[1]), 0.85 * brightness(frames[0]));
  EXPECT_EQ(frames[0].color, frames[2].color);
  EXPECT_GT(brightness(frames[3]), 1.05 * brightness(frames[0]));
  EXPECT_LT(brightness(frames[4]), 0.95 * brightness(frames[0]));
  EXPECT_EQ(frames[0].color, frames[5].color);
  const auto other = frames_at(rig, {9, 10, 32}, 1);
  EXPECT_NE(other[0].color, other[1].color);
  EXPECT_EQ(other[0].color, other[2].color);
}

TEST(Events, ExposureDriftsAsStated) {
  RigConfig rig = small_rig(400);
  rig.exposure_drift = 0.5, rig.exposure_period_s = 20;
  double least = 9, most = -9;
  const SensorEffects effects(rig, 0, kFps);
  std::vector<double> stops;
  for (int i = 0; i < 400; ++i) {
    stops.push_back(effects.exposure_stops(i));
    least = std::min(least, stops.back()), most = std::max(most, stops.back());
    if (i >= 200) {
      EXPECT_NEAR(stops[i], stops[i - 200], 1e-9);
    }
    if (i > 0) {
      EXPECT_LT(std::abs(stops[i] - stops[i - 1]), 0.02);
    }
  }
  EXPECT_NEAR(least, -0.5, 0.01);
  EXPECT_NEAR(most, 0.5, 0.01);
  const int dark = static_cast<int>(std::min_element(stops.begin(), stops.begin() + 200) -
                                    stops.begin()),
            bright = static_cast<int>(std::max_element(stops.begin(), stops.begin() + 200) -
                                      stops.begin());
  const auto frames = frames_at(rig, {std::min(dark, bright), std::max(dark, bright)});
  const double ratio = brightness(frames[0]) / brightness(frames[1]);
  EXPECT_GT(dark < bright ? 1 / ratio : ratio, 1.15);
  EXPECT_EQ(frames[0].depth, frames[1].depth);
}

TEST(Events, ColorNoiseHasItsDeviationAndIsNewInEveryFrame) {
  RigConfig rig = small_rig(10);
  const Frame exact = frames_at(rig, {0})[0];
  rig.color_noise = 3;
  const auto frames = frames_at(rig, {0, 1});
  double sum = 0, squares = 0, together = 0, beside = 0;
  int count = 0;
  for (std::size_t i = 0; i + 3 < exact.color.data.size(); ++i) {
    const int value = exact.color.data[i];
    if (value < 20 || value > 235 || exact.color.data[i + 3] < 20 || exact.color.data[i + 3] > 235)
      continue;
    const double a = frames[0].color.data[i] - value, b = frames[1].color.data[i] - value,
                 c = frames[0].color.data[i + 3] - exact.color.data[i + 3];
    sum += a, squares += a * a, together += a * b, beside += a * c, ++count;
  }
  ASSERT_GT(count, 20'000);
  EXPECT_NEAR(sum / count, 0, 0.1);
  EXPECT_NEAR(std::sqrt(squares / count), 3, 0.1);
  EXPECT_NEAR(together / squares, 0, 0.03);
  EXPECT_NEAR(beside / squares, 0, 0.03);
  EXPECT_EQ(frames[0].depth, exact.depth);
}

TEST(Events, TruthFollows) {
  const RigConfig rig =
      small_rig(240, {test::sits_still(140, 30), test::chair_moved(20, 10), test::box_gone(40)});
  Truth truth(rig, kFps);
  const SensorConfig sensor = rig_sensors(rig)[0];
  const auto view = truth.view(sensor.depth_camera, sensor.T_world_depth[0]);
  const std::vector<int> moments{0, 25, 60, 90, 120, 136, 150, 190, 239};
  const auto frames = frames_at(rig, moments);
  for (std::size_t i = 0; i < moments.size(); ++i) {
    const TruthPicture picture = view->at(moments[i]);
    int wrong = 0, seen = 0;
    for (std::size_t p = 0; p < picture.depth.data.size(); ++p) {
      if (frames[i].depth.data[p] == 0) continue;
      ++seen, wrong += frames[i].depth.data[p] != picture.depth.data[p];
    }
    EXPECT_EQ(wrong, 0) << moments[i];
    EXPECT_GT(seen, 10'000);
  }
  EXPECT_EQ(truth.surface(0).mesh, truth.surface(10).mesh);
  EXPECT_NE(truth.surface(0).mesh, truth.surface(25).mesh);
  EXPECT_GT(truth.surface(150).mesh.triangles.size(), truth.surface(0).mesh.triangles.size());
}

TEST(Events, SkippedToIsAsReadTo) {
  RigConfig rig = test::noisy(
      small_rig(30, {test::sits_still(20, 5), test::pushed_camera(12, 30, 2, "cam-0"),
                     test::light_off(14, 9), test::screen_plays(0, 30), test::door_opens(3, 20)}),
      2, 1.5);
  rig.color_noise = 2, rig.exposure_drift = 0.3, rig.people = 1, rig.loop = true;
  const auto source = open_sensor(rig, 0);
  std::vector<Frame> all;
  Arena(8).run([&] {
    for (int i = 0; i < 34; ++i) all.push_back(*std::move(*source->next()));
  });
  const std::vector<int> some{1, 11, 12, 15, 23, 29, 33};
  const auto frames = frames_at(rig, some);
  for (std::size_t i = 0; i < some.size(); ++i) {
    EXPECT_EQ(frames[i].depth, all[some[i]].depth) << some[i];
    EXPECT_EQ(frames[i].color, all[some[i]].color) << some[i];
  }
  EXPECT_EQ(all[0].depth, all[30].depth);  // the next round
  EXPECT_NE(all[0].color, all[30].color);  // drift and colour noise go on
}

TEST(Events, CachesOfOtherRigsAreNotTaken) {
  const RigConfig plain = small_rig(10);
  std::vector<RigConfig> rigs{plain};
  for (const RigEvent& event :
       {test::sits_still(5, 3), test::sits_still(5, 4), test::chair_moved(5),
        test::door_opens(5, 3), test::box_carried_away(5), test::box_gone(5),
        test::box_gone(5, 1, "cam-0"), test::light_off(5, 3), test::light_off(5, 3, 0.3),
        test::screen_plays(5, 3), test::pushed_camera(5), test::pushed_camera(5, 20),
        test::depth_dropout(5, 3), test::exposure_jump(5, 3), test::exposure_hunt(5, 3)})
    rigs.push_back(small_rig(10, {event}));
  for (double RigConfig::*field :
       {&RigConfig::depth_noise, &RigConfig::depth_noise_px, &RigConfig::color_noise,
        &RigConfig::exposure_drift, &RigConfig::exposure_period_s}) {
    rigs.push_back(plain);
    rigs.back().*field = 7;
  }
  std::vector<std::uint64_t> keys;
  for (const RigConfig& rig : rigs) keys.push_back(rig_key(rig, kFps));
  std::sort(keys.begin(), keys.end());
  EXPECT_EQ(std::unique(keys.begin(), keys.end()), keys.end());
}

TEST(Events, AreWrittenAsTheyAreRead) {
  RigConfig rig = small_rig(
      100, {test::sits_still(5, 3), test::chair_moved(5), test::door_opens(5, 3),
            test::box_carried_away(5), test::box_gone(5, 9, "cam-0"), test::light_off(5, 3),
            test::screen_plays(5, 3), test::pushed_camera(5), test::depth_dropout(5, 3),
            test::exposure_jump(5, 3), test::exposure_hunt(5, 3)});
  rig.depth_width = 320, rig.depth_height = 288;
  rig.events[0].place_m = Vec2d{0.5, -1};
  rig.depth_noise = 2, rig.depth_noise_px = 1.5, rig.color_noise = 2, rig.exposure_drift = 0.3,
  rig.exposure_period_s = 9;
  const SceneResult read = parse_scene("scene: s\nrig: " + rig_yaml(rig), "scene.yaml");
  for (const SceneProblem& problem : read.problems) ADD_FAILURE() << to_string(problem);
  ASSERT_TRUE(read.scene.rig);
  for (std::size_t i = 0; i < rig.events.size(); ++i)
    EXPECT_EQ(read.scene.rig->events[i], rig.events[i]) << name_of(rig.events[i].kind);
  EXPECT_EQ(*read.scene.rig, rig);
}

}  // namespace
}  // namespace mr::synth
