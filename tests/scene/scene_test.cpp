#include "mr/scene/scene.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>

#include "mr/core/file.h"
#include "mr/rate/models.h"
#include "mr/sensor/rgbd_images.h"
#include "scene/scene_file.h"

namespace mr {
namespace {

using test::kIdentity;
using test::long_sensor;
using test::scene_of;
using test::SceneFile;
using test::sensor;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

// Each line's own mistake, all in one file.
TEST_F(SceneFile, ReportsEverythingAtOnceWithItsLine) {
  dir_.write("pose.txt", "2 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n");
  const std::string text = R"(scene: two words
fps: fast
voxl_m: 0.01
threads: 012
fps: 30
voxel_m: .inf
lattice: {origin: [0.0003, 0, 0], step_exp: -7}
sensors:
  - id: a
    source:
      type: rgbd-images
      color: [none.png, nobody.png]
      depth: d.png
      depth_unit_m: "0.001"
    depth_camera:
      size: [640, 480]
      fx: -585
      fy: 585
      cx: 320
      cy: 240
    T_world_depth: {file: pose.txt}
    depth_range_m: [5, 0.3]
  - id: a
    source: {type: realsense-db3, file: x.db3}
    depth_camera: {size: [640, 480], fx: 585, fy: 585, cx: 700, cy: 240}
mergers:
  - {id: root, inputs: [a, ghost]}
coding: {texture_qp: 52, texture_scale: 0}
merge:
  owner: papr
)";
  const std::vector<std::pair<int, const char*>> expected = {
      {1, "scene must be 1 to 64"},
      {2, "fps must be a number, not 'fast'"},
      {3, "unknown key 'voxl_m' (did you mean 'voxel_m'?)"},
      {4, "threads must be a number without leading zeros, not '012'"},
      {5, "key 'fps' is given twice (first in line 2)"},
      {6, "voxel_m must be a finite number"},
      {7, "origin must be multiples of the lattice's step"},
      {7, "step_exp must be one of -9, -10, -11"},
      {10, "source names color but color_camera is missing"},
      {12, "nobody.png"},
      {12, "none.png"},
      {12, "color names 2 files and depth 1"},
      {14, "depth_unit_m must be a number, not the string '0.001'"},
      {17, "fx must be greater than 0"},
      {21, "not rigid"},
      {22, "near less than far"},
      {23, "id 'a' is used twice (first in line 9)"},
      {23, "lacks the key 'T_world_depth'"},
      {24, "source type 'realsense-db3' is not supported by this version; supported: rgbd-images"},
      {25, "principal point"},
      {27, "'ghost', which is no sensor and no merger"},
      {28, "texture_qp must be between 0 and 51"},
      {28, "texture_scale must be between 0.01 and 1, not 0"},
      {30, "owner must be one of paper, coherent"},
  };
  const std::vector<SceneProblem> found = load(text).problems;
  for (const auto& [line, message] : expected)
    EXPECT_TRUE(std::any_of(found.begin(), found.end(),
                            [&, l = line, m = message](const SceneProblem& p) {
                              return p.line == l && p.message.find(m) != std::string::npos;
                            }))
        << line << ": " << message << "\nfound " << testing::PrintToString(shorten(found));
  EXPECT_EQ(found.size(), expected.size()) << testing::PrintToString(shorten(found));
  EXPECT_TRUE(std::is_sorted(found.begin(), found.end(),
                             [](const auto& a, const auto& b) { return a.line < b.line; }));
}

TEST_F(SceneFile, TheExampleLoads) {
  const char* set = std::getenv("MR_DATA");
  const std::filesystem::path shared = std::filesystem::path(MR_SOURCE_DIR) / "../shared";
  const std::filesystem::path data = set ? std::filesystem::path(set) : shared / "data";
  const std::filesystem::path example = shared / "scene-example.yaml";
  if (!std::filesystem::exists(data / "sevenscenes_redkitchen") ||
      !std::filesystem::exists(example))
    GTEST_SKIP() << "needs ../shared/scene-example.yaml and ../shared/data (or MR_DATA)";
  ::setenv("MR_DATA", data.c_str(), 1);
  const SceneResult result = load_scene(example);
  if (!set) ::unsetenv("MR_DATA");

  EXPECT_THAT(shorten(result.problems), IsEmpty());
  const Scene& scene = result.scene;
  EXPECT_EQ(scene.id, "red-kitchen");
  EXPECT_EQ(scene.up, (Vec3d{0, -1, 0}));
  ASSERT_EQ(scene.sensors.size(), 1u);
  const SensorConfig& view = scene.sensors[0];
  EXPECT_EQ(view.id, "view-0");
  const auto& images = *view.source.get_if<sensor::RgbdImagesSource>();
  EXPECT_TRUE(std::filesystem::is_regular_file(images.depth.at(0)));
  EXPECT_TRUE(std::filesystem::is_regular_file(images.color.at(0)));
  EXPECT_EQ(images.invalid, (std::vector<std::uint16_t>{0, 65535}));
  EXPECT_TRUE(images.loop);
  EXPECT_EQ(view.depth_camera.fx, 585);
  EXPECT_EQ(view.color_camera->fx, 527.5);
  EXPECT_EQ(view.T_color_depth.translation, (Vec3d{-0.0225, 0, 0}));
  ASSERT_EQ(view.T_world_depth.size(), 1u);
  EXPECT_NEAR(view.T_world_depth[0].translation.z, 0.71433984999999998, 1e-15);
  EXPECT_EQ(view.depth_near_m, 0.3);
  EXPECT_EQ(scene.volume->high.x, 4);
  EXPECT_EQ(scene.fusion.patches_y, 4);
  EXPECT_EQ(scene.simplify.ratio, 0.1);
  EXPECT_EQ(scene.merge.simplify.ratio, 1.0);
  EXPECT_EQ(scene.atlas.height, 2304);
  EXPECT_EQ(scene.rate.model, RateConfig::Model::ours);
  ASSERT_EQ(scene.links.size(), 1u);
  EXPECT_EQ(scene.links[0].limit_mbps, 50);
  ASSERT_EQ(scene.mergers.size(), 1u);
  EXPECT_THAT(scene.mergers[0].inputs, ElementsAre("view-0"));
}

TEST_F(SceneFile, LeftOutKeysHaveDefaultsAndOneMergerIsMade) {
  const SceneResult result = load(scene_of({"a", "b"}));
  EXPECT_THAT(shorten(result.problems), IsEmpty());
  EXPECT_THAT(shorten(result.notices), IsEmpty());
  EXPECT_EQ(result.scene.fps, 30);
  EXPECT_EQ(result.scene.up, (Vec3d{0, 0, 1}));
  ASSERT_EQ(result.scene.mergers.size(), 1u);
  EXPECT_EQ(result.scene.mergers[0].id, "root");
  EXPECT_THAT(result.scene.mergers[0].inputs, ElementsAre("a", "b"));
  EXPECT_FALSE(result.scene.sensors[0].color_camera);
  EXPECT_EQ(result.scene.sensors[0].source.get_if<sensor::RgbdImagesSource>()->depth[0],
            dir_ / "d.png");
}

TEST_F(SceneFile, RefusesValuesOutOfRange) {
  EXPECT_THAT(problem_of("fps: 0"), HasSubstr("4: fps must be greater than 0 and at most 240"));
  EXPECT_THAT(problem_of("fps: 241"), HasSubstr("4: fps"));
  EXPECT_THAT(problem_of("fps: [30]"), HasSubstr("4: fps must be a number, not a list"));
  EXPECT_THAT(problem_of("fps:"), HasSubstr("4: fps is empty"));
  EXPECT_THAT(problem_of("fps: 1e999"), HasSubstr("finite"));
  EXPECT_THAT(problem_of("fps: 30fps"), HasSubstr("number"));
  EXPECT_THAT(problem_of("voxel_m: 0.001"), HasSubstr("between 0.002 and 0.05"));
  EXPECT_THAT(problem_of("threads: -1"), HasSubstr("threads"));
  EXPECT_THAT(problem_of("threads: 1.5"), HasSubstr("whole"));
  EXPECT_THAT(problem_of("up: [0, 0, 0]"), HasSubstr("direction"));
  EXPECT_THAT(problem_of("up: [0, 1]"), HasSubstr("list of 3 numbers, not 2"));
  EXPECT_THAT(problem_of("video: {threads: 65}"), HasSubstr("threads"));
  EXPECT_THAT(problem_of("volume: {box: [[0, 0, 0], [1, -1, 1]]}"), HasSubstr("box is empty"));
  EXPECT_THAT(problem_of("fusion: {truncation_m: 0.019}"), HasSubstr("at least 2 voxels"));
  EXPECT_THAT(problem_of("fusion: {chunk_m: 0.07}"), HasSubstr("at least 8 voxels"));
  EXPECT_THAT(problem_of("fusion: {patches: [4, 17]}"), HasSubstr("patches"));
  EXPECT_THAT(problem_of("fusion: {mixed_pixels: 1}"), HasSubstr("mixed_pixels must be true"));
  EXPECT_THAT(problem_of("fusion: {speckle_px: -1}"), HasSubstr("speckle_px"));
  EXPECT_THAT(problem_of("fusion: {fill_px: 8}"), HasSubstr("fill_px must be between 0 and 7"));
  EXPECT_THAT(problem_of("simplify: {ratio: 0}"), HasSubstr("ratio"));
  EXPECT_THAT(problem_of("merge: {simplify: {ratio: 1.1}}"), HasSubstr("ratio"));
  EXPECT_THAT(problem_of("merge: {refine: maybe}"), HasSubstr("refine must be true or false"));
  EXPECT_THAT(problem_of("atlas: {size: [15, 100]}"), HasSubstr("size"));
  EXPECT_THAT(problem_of("coding: {sensor_texture_qp: -1}"), HasSubstr("sensor_texture_qp"));
  EXPECT_THAT(problem_of("coding: {texture_scale: 1.5}"), HasSubstr("texture_scale"));
  EXPECT_THAT(problem_of("coding: {depth_qp: 52}"), HasSubstr("depth_qp"));
  EXPECT_THAT(problem_of("coding: {frame_divider: 0}"), HasSubstr("frame_divider"));
  EXPECT_THAT(problem_of("coding: {frame_divider: 31}"), HasSubstr("frame_divider"));
  EXPECT_THAT(problem_of("lattice: {step_exp: -12}"), HasSubstr("-9, -10, -11"));
  EXPECT_THAT(problem_of("pipeline: points\nlattice: {step_exp: -6}"), HasSubstr("-7, -8, -9"));
  EXPECT_THAT(problems(scene_of({"a"}, "pipeline: points\nlattice: {step_exp: -7}\n")), IsEmpty());
  EXPECT_THAT(problem_of("pipeline: magic"), HasSubstr("pipeline must be one of meshreduce"));
  EXPECT_THAT(problem_of("mergers: [{id: r, inputs: [a], deadline_ms: 0}]"), HasSubstr("deadline"));
}

TEST_F(SceneFile, TheModelChoosesTheLatticeForTheTargetWhereThatSaysAuto) {
  const auto step_of = [&](const std::string& rate) {
    const SceneResult read = load(scene_of({"a"}, "lattice: {step_exp: auto}\n" + rate));
    EXPECT_THAT(read.problems, IsEmpty());
    return read.scene.lattice.step_exp;
  };
  EXPECT_EQ(step_of(""), Lattice{}.step_exp) << "nothing is controlled";
  for (const double mbps : {0.2, 5.0, 1000.0}) {
    RateConfig config;
    config.model = RateConfig::Model::ours, config.target_mbps = mbps;
    EXPECT_EQ(step_of("rate: {model: ours, target_mbps: " + std::to_string(mbps) + "}\n"),
              -rate::lattice_of_epoch(config, true, Scene{}.voxel_m))
        << mbps;
  }
  EXPECT_THAT(problem_of("lattice: {step_exp: auto, origin: [0, 0, 0.0009765625]}"),
              HasSubstr("multiples"))
      << "of whichever step that will be";
}

TEST_F(SceneFile, AcceptsTheEdgesOfTheRanges) {
  EXPECT_THAT(problems(scene_of({"a"}, R"(up: [0, -2, 0]
fps: 240
voxel_m: 0.05
lattice: {origin: [1.5, -0.0009765625, 0], step_exp: -10}
fusion: {decomposition: patches, chunk_m: 0.4, truncation_m: 0.1, patches: [1, 16]}
simplify: {ratio: 1}
coding: {texture_scale: 1, texture_qp: 0, sensor_texture_qp: 51}
atlas: {views: best_angle, size: [16, 8192]}
merge: {owner: paper, overlap: rays, refine: false, color_gain: false, calibration_error_m: 0}
)")),
              IsEmpty());
  EXPECT_EQ(load(scene_of({"a"}, "up: [0, -2, 0]\n")).scene.up, (Vec3d{0, -1, 0}));
  EXPECT_GE(load(scene_of({"a"}, "voxel_m: 0.05\n")).scene.fusion.truncation_m, 0.1);
}

TEST_F(SceneFile, EachPartOfTheDepthCleanUpIsASwitch) {
  const CleanConfig usual = load(scene_of({"a"})).scene.fusion.clean;
  EXPECT_TRUE(usual.mixed_pixels && usual.smooth_depth);
  EXPECT_TRUE(usual.speckle_px > 1 && usual.fill_px > 0);
  const auto off = load(scene_of({"a"}, R"(fusion:
  mixed_pixels: false
  speckle_px: 0
  fill_px: 0
  smooth_depth: false
)"));
  EXPECT_THAT(off.problems, IsEmpty());
  EXPECT_FALSE(off.scene.fusion.clean.mixed_pixels || off.scene.fusion.clean.smooth_depth);
  EXPECT_EQ(off.scene.fusion.clean.speckle_px, 0);
  EXPECT_EQ(off.scene.fusion.clean.fill_px, 0);
  const auto most = load(scene_of({"a"}, "fusion: {speckle_px: 1000000, fill_px: 7}\n"));
  EXPECT_THAT(most.problems, IsEmpty());
  EXPECT_EQ(most.scene.fusion.clean.speckle_px, 1000000);
  EXPECT_EQ(most.scene.fusion.clean.fill_px, 7);
}

TEST_F(SceneFile, WhatThisVersionDoesNotActOnIsANotice) {
  const std::string rest = R"(rate: {model: fixed, target_mbps: 10}
coding: {frame_divider: 2}
merge: {overlap: raster, refine: true, color_gain: true}
atlas: {views: packed}
gateway: {listen: "127.0.0.1:8080"}
nats: {url: "nats://x"}
links: [{from: a, to: root}]
)";
  EXPECT_THAT(problems(scene_of({"a"}, rest)), IsEmpty());
  EXPECT_THAT(notices(scene_of({"a"}, rest)),
              ElementsAre("5: coding.frame_divider of pipeline meshreduce: accepted, but not acted "
                          "on by this version",
                          HasSubstr("6: merge.overlap"), HasSubstr("7: atlas"),
                          HasSubstr("10: links (but for `meshreduce plan`)")));
  EXPECT_THAT(notices(scene_of({"a"}, "fusion: {patches: [2, 2]}\n")),
              ElementsAre(HasSubstr("4: fusion.patches")));
  EXPECT_THAT(notices(scene_of({"a"}, "fusion: {decomposition: patches, patches: [2, 2]}\n")),
              IsEmpty());
}

TEST_F(SceneFile, WhatACameraDoesNotActOnIsANotice) {
  const auto notices_of = [&](const std::string& camera) {
    return notices(
        "scene: s\nsensors:\n- id: a\n  source: {type: rgbd-images, depth: d.png, color: d.png}\n"
        "  depth_camera: {size: [640, 480], fx: 585, fy: 585, cx: 320, cy: 240}\n"
        "  color_camera: " +
        camera + "\n  T_world_depth: " + kIdentity + "\n");
  };
  EXPECT_THAT(notices_of("{model: equirectangular, size: [1024, 512]}"), IsEmpty());
  EXPECT_THAT(notices_of("{model: equirectangular, size: [1024, 512], fx: 500, distortion: {model: "
                         "brown, k: [0.1]}}"),
              ElementsAre(HasSubstr("6: fx of a camera that is no pinhole"),
                          HasSubstr("6: distortion of a camera that is no pinhole")));
  EXPECT_THAT(notices_of("{size: [640, 480], fx: 585, fy: 585, cx: 320, cy: 240, distortion: "
                         "{model: none, k: [0.1]}}"),
              ElementsAre(HasSubstr("6: k of distortion none")));
}

TEST_F(SceneFile, UnknownKeysAreToldWhatIsKnown) {
  EXPECT_THAT(problem_of("reuse: {something_else: true}"),
              HasSubstr("4: unknown key 'something_else'; known here: chunks"));
  EXPECT_THAT(problem_of("tcp: {b: \"127.0.0.1:9000\"}"),
              HasSubstr("4: tcp: 'b' is no sensor and no merger (did you mean 'a'?)"));
}

TEST_F(SceneFile, OptionsChangeKeysBeforeTheyAreChecked) {
  const auto file = dir_.write("scene.yaml", scene_of({"a"}, "voxel_m: 7\nfusion:\n"));
  const SceneResult result = load_scene(
      file, {"voxel_m=0.03", "fps=10", "fps=15", "merge.simplify.ratio=0.5", "fusion.chunk_m=2.56",
             "sensors.a.depth_range_m=[0.5, 2]", "sensors.0.clock_offset_ms=7",
             "gateway={listen: \"0.0.0.0:81\"}", "simplify.ratio=${MR_NOT_SET:-0.25}"});
  EXPECT_THAT(shorten(result.problems), IsEmpty());
  EXPECT_EQ(result.scene.voxel_m, 0.03);
  EXPECT_EQ(result.scene.fps, 15) << "the last one holds";
  EXPECT_EQ(result.scene.merge.simplify.ratio, 0.5);
  EXPECT_EQ(result.scene.fusion.chunk_m, 2.56);
  EXPECT_EQ(result.scene.simplify.ratio, 0.25);
  EXPECT_EQ(result.scene.sensors[0].depth_far_m, 2);
  EXPECT_EQ(result.scene.sensors[0].clock_offset_ms, 7);
  EXPECT_EQ(result.scene.gateway->listen, "0.0.0.0:81");
  EXPECT_EQ(result.scene.set.size(), 9u);
}

TEST_F(SceneFile, RelativePathsOfOptionsAreRelativeToTheFile) {
  dir_.write("other/e.png", "x");
  const auto file = dir_.write("scene.yaml", scene_of({"a"}));
  const SceneResult result = load_scene(file, {"sensors.a.source.depth=other/e.png"});
  EXPECT_THAT(shorten(result.problems), IsEmpty());
  EXPECT_THAT(result.scene.sensors[0].source.get_if<sensor::RgbdImagesSource>()->depth,
              ElementsAre(dir_ / "other/e.png"));
}

TEST_F(SceneFile, AWrongOptionIsOneProblemThatNamesIt) {
  const auto problem_with = [&](const std::string& option) {
    const auto file =
        dir_.write("scene.yaml", scene_of({"a", "b"}, "links: [{from: a, to: root}]\n"));
    const auto found = load_scene(file, {"fps=20", option}).problems;
    if (found.size() != 1) return "not one problem but " + testing::PrintToString(shorten(found));
    return to_string(found[0]);
  };
  EXPECT_EQ(problem_with("fps=fast"), "--set 'fps=fast': fps must be a number, not 'fast'");
  EXPECT_EQ(problem_with("fpss=20"), "--set 'fpss=20': unknown key 'fpss' (did you mean 'fps'?)");
  EXPECT_EQ(problem_with("fps="), "--set 'fps=': fps is empty");
  EXPECT_EQ(problem_with("fusoin.chunk_m=1"),
            "--set 'fusoin.chunk_m=1': unknown key 'fusoin' (did you mean 'fusion'?)");
  EXPECT_EQ(problem_with("fusion.chnk_m=1"),
            "--set 'fusion.chnk_m=1': unknown key 'chnk_m' (did you mean 'chunk_m'?)");
  EXPECT_EQ(problem_with("truth.rig.seed=1"),
            "--set 'truth.rig.seed=1': truth lacks the key 'mesh'");
  EXPECT_EQ(problem_with("scene={a: 1, a: 2}").find("--set 'scene={a: 1, a: 2}': scene"), 0u);
  EXPECT_EQ(problem_with("reuse={chunks: true, chunks: false}"),
            "--set 'reuse={chunks: true, chunks: false}': key 'chunks' is given twice");
  for (const char* option : {"fps", "=20", ".fps=20", "fusion.=1", "a..b=1", ""})
    EXPECT_THAT(problem_with(option), HasSubstr(std::string("--set '") + option +
                                                "': write key=value, as in --set voxel_m=0.02"));
  EXPECT_EQ(problem_with("scene.x=1"),
            "--set 'scene.x=1': 'scene' is a single value and has no key 'x'");
  EXPECT_THAT(problem_with("sensors.2.id=c"), HasSubstr("'sensors' has no item '2'; it has 2"));
  EXPECT_THAT(problem_with("sensors.nobody.id=c"), HasSubstr("'sensors' has no item 'nobody'"));
  EXPECT_THAT(problem_with("sensors.-1.id=c"), HasSubstr("no item '-1'"));
  EXPECT_THAT(problem_with("sensors.99999999999999999999999.id=c"), HasSubstr("no item"));
  EXPECT_THAT(problem_with("up=[0, 1"), HasSubstr("'up=[0, 1': its value is not usable: "));
  EXPECT_THAT(problem_with("fps=!!int 3"), HasSubstr("YAML tags"));
  EXPECT_THAT(problem_with("a" + std::string(1 << 16, '.') + "=1"), HasSubstr("write key=value"));
  std::string deep = "a";
  for (int i = 0; i < 100; ++i) deep += ".a";
  EXPECT_THAT(problem_with(deep + "=1"), HasSubstr("more than 32 parts"));
  EXPECT_EQ(problem_with("id=\n\n").find('\n'), std::string::npos) << "one line";
}

// What is wrong in the file may follow from them.
TEST_F(SceneFile, WrongOptionsAreToldAlone) {
  const auto file = dir_.write("scene.yaml", scene_of({"a"}, "fps: slow\n"));
  const auto found = load_scene(file, {"voxel_m=1", "up=[0, 0, 1]", "threads=x"}).problems;
  ASSERT_EQ(found.size(), 2u);
  EXPECT_EQ(found[0].option, "voxel_m=1");
  EXPECT_EQ(found[1].option, "threads=x");
  EXPECT_EQ(load_scene(file, {"voxel_m=0.02"}).problems.at(0).line, 4);
}

TEST_F(SceneFile, BaselinesAreActedOn) {
  const SceneResult result = load(
      scene_of({"a"}, "pipeline: holoportation++\ncoding: {depth_qp: 20, frame_divider: 3}\n"));
  EXPECT_THAT(result.problems, IsEmpty());
  EXPECT_THAT(result.notices, IsEmpty());
  EXPECT_EQ(result.scene.pipeline, "holoportation++");
  EXPECT_EQ(result.scene.coding.depth_qp, 20);
  EXPECT_EQ(result.scene.coding.frame_divider, 3);
  EXPECT_EQ(load(scene_of({"a"}, "")).scene.coding.frame_divider, 1);
}

TEST_F(SceneFile, MergersAreSortedChildrenFirst) {
  const SceneResult result = load(scene_of({"a", "b", "c"}, R"(mergers:
  - {id: top, inputs: [left, right]}
  - {id: right, inputs: [c]}
  - {id: left, inputs: [a, b]}
)"));
  EXPECT_THAT(shorten(result.problems), IsEmpty());
  std::vector<std::string> ids;
  for (const MergerConfig& merger : result.scene.mergers) ids.push_back(merger.id);
  EXPECT_THAT(ids, ElementsAre("left", "right", "top"));
}

TEST_F(SceneFile, RefusesWhatIsNoTree) {
  EXPECT_THAT(problems(scene_of({"a", "b"}, "mergers:\n  - {id: r, inputs: [a]}\n")),
              ElementsAre(HasSubstr("4: sensor 'b' reaches no root")));
  EXPECT_THAT(problems(scene_of({"a"}, "mergers:\n  - {id: r, inputs: [a, a]}\n")),
              ElementsAre(HasSubstr("5: 'a' is already an input of merger 'r'")));
  EXPECT_THAT(problems(scene_of({"a"}, R"(mergers:
  - {id: x, inputs: [a, y]}
  - {id: y, inputs: [x]}
)")),
              ElementsAre(HasSubstr("mergers form a cycle")));
  EXPECT_THAT(problems(scene_of({"a"}, "mergers:\n  - {id: x, inputs: [a, x]}\n")),
              ElementsAre(HasSubstr("5: mergers form a cycle: 'x' -> 'x'")));
  EXPECT_THAT(problems(scene_of({"a", "b"}, R"(mergers:
  - {id: x, inputs: [a]}
  - {id: y, inputs: [b]}
)")),
              ElementsAre(HasSubstr("6: more than one root")));
  EXPECT_THAT(problems(scene_of({"a"}, "mergers:\n  - {id: a, inputs: [a]}\n")),
              Contains(HasSubstr("5: id 'a' is used twice (first in line 3)")));
  EXPECT_THAT(problems(scene_of({"root"})), ElementsAre(HasSubstr("3: id 'root'")));
  EXPECT_THAT(problems(scene_of({"a", "a"})), ElementsAre(HasSubstr("4: id 'a' is used twice")));
  EXPECT_THAT(problems(scene_of({"view-0"}, "mergers:\n  - {id: r, inputs: [view0]}\n")),
              Contains(HasSubstr("(did you mean 'view-0'?)")));
  EXPECT_THAT(problems(scene_of({"a"}, "mergers: []\n")), ElementsAre(HasSubstr("4: mergers")));
  EXPECT_THAT(problems(scene_of({"a"}, "links: [{from: a, to: nobody}]\n")),
              ElementsAre(HasSubstr("4: to: 'nobody'")));
}

TEST_F(SceneFile, MergingIsReadWithItsLimits) {
  const SceneResult result = load(scene_of({"a"}, R"(mergers: [{id: r, inputs: [a], budget_ms: 40}]
merge: {owner: paper, overlap: rays, refine: true, color_gain: true, island_area_m2: 0.01, gap_m: 0.05, agree_m: 0.02, fill_m: 0.03, leave_out_mm: 25}
)"));
  EXPECT_THAT(shorten(result.problems), IsEmpty());
  EXPECT_THAT(shorten(result.notices), IsEmpty());
  EXPECT_EQ(result.scene.mergers.at(0).budget_ms, 40);
  EXPECT_FALSE(result.scene.mergers[0].region);
  EXPECT_EQ(result.scene.merge.island_area_m2, 0.01);
  EXPECT_EQ(result.scene.merge.gap_m, 0.05);
  EXPECT_EQ(result.scene.merge.agree_m, 0.02);
  EXPECT_EQ(result.scene.merge.fill_m, 0.03);
  EXPECT_EQ(result.scene.merge.leave_out_mm, 25);
  EXPECT_THAT(problem_of("mergers: [{id: r, inputs: [a], budget_ms: -1}]"), HasSubstr("budget_ms"));
  EXPECT_THAT(problem_of("merge: {island_area_m2: -1}"), HasSubstr("island_area_m2"));
  EXPECT_THAT(problem_of("merge: {gap_m: 2}"), HasSubstr("gap_m"));
  EXPECT_THAT(problem_of("merge: {agree_m: 1}"), HasSubstr("agree_m"));
  EXPECT_THAT(problem_of("merge: {fill_m: 1}"), HasSubstr("fill_m"));
  EXPECT_THAT(problem_of("merge: {leave_out_mm: -1}"), HasSubstr("leave_out_mm"));
}

/// Two mergers that share the space, and a root; lines 5 to 8.
std::string two_regions(const std::string& west, const std::string& east,
                        const std::string& rest = "") {
  return scene_of({"a", "b"}, "mergers:\n  - {id: w, inputs: [a, b]" + west +
                                  "}\n  - {id: e, inputs: [a, b]" + east +
                                  "}\n  - {id: r, inputs: [w, e]}\n" + rest);
}

TEST_F(SceneFile, MergersWithRegionsShareInputs) {
  const SceneResult result = load(two_regions(", region: [[-2.56, 0, 0], [0, 2.56, 3.84]]",
                                              ", region: [[0, 0, 0], [1.28, 2.56, 3.84]]"));
  EXPECT_THAT(shorten(result.problems), IsEmpty());
  ASSERT_EQ(result.scene.mergers.size(), 3u);
  EXPECT_EQ(result.scene.mergers[0].region->low, (Vec3d{-2.56, 0, 0}));
  EXPECT_EQ(result.scene.mergers[1].region->high, (Vec3d{1.28, 2.56, 3.84}));
  EXPECT_EQ(result.scene.mergers[2].id, "r");
  EXPECT_THAT(problems(two_regions(", region: [[-0.5, 0, 0], [0, 1, 1]]",
                                   ", region: [[0, 0, 0], [2, 1, 1]]", "fusion: {chunk_m: 0.5}\n")),
              IsEmpty());
}

TEST_F(SceneFile, RegionsThatCannotBe) {
  const std::string west = ", region: [[-1.28, 0, 0], [0, 1.28, 1.28]]";
  EXPECT_THAT(problems(two_regions(west, "")),
              ElementsAre(HasSubstr("7: 'a' is already an input of merger 'w'; a node has one"),
                          HasSubstr("7: 'b' is already an input")));
  EXPECT_THAT(problems(two_regions(west, ", region: [[-1.28, 0, 0], [1.28, 1.28, 1.28]]")),
              ElementsAre(HasSubstr("7: the regions of mergers 'w' and 'e' overlap, and both have "
                                    "the input 'a'")));
  EXPECT_THAT(problems(two_regions(west, ", region: [[0.1, 0, 0], [2.5, 1.28, 1.2]]")),
              ElementsAre(testing::AllOf(HasSubstr("7: region must lie on the chunk grid"),
                                         HasSubstr("multiples of 1.28 m"),
                                         HasSubstr("[[0, 0, 0], [2.56, 1.28, 1.28]]"))));
  EXPECT_THAT(
      problems(two_regions(west, ", region: [[0, 0, 0], [1, 1, 1]]", "fusion: {chunk_m: 0.5}\n")),
      ElementsAre(HasSubstr("6: region must lie on the chunk grid, multiples of 0.5 m")));
  EXPECT_THAT(problems(two_regions(west, ", region: [[0, 0, 0], [0, 1.28, 1.28]]")),
              ElementsAre(HasSubstr("7: region is empty")));
  EXPECT_THAT(problems(two_regions(west, ", region: [[0, 0], [1.28, 1.28, 1.28]]")),
              ElementsAre(HasSubstr("7: region must be a list of 3 numbers")));
  EXPECT_THAT(problems(two_regions(west, ", region: everywhere")),
              ElementsAre(HasSubstr("7: region must be [[x, y, z], [x, y, z]]")));
  EXPECT_THAT(problems(scene_of({"a"},
                                "mergers: [{id: r, inputs: [a, a], region: [[0, 0, 0], "
                                "[1.28, 1.28, 1.28]]}]\n")),
              ElementsAre(HasSubstr("'a' is already an input of merger 'r'")));
}

TEST_F(SceneFile, CyclesAreFoundAlsoWhereInputsAreShared) {
  EXPECT_THAT(problems(scene_of({"a"}, R"(mergers:
  - {id: x, inputs: [a, z], region: [[0, 0, 0], [1.28, 1.28, 1.28]]}
  - {id: y, inputs: [a], region: [[1.28, 0, 0], [2.56, 1.28, 1.28]]}
  - {id: z, inputs: [x]}
)")),
              Contains(HasSubstr("mergers form a cycle: 'x' -> 'z' -> 'x'")));
}

TEST_F(SceneFile, MissingKeysAreNamed) {
  EXPECT_THAT(problems("fps: 30\n"), ElementsAre(HasSubstr("lacks the key 'scene'"),
                                                 HasSubstr("lacks the key 'sensors' (or 'rig')")));
  EXPECT_THAT(problems("scene: s\nsensors:\n  - id: a\n"),
              ElementsAre(HasSubstr("3: sensor lacks the key 'source'"),
                          HasSubstr("3: sensor lacks the key 'depth_camera'"),
                          HasSubstr("3: sensor lacks the key 'T_world_depth'")));
}

TEST_F(SceneFile, DistortionIsRead) {
  const std::string camera =
      "    color_camera: {size: [640, 480], fx: 500, fy: 500, cx: 320, cy: 240, distortion: ";
  const std::string source = "{type: rgbd-images, color: d.png, depth: d.png}";
  const SceneResult brown = load(long_sensor(
      source, kIdentity,
      camera + "{model: brown, k: [0.1, 0.2, 0.3], p: [0.01, 0.02], most_radius: 1.7}}\n"));
  EXPECT_THAT(shorten(brown.problems), IsEmpty());
  ASSERT_TRUE(brown.scene.sensors[0].color_camera);
  EXPECT_EQ(brown.scene.sensors[0].color_camera->distortion, DistortionModel::brown);
  EXPECT_EQ(brown.scene.sensors[0].color_camera->k[2], 0.3);
  EXPECT_EQ(brown.scene.sensors[0].color_camera->p[1], 0.02);
  EXPECT_EQ(brown.scene.sensors[0].color_camera->most_radius, 1.7);
  EXPECT_THAT(
      problems(long_sensor(source, kIdentity, camera + "{model: brown, k: [1, 2, 3, 4]}}\n")),
      ElementsAre(HasSubstr("7: k must be a list of 1 to 3 numbers")));
  EXPECT_THAT(problems(long_sensor(source, kIdentity, camera + "{model: brown, k: [-50]}}\n")),
              ElementsAre(HasSubstr("folds")));
  EXPECT_THAT(problems(long_sensor("{type: rgbd-images, depth: d.png}", kIdentity,
                                   camera + "{model: none}}\n")),
              ElementsAre(HasSubstr("7: color_camera is given but source names no color")));
}

TEST_F(SceneFile, EnvironmentIsExpanded) {
  ::setenv("MR_TEST_NAME", "d", 1);
  ::setenv("MR_TEST_FPS", "15", 1);
  ::unsetenv("MR_TEST_UNSET");
  const auto with_depth = [](const std::string& file) {
    return long_sensor("{type: rgbd-images, depth: \"" + file + "\"}");
  };
  EXPECT_THAT(problems(with_depth("${MR_TEST_NAME}.png")), IsEmpty());
  EXPECT_THAT(problems(with_depth("${MR_TEST_UNSET:-d}.${MR_TEST_UNSET:-png}")), IsEmpty());
  EXPECT_THAT(problems(with_depth("${MR_TEST_UNSET:-}d.png")), IsEmpty());
  EXPECT_THAT(problems(with_depth("${MR_TEST_UNSET}/d.png")),
              ElementsAre(HasSubstr("4: environment variable MR_TEST_UNSET is not set")));
  EXPECT_THAT(problems(with_depth("${MR_TEST_NAME")), ElementsAre(HasSubstr("without }")));
  EXPECT_THAT(problems(with_depth("${not a name}")), ElementsAre(HasSubstr("not the name")));
  EXPECT_EQ(load(scene_of({"a"}, "fps: ${MR_TEST_FPS}\n")).scene.fps, 15);
  EXPECT_EQ(load(scene_of({"a"}, "fps: \"${MR_TEST_FPS}\"\n")).scene.fps, 15);
  // What a variable brings in is not expanded again.
  ::setenv("MR_TEST_NAME", "${MR_TEST_NAME}", 1);
  EXPECT_THAT(problems(with_depth("${MR_TEST_NAME}.png")), ElementsAre(HasSubstr("no such file")));
  ::unsetenv("MR_TEST_NAME");
  ::unsetenv("MR_TEST_FPS");
}

TEST_F(SceneFile, AnUnsetVariableIsToldOnce) {
  ::unsetenv("MR_TEST_UNSET");
  EXPECT_THAT(
      problems(long_sensor("{type: rgbd-images, depth: [\"${MR_TEST_UNSET}/0.png\", "
                           "\"${MR_TEST_UNSET}/1.png\"]}",
                           "{files: [\"${MR_TEST_UNSET}/0.txt\", \"${MR_TEST_UNSET}/1.txt\"]}")),
      ElementsAre(HasSubstr("4: environment variable MR_TEST_UNSET is not set")));
}

TEST_F(SceneFile, ALidarHasBeams) {
  const auto with_camera = [](const std::string& camera) {
    return "scene: s\nsensors:\n  - {id: a, source: {type: rgbd-images, depth: d.png}, "
           "depth_camera: " +
           camera + ", T_world_depth: " + kIdentity + "}\n";
  };
  const SceneResult range =
      load(with_camera("{model: lidar, size: [2048, 3], beam_altitude_deg: {from: 0, to: -90}}"));
  EXPECT_THAT(shorten(range.problems), IsEmpty());
  const Camera& camera = range.scene.sensors.at(0).depth_camera;
  EXPECT_EQ(camera.model, CameraModel::lidar);
  EXPECT_NEAR(camera.beam_altitude_rad.at(1), -0.7853981634, 1e-9);
  EXPECT_EQ(camera.beam_azimuth_rad.size(), 3u);
  EXPECT_THAT(
      problems(with_camera("{model: lidar, size: [2048, 2], beam_altitude_deg: [10, -10]}")),
      IsEmpty());
  EXPECT_THAT(problems(with_camera("{model: lidar, size: [2048, 2], beam_altitude_deg: [10]}")),
              ElementsAre(HasSubstr("list of 2 numbers")));
  EXPECT_THAT(problems(with_camera("{model: lidar, size: [2048, 2]}")),
              ElementsAre(HasSubstr("lacks the key 'beam_altitude_deg'")));
}

TEST_F(SceneFile, AFileThatIsNoSceneIsOneProblem) {
  EXPECT_EQ(load_scene(dir_ / "nobody.yaml").problems.size(), 1u);
  EXPECT_EQ(load_scene(dir_.path()).problems.size(), 1u);
  ASSERT_EQ(::mkfifo((dir_ / "pipe").c_str(), 0600), 0);
  EXPECT_EQ(load_scene(dir_ / "pipe").problems.size(), 1u) << "does not wait for a writer";
  EXPECT_THAT(problems(long_sensor("{type: rgbd-images, depth: d.png}", "{file: pipe}")),
              ElementsAre(HasSubstr("not a regular file")));
  EXPECT_THAT(problems(""), ElementsAre(HasSubstr("0: the file holds nothing")));
  EXPECT_THAT(problems("just words"), ElementsAre(HasSubstr("1: this is no scene file")));
  EXPECT_THAT(problems("- a\n- b\n"), ElementsAre(HasSubstr("no scene file")));
  EXPECT_EQ(problems(std::string("\x89PNG\r\n\x1a\n\0\0\0\rIHDR", 16)).size(), 1u);
  EXPECT_THAT(problems("scene: s\nfps: [1, 2\nup: 3\n"), ElementsAre(HasSubstr("not valid YAML")));
  EXPECT_THAT(problems("scene: s\n---\nscene: t\n"), ElementsAre(HasSubstr("one YAML document")));

  std::filesystem::resize_file(dir_.write("big.yaml", "scene: s\n"), (16u << 20) + 1);
  const SceneResult big = load_scene(dir_ / "big.yaml");
  ASSERT_EQ(big.problems.size(), 1u);
  EXPECT_EQ(to_string(big.problems[0]).rfind((dir_ / "big.yaml").string() + ": ", 0), 0u);
}

TEST_F(SceneFile, ProblemsPrintAsFileLineMessage) {
  EXPECT_EQ(to_string(SceneProblem{"s.yaml", 7, "no"}), "s.yaml:7: no");
  EXPECT_EQ(to_string(SceneProblem{"s.yaml", 0, "no"}), "s.yaml: no");
}

TEST_F(SceneFile, AliasesWorkMergeKeysAndTagsDoNot) {
  EXPECT_THAT(problems(R"(scene: s
rig: {sensors: &two 2, frames: *two}
)"),
              IsEmpty());
  EXPECT_THAT(problems(scene_of({"a"}, "video: &v {threads: 2}\natlas: {<<: *v}\n")),
              ElementsAre(HasSubstr("5: merge keys (<<) are not supported")));
  EXPECT_THAT(problems(scene_of({"a"}, "fps: !!float 30\n")),
              ElementsAre(HasSubstr("4: YAML tags")));
}

// Small files that grow when read, or that nest without end.
TEST_F(SceneFile, BombsEndSoon) {
  const auto start = std::chrono::steady_clock::now();
  std::string laughs = "a0: &a0 [x, x, x, x, x, x, x, x, x, x]\n";
  for (int i = 1; i < 20; ++i) {
    laughs += "a" + std::to_string(i) + ": &a" + std::to_string(i) + " [";
    for (int j = 0; j < 10; ++j) laughs += (j ? ", *a" : "*a") + std::to_string(i - 1);
    laughs += "]\n";
  }
  EXPECT_THAT(problems(laughs), ElementsAre(HasSubstr("aliases included")));
  EXPECT_THAT(problems("scene: &s [*s]\n"), ElementsAre(HasSubstr("inside its own anchor")));
  EXPECT_EQ(problems(std::string(100'000, '[')).size(), 1u);
  EXPECT_EQ(problems("a: " + std::string(100'000, '{')).size(), 1u);
  std::string deep;
  for (int i = 0; i < 100; ++i) deep += std::string(static_cast<std::size_t>(i), ' ') + "a:\n";
  EXPECT_THAT(problems(deep), ElementsAre(HasSubstr("nested deeper")));
  EXPECT_THAT(problems("scene: " + std::string(1 << 20, 'x')), ElementsAre(HasSubstr("16 KiB")));
  std::string many = "scene: s\n";
  for (int i = 0; i < 5000; ++i) many += "k" + std::to_string(i) + ": 1\n";
  EXPECT_EQ(problems(many).size(), 1000u);
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(10));
}

}  // namespace
}  // namespace mr
