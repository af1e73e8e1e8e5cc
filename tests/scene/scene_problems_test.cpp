#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <utility>

#include "mr/scene/scene.h"
#include "mr/sensor/rgbd_images.h"

/// Scenes made in C++, which no reader has checked.
namespace mr {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::StartsWith;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInf = std::numeric_limits<double>::infinity();

Scene good_scene() {
  Scene scene;
  scene.id = "made";
  SensorConfig sensor;
  sensor.id = "a";
  sensor.source = sensor::RgbdImagesSource{.color = {}, .depth = {"d.png"}};
  sensor.depth_camera.width = 640, sensor.depth_camera.height = 576;
  sensor.depth_camera.fx = sensor.depth_camera.fy = 504;
  sensor.depth_camera.cx = 319.5, sensor.depth_camera.cy = 287.5;
  sensor.T_world_depth = {Pose{}};
  scene.sensors = {sensor};
  scene.mergers = {{.id = "root", .inputs = {"a"}}};
  return scene;
}

std::vector<std::string> problems_with(const std::function<void(Scene&)>& change) {
  Scene scene = good_scene();
  change(scene);
  return scene.problems();
}

TEST(SceneProblems, AGoodSceneHasNone) {
  EXPECT_THAT(good_scene().problems(), IsEmpty());
  EXPECT_THAT(problems_with([](Scene& s) { s.gateway.emplace(), s.floor.emplace(); }), IsEmpty());
}

TEST(SceneProblems, EachStageRefusesWhatCannotBeAndSaysWhichKey) {
  const std::pair<const char*, std::function<void(Scene&)>> cases[] = {
      {"voxel_m must be", [](Scene& s) { s.voxel_m = 0; }},
      {"fps must be", [](Scene& s) { s.fps = -30; }},
      {"threads must be", [](Scene& s) { s.threads = -1; }},
      {"up must be", [](Scene& s) { s.up = {}; }},
      {"pipeline 'x' is not known", [](Scene& s) { s.pipeline = "x"; }},
      {"lattice.step_exp must be", [](Scene& s) { s.lattice.step_exp = 3; }},
      {"lattice.step_exp -8 is for", [](Scene& s) { s.lattice.step_exp = -8; }},
      {"lattice.origin must be multiples", [](Scene& s) { s.lattice.origin.x = 1e-5; }},
      {"video.threads must be", [](Scene& s) { s.video.threads = 0; }},
      {"volume is empty",
       [](Scene& s) {
         s.volume = Box3d{}, s.volume->add({1, 1, 1});
       }},
      {"volume.remove_floor.margin_m must be", [](Scene& s) { s.floor.emplace().margin_m = -1; }},
      {"background.model must be a binary glTF",
       [](Scene& s) { s.background.emplace().model = "room.obj"; }},
      {"fusion.chunk_m must be", [](Scene& s) { s.fusion.chunk_m = -1; }},
      {"fusion.chunk_m must be at least 8 voxels", [](Scene& s) { s.fusion.chunk_m = 0.05; }},
      {"fusion.truncation_m must be at least 2", [](Scene& s) { s.fusion.truncation_m = 0.01; }},
      {"fusion.patches must be", [](Scene& s) { s.fusion.patches_y = 0; }},
      {"fusion.fill_px must be", [](Scene& s) { s.fusion.clean.fill_px = 8; }},
      {"rig.frames must be", [](Scene& s) { s.rig.emplace().frames = 0; }},
      {"rig.event push: by_mm must be",
       [](Scene& s) {
         RigEvent push;
         push.kind = RigEvent::Kind::push, push.frames = 1, push.by_mm = -1;
         s.rig.emplace().events = {push};
       }},
      {"rig.depth must be", [](Scene& s) { s.rig.emplace().depth_width = 0; }},
      {"rig.depth must be", [](Scene& s) { s.rig.emplace().depth_height = 1 << 20; }},
      {"coding.texture_scale must be", [](Scene& s) { s.coding.texture_scale = 1e-4; }},
      {"gateway.start: eye and look_at must hold finite",
       [](Scene& s) {
         s.gateway.emplace().start.emplace() = {{0, 0, 1},
                                                {std::numeric_limits<double>::infinity(), 0, 0}};
       }},
      {"simplify.ratio must be", [](Scene& s) { s.simplify.ratio = 2; }},
      {"merge.simplify.error_m must be", [](Scene& s) { s.merge.simplify.error_m = -1; }},
      {"merge.gap_m must be", [](Scene& s) { s.merge.gap_m = 2; }},
      {"atlas.size must be", [](Scene& s) { s.atlas.width = 0; }},
      {"still.after_s must be", [](Scene& s) { s.still.after_s = 0; }},
      {"rate.target_mbps must be", [](Scene& s) { s.rate.target_mbps = 0; }},
      {"rate.moving_weight must be", [](Scene& s) { s.rate.moving_weight = 1.1; }},
      {"coding.texture_qp must be", [](Scene& s) { s.coding.texture_qp = 52; }},
      {"mergers.root.deadline_ms must be", [](Scene& s) { s.mergers[0].deadline_ms = 0; }},
      {"mergers.root.inputs must name", [](Scene& s) { s.mergers[0].inputs.clear(); }},
      {"links: limit_mbps must be",
       [](Scene& s) {
         s.links = {{"a", "root", -1}};
       }},
      {"gateway.viewers must be", [](Scene& s) { s.gateway.emplace().viewers = 0; }},
      {"gateway.listen: 'here' is no", [](Scene& s) { s.gateway.emplace().listen = "here"; }},
      {"gateway.start: look_at", [](Scene& s) { s.gateway.emplace().start.emplace(); }},
      {"nats: cert and key", [](Scene& s) { s.network.nats.certificate = "c.pem"; }},
      {"tcp: a: 'here' is no", [](Scene& s) { s.network.tcp["a"] = "here"; }},
  };
  for (const auto& [expected, change] : cases)
    EXPECT_THAT(problems_with(change), Contains(StartsWith(expected))) << expected;
}

TEST(SceneProblems, SensorsAreLookedAtWithTheirSource) {
  const auto of_sensor = [](const std::function<void(SensorConfig&)>& change) {
    return problems_with([&](Scene& s) { change(s.sensors[0]); });
  };
  EXPECT_THAT(of_sensor([](SensorConfig& s) { s.source = {}; }),
              ElementsAre("sensors.a.source: there is none"));
  EXPECT_THAT(of_sensor([](SensorConfig& s) {
                s.source.get_if<sensor::RgbdImagesSource>()->depth_unit_m = 0;
              }),
              ElementsAre(StartsWith("sensors.a.source: depth_unit_m must be")));
  EXPECT_THAT(of_sensor([](SensorConfig& s) { s.depth_camera.fx = -1; }),
              Contains(StartsWith("sensors.a.depth_camera: focal")));
  EXPECT_THAT(of_sensor([](SensorConfig& s) { s.T_world_depth.clear(); }),
              ElementsAre("sensors.a.T_world_depth must hold a pose"));
  EXPECT_THAT(of_sensor([](SensorConfig& s) { s.T_world_depth[0].translation.y = kNan; }),
              ElementsAre("sensors.a.T_world_depth must hold rigid transforms"));
  EXPECT_THAT(of_sensor([](SensorConfig& s) { s.depth_near_m = 5, s.depth_far_m = 1; }),
              ElementsAre(HasSubstr("near less than far")));
  EXPECT_THAT(of_sensor([](SensorConfig& s) { s.precision.base_m = 0; }),
              ElementsAre(StartsWith("sensors.a.precision.base_m must be")));
}

/// Every number of a config, one after the other.
TEST(SceneProblems, NumbersThatAreNoneAreRefused) {
  Scene scene = good_scene();
  scene.gateway.emplace(), scene.floor.emplace();
  scene.volume = Box3d{{0, 0, 0}, {1, 1, 1}};
  scene.links = {{"a", "root", 5}};
  SensorConfig& sensor = scene.sensors[0];
  double* const numbers[] = {&scene.fps,
                             &scene.voxel_m,
                             &scene.up.z,
                             &scene.lattice.origin.x,
                             &scene.volume->high.y,
                             &scene.floor->height_m,
                             &scene.floor->margin_m,
                             &scene.fusion.chunk_m,
                             &scene.fusion.truncation_m,
                             &scene.simplify.ratio,
                             &scene.simplify.error_m,
                             &scene.merge.calibration_error_m,
                             &scene.merge.island_area_m2,
                             &scene.merge.gap_m,
                             &scene.merge.agree_m,
                             &scene.merge.fill_m,
                             &scene.merge.leave_out_mm,
                             &scene.merge.simplify.ratio,
                             &scene.still.after_s,
                             &scene.rate.target_mbps,
                             &scene.coding.texture_scale,
                             &scene.mergers[0].deadline_ms,
                             &scene.mergers[0].budget_ms,
                             &scene.links[0].limit_mbps,
                             &sensor.depth_camera.fx,
                             &sensor.depth_near_m,
                             &sensor.depth_far_m,
                             &sensor.clock_offset_ms,
                             &sensor.precision.base_m,
                             &sensor.precision.per_m2,
                             &sensor.T_color_depth.translation.x};
  ASSERT_THAT(scene.problems(), IsEmpty());
  for (std::size_t i = 0; i < std::size(numbers); ++i)
    for (const double bad : {kNan, kInf, -kInf}) {
      const double good = std::exchange(*numbers[i], bad);
      EXPECT_FALSE(scene.problems().empty()) << "number " << i << " is " << bad;
      *numbers[i] = good;
    }
  EXPECT_THAT(scene.problems(), IsEmpty());
}

}  // namespace
}  // namespace mr
