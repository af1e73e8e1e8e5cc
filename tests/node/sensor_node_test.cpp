#include "mr/node/sensor_node.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "mr/codec/chunk_cache.h"
#include "mr/codec/head.h"
#include "mr/codec/packet_codec.h"
#include "mr/core/parallel.h"
#include "mr/kit/topology.h"
#include "support/one_sensor.h"

namespace mr {
namespace {

using node::SensorNode;
using test::facing_the_wall;
using test::keys_of;
using test::kWall_m;
using test::of_layer;
using test::one_sensor;
using test::seen_wall_m2;
using test::Sensor;
using test::Solids;
using test::wall;
using test::wall_and_box;
using test::with_layers;

// What the head says.

TEST(SensorNode, HeadNamesSceneSensorAndCapture) {
  Scene scene = test::scene_of_sensors({facing_the_wall(), facing_the_wall({0.2, -0.1, 0.3})});
  scene.sensors[1].precision = {0.002, 0.0003};
  scene.coding.sensor_texture_qp = 25;
  Sensor sensor(scene, 1, {.epoch = 7, .now = {}});
  EXPECT_EQ(sensor.node.id(), "cam-1");
  const Frame frame = sensor.frame(wall());
  const Packet packet = sensor.packet(frame);
  EXPECT_EQ(packet.scene, "rig");
  EXPECT_EQ(packet.node, "cam-1");
  EXPECT_EQ(packet.epoch, 7u);
  EXPECT_EQ(packet.coalesced, 0u);
  const TimePoint middle = frame.exposure_start + test::kExposure / 2;
  EXPECT_EQ(packet.captured_at, middle);
  EXPECT_TRUE(packet.marks.empty()) << "there is no clock";
  EXPECT_EQ(packet.plan, (CodingPlan{{0.25, 0}, 0, 5, 1, 25}));

  ASSERT_EQ(packet.sources.size(), 1u);
  EXPECT_EQ(packet.sources[0], (SourceInfo{SensorId{1},
                                           middle,
                                           scene.sensors[1].depth_camera,
                                           frame.T_world_depth,
                                           scene.sensors[1].precision,
                                           {},
                                           {},
                                           {16, 6, 4, std::vector<std::uint8_t>(24)}}));
  ASSERT_EQ(packet.views.size(), 1u);
  const View& view = packet.views[0];
  EXPECT_EQ(view.id, ViewId{1});
  EXPECT_EQ(view.stream, StreamId{1});
  EXPECT_EQ(view.layout, 0u);
  EXPECT_EQ(view.layer, Layer::moving);
  EXPECT_EQ(view.camera(), *scene.sensors[1].color_camera);
  EXPECT_NEAR(length(view.T_world_camera.translation - Vec3d{0.23, -0.1, 0.3}), 0, 1e-9)
      << "the colour camera is 3 cm to the right";
  EXPECT_EQ(view.image_rect, (Rect{0, 0, 96, 64}));
  EXPECT_EQ(view.atlas_rect, view.image_rect);
}

TEST(SensorNode, EachPacketHasTheNextSequenceAndItsOwnTime) {
  Sensor sensor(one_sensor());
  for (std::uint64_t i = 0; i < 3; ++i) {
    const Frame frame = sensor.frame(wall());
    const TimePoint at = frame.captured_at();
    const Packet packet = sensor.packet(frame);
    EXPECT_EQ(packet.sequence, i);
    EXPECT_EQ(packet.captured_at, at);
  }
}

TEST(SensorNode, AClockMarksBothHalves) {
  int asked = 0;
  const TimePoint start{std::chrono::hours(2)};
  Sensor sensor(one_sensor(), 0,
                {.epoch = 0, .now = [&] { return start + std::chrono::seconds(asked++); }});
  const Packet packet = sensor.see(wall());
  EXPECT_EQ(packet.marks,
            (std::vector<TimeMark>{{"sensors/reconstructed", start},
                                   {"sensors/coded", start + std::chrono::seconds(1)}}));
}

TEST(SensorNode, WholeHeadIsSentToWhoAsks) {
  Sensor sensor(one_sensor());
  for (int i = 0; i < 5; ++i) sensor.see(wall());
  codec::HeadReader late;
  const auto refused = late.read(*sensor.send(sensor.frame(wall())));
  ASSERT_FALSE(refused);
  EXPECT_TRUE(late.lacks_base());
  EXPECT_TRUE(sensor.node.answer({.key_frames = {}, .chunks = {}, .taken = {}, .whole_head = true})
                  .empty());
  const auto packet = late.read(*sensor.send(sensor.frame(wall())));
  ASSERT_TRUE(packet) << packet.error().message;
  EXPECT_EQ(packet->sequence, 6u);
}

// The surface.

TEST(SensorNode, SurfaceIsTheWallThatItSees) {
  const Scene scene = one_sensor();
  Sensor sensor(scene);
  const Packet packet = sensor.see(wall());
  const Mesh mesh = sensor.surface();
  for (const Vec3f p : mesh.positions) EXPECT_NEAR(p.z, kWall_m, 0.002);
  // A voxel's width less on every side, at most.
  const double seen = seen_wall_m2(scene.sensors[0].depth_camera);
  EXPECT_LE(surface_area_m2(mesh), seen * 1.001);
  EXPECT_GE(surface_area_m2(mesh), seen * 0.92);
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    EXPECT_LT(mesh.area_normal(t).z, 0) << "turned away from the sensor";
  EXPECT_EQ(kit::count_nonmanifold_edges(mesh), 0u);
  EXPECT_EQ(triangle_sensors(mesh), std::vector<SensorId>(mesh.triangles.size()));
}

TEST(SensorNode, ChunksAreCutByCubeAndNameTheSensor) {
  Scene scene = test::scene_of_sensors({facing_the_wall(), facing_the_wall()});
  Sensor sensor(scene, 1);
  const Packet packet = sensor.see(wall_and_box());
  EXPECT_GT(packet.manifest.size(), 8u);
  EXPECT_TRUE(std::ranges::is_sorted(packet.manifest));
  EXPECT_EQ(keys_of(packet.chunks), packet.manifest);
  for (const auto& chunk : sensor.chunks()) {
    EXPECT_EQ(chunk->key.id.source, SensorId{1});
    EXPECT_EQ(chunk->key.id.layer, Layer::moving);
    EXPECT_EQ(chunk->key.level, 0u);
    EXPECT_GE(chunk->error_m, 0);
    EXPECT_LT(chunk->error_m, scene.voxel_m);
    const auto cube = vec_cast<double>(chunk->key.id.cube);
    for (std::size_t t = 0; t < chunk->mesh.triangles.size(); ++t) {
      const auto in = vec_cast<double>(chunk->mesh.centroid(t)) / 0.64 - cube;
      EXPECT_TRUE(in.x >= 0 && in.y >= 0 && in.z >= 0 && in.x < 1 && in.y < 1 && in.z < 1);
    }
    for (const Vec3f p : chunk->mesh.positions) EXPECT_EQ(p, scene.lattice.snap(p));
  }
}

TEST(SensorNode, NothingOutsideTheVolume) {
  Scene scene = one_sensor();
  scene.volume = Box3d{{-0.48, -0.48, 1}, {0.32, 0.48, 3}};
  Sensor sensor(scene);
  sensor.see(wall());
  const Mesh mesh = sensor.surface();
  const float slack = 0.001f;  // of the lattice
  for (const Vec3f p : mesh.positions) {
    EXPECT_TRUE(p.x >= -0.48f - slack && p.x <= 0.32f + slack) << p.x;
    EXPECT_TRUE(p.y >= -0.48f - slack && p.y <= 0.48f + slack) << p.y;
  }
  EXPECT_NEAR(surface_area_m2(mesh), 0.8 * 0.96, 0.1);
}

TEST(SensorNode, NothingOfTheFloor) {
  Scene scene = one_sensor();
  scene.up = {0, -1, 0};
  scene.floor = FloorConfig{.height_m = 0, .margin_m = 0.03};  // the lower half of the picture
  Sensor sensor(scene);
  sensor.see(wall());
  const Mesh mesh = sensor.surface();
  ASSERT_FALSE(mesh.empty());
  for (const Vec3f p : mesh.positions) EXPECT_LT(p.y, 0.03f);
}

TEST(SensorNode, ARemovedFloorMakesNoTileBlind) {
  for (const bool layers : {false, true}) {
    Scene scene = layers ? with_layers() : one_sensor();
    scene.up = {0, -1, 0};
    scene.floor = FloorConfig{.height_m = -0.5, .margin_m = 0.03};
    scene.sensors[0].T_world_depth = {look_at({}, {0, 0.5, 1}, {0, -1, 0})};
    Sensor sensor(scene);
    Solids solids = wall();
    solids.boxes.push_back({{-9, 0.5, -9}, {9, 1, 9}});
    const TileMask blind = sensor.see(solids).sources.at(0).blind_color;
    EXPECT_TRUE(blind.is_of(96, 64));
    EXPECT_EQ(std::ranges::count(blind.tiles, 1), 0) << layers;
  }
}

TEST(SensorNode, DecimationKeepsTheShareThatWasAskedFor) {
  const auto triangles = [](double ratio) {
    Scene scene = one_sensor();
    scene.simplify.ratio = ratio;
    Sensor sensor(scene);
    sensor.see(test::furnished_room());
    float error_m = 0;
    for (const auto& chunk : sensor.chunks()) error_m = std::max(error_m, chunk->error_m);
    EXPECT_EQ(error_m > 0, ratio < 1) << "what decimation costs is told";
    return static_cast<double>(sensor.surface().triangles.size());
  };
  const double all = triangles(1);
  EXPECT_GT(all, 2000);
  EXPECT_NEAR(triangles(0.5) / all, 0.5, 0.02);
  EXPECT_NEAR(triangles(0.2) / all, 0.2, 0.02);
}

/// Triangles to the right of where balls may enter a room on the left.
double triangles_on_the_right(const Decimation& decimation, bool with_balls) {
  Scene scene = one_sensor();
  scene.simplify.ratio = decimation.ratio, scene.simplify.error_m = decimation.error_m;
  Solids solids = test::furnished_room();
  if (with_balls)
    for (const double y : {-0.4, 0.0}) solids.balls.push_back({{-0.6, y, 1.2}, 0.2});
  Sensor sensor(scene);
  sensor.see(solids);
  const Mesh mesh = sensor.surface();
  double count = 0;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) count += mesh.centroid(t).x > -0.1f;
  return count;
}

TEST(SensorNode, WithAnErrorLimitTheRestDoesNotChangeWhenSomebodyEnters) {
  const auto change = [](const Decimation& decimation) {
    const double alone = triangles_on_the_right(decimation, false);
    EXPECT_GT(alone, 50);
    return std::abs(triangles_on_the_right(decimation, true) / alone - 1);
  };
  EXPECT_LT(change({1, 0.002}), 0.02);
  EXPECT_GT(change({0.1, 0}), 0.1) << "a share of all triangles is another there, too";
}

TEST(SensorNode, ASensorThatMovesSendsWhatItSeesWhereItStands) {
  Scene scene = one_sensor();
  scene.sensors[0].T_world_depth = {facing_the_wall(), facing_the_wall({0.5, 0, 0})};
  scene.still.layers = true;  // but not for a sensor that moves
  Sensor sensor(scene);
  Frame frame = sensor.frame(wall());
  frame.T_world_depth = look_at({0.5, 0.1, -0.4}, {0, 0, kWall_m}, {0, -1, 0});
  frame.depth = depth_picture(wall(), scene.sensors[0].depth_camera, frame.T_world_depth);
  const Packet packet = sensor.packet(frame);
  EXPECT_EQ(packet.sources[0].T_world_depth, frame.T_world_depth);
  EXPECT_EQ(of_layer(packet.manifest, Layer::moving), packet.manifest);
  ASSERT_FALSE(packet.manifest.empty());
  for (const Vec3f p : sensor.surface().positions) EXPECT_NEAR(p.z, kWall_m, 0.01);
}

TEST(SensorNode, PatchesAreJoinedToOneSurface) {
  Scene scene = one_sensor();
  scene.fusion.decomposition = Decomposition::patches;
  scene.fusion.patches_x = scene.fusion.patches_y = 2;
  Sensor sensor(scene);
  sensor.see(wall());
  const Mesh mesh = sensor.surface();
  const double seen = seen_wall_m2(scene.sensors[0].depth_camera);
  EXPECT_NEAR(surface_area_m2(mesh), seen, 0.08 * seen);
  for (const Vec3f p : mesh.positions) EXPECT_NEAR(p.z, kWall_m, 0.002);
  EXPECT_EQ(kit::count_nonmanifold_edges(mesh), 0u);
}

TEST(SensorNode, DistortionIsGoneFromHeadAndSurface) {
  Scene scene = one_sensor();
  Camera& camera = scene.sensors[0].depth_camera;
  camera.distortion = DistortionModel::brown, camera.k[0] = -0.1;
  scene.sensors[0].color_camera->distortion = DistortionModel::brown;
  scene.sensors[0].color_camera->k[0] = -0.1;
  Sensor sensor(scene);
  const Packet packet = sensor.see(wall());
  ASSERT_EQ(packet.sources.size(), 1u);
  EXPECT_EQ(packet.sources[0].depth_camera, undistorted_whole(camera)) << "the rim is kept";
  ASSERT_EQ(packet.views.size(), 1u);
  EXPECT_EQ(packet.views[0].camera(), undistorted(*scene.sensors[0].color_camera));
  for (const Vec3f p : sensor.surface().positions) EXPECT_NEAR(p.z, kWall_m, 0.002);
}

// Pictures.

TEST(SensorNode, PicturesHaveTheColourCamerasSizeMadeEven) {
  Scene scene = one_sensor();
  scene.sensors[0].color_camera = test::pinhole(95, 63, 80);
  Sensor sensor(scene);
  const Packet packet = sensor.see(wall());
  ASSERT_EQ(packet.textures.size(), 1u);
  const TextureUnit& unit = packet.textures[0];
  EXPECT_EQ(unit.width, 96);
  EXPECT_EQ(unit.height, 64);
  EXPECT_EQ(unit.stream, StreamId{0});
  EXPECT_EQ(unit.layout, packet.views.at(0).layout);
  EXPECT_EQ(packet.views[0].width, 95);
  EXPECT_EQ(packet.views[0].height, 63);
  EXPECT_EQ(packet.streams, (std::vector<StreamState>{{StreamId{0}, unit.serial}}));
}

TEST(SensorNode, AKeyFrameThatWasAskedForComesOnce) {
  Sensor sensor(test::scene_of_sensors({facing_the_wall(), facing_the_wall()}), 1);
  const auto is_key = [&] { return sensor.see(wall()).textures.at(0).key_frame; };
  EXPECT_TRUE(is_key());
  EXPECT_FALSE(is_key());
  EXPECT_TRUE(sensor.node.answer({.key_frames = {StreamId{0}}, .chunks = {}, .taken = {}}).empty());
  EXPECT_FALSE(is_key()) << "that is another sensor's stream";
  EXPECT_TRUE(
      sensor.node.answer({.key_frames = {StreamId{0}, StreamId{1}}, .chunks = {}, .taken = {}})
          .empty());
  EXPECT_TRUE(is_key());
  EXPECT_FALSE(is_key());
}

TEST(SensorNode, UnitsAreCounted) {
  Sensor sensor(one_sensor());
  const std::uint32_t first = sensor.see(wall()).textures.at(0).serial;
  EXPECT_EQ(sensor.see(wall()).textures.at(0).serial, first + 1);
}

TEST(SensorNode, WithoutColourThereIsNoView) {
  Scene scene = one_sensor();
  scene.sensors[0].color_camera.reset();
  Sensor blind(scene);
  Sensor usual(one_sensor());
  usual.see(wall());
  Frame frame = usual.frame(wall());
  frame.color = {};  // this one was lost
  const Packet packets[] = {blind.see(wall()), usual.packet(frame)};
  for (const Packet& packet : packets) {
    EXPECT_TRUE(packet.views.empty());
    EXPECT_TRUE(packet.textures.empty());
  }
  const Mesh meshes[] = {blind.surface(), usual.surface()};
  for (const Mesh& mesh : meshes)
    EXPECT_EQ(triangle_views(mesh), std::vector<ViewId>(mesh.triangles.size(), kNoView));
  EXPECT_EQ(usual.see(wall()).views.size(), 1u);
}

// Chunks from frame to frame.

TEST(SensorNode, ChunksThatDidNotChangeAreKept) {
  Sensor sensor(one_sensor());
  const Packet first = sensor.see(wall());
  const Packet second = sensor.see(wall());
  EXPECT_EQ(second.manifest, first.manifest);
  EXPECT_TRUE(second.chunks.empty());
  sensor.chunks();

  const Packet third = sensor.see(wall_and_box());
  EXPECT_FALSE(third.chunks.empty());
  for (const EncodedChunk& chunk : third.chunks)
    EXPECT_EQ(std::ranges::count(first.manifest, chunk.key), 0) << "a key names one content";
  const Packet fourth = sensor.see(wall());
  for (const EncodedChunk& chunk : fourth.chunks) {
    EXPECT_EQ(std::ranges::count(first.manifest, chunk.key), 0) << "also when it is as it was";
    EXPECT_EQ(std::ranges::count(third.manifest, chunk.key), 0);
  }
}

TEST(SensorNode, WithoutReuseAllChunksAreSentAgain) {
  Scene scene = one_sensor();
  scene.reuse_chunks = false;
  Sensor sensor(scene);
  sensor.see(wall());
  const Packet second = sensor.see(wall());
  EXPECT_EQ(keys_of(second.chunks), second.manifest);
}

TEST(SensorNode, AChunkThatIsAskedForIsSentAgainUntilLongAfterItWasShown) {
  Sensor sensor(one_sensor());
  const Packet first = sensor.see(wall());
  const EncodedChunk& wanted = first.chunks.at(1);
  ChunkKey unknown = wanted.key;
  unknown.version += 40;
  const codec::Control request{
      .key_frames = {}, .chunks = {unknown, wanted.key, wanted.key}, .taken = {}};
  const auto answer = codec::decode_chunks(sensor.node.answer(request));
  ASSERT_TRUE(answer) << answer.error().message;
  EXPECT_EQ(*answer, std::vector<EncodedChunk>{wanted});
  EXPECT_TRUE(sensor.node.answer({.key_frames = {}, .chunks = {unknown}, .taken = {}}).empty());
  EXPECT_TRUE(sensor.node.answer({}).empty());

  EXPECT_TRUE(sensor.see(wall()).chunks.empty()) << "an answer is no reason to send all of it";
  sensor.see({});
  EXPECT_FALSE(sensor.node.answer(request).empty()) << "who asks may not know yet";
  for (std::uint64_t i = 0; i < codec::ChunkCache::kManifestsKept; ++i) sensor.see({});
  EXPECT_TRUE(sensor.node.answer(request).empty());
}

// Frames that come to nothing.

TEST(SensorNode, AFrameWithoutSurfaceIsToldAndEmptiesTheManifest) {
  Sensor sensor(one_sensor());
  sensor.see(wall());
  const auto surface = sensor.node.reconstruct(sensor.frame({}));
  ASSERT_TRUE(surface);
  EXPECT_TRUE(sensor.node.is_empty(*surface));
  const Error told = sensor.node.no_surface(surface->frame);
  EXPECT_EQ(told.cause, Error::Cause::empty);
  EXPECT_TRUE(test::is_one_line(told.message));
  EXPECT_NE(told.message.find("frame 1: depth holds no surface"), std::string::npos)
      << told.message;

  const auto packet = codec::HeadReader().read(*sensor.node.code(*surface));
  ASSERT_TRUE(packet) << packet.error().message;
  EXPECT_TRUE(packet->manifest.empty());
  EXPECT_EQ(packet->textures.size(), 1u);

  const Packet next = sensor.see(wall());
  EXPECT_EQ(next.sequence, 2u);
  EXPECT_EQ(keys_of(next.chunks), next.manifest);
  EXPECT_FALSE(next.manifest.empty());
}

TEST(SensorNode, AFrameWithABrokenPoseIsRefusedAndTheNextIsFine) {
  constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
  Pose scaled, far_away, nowhere;
  scaled.rotation.m[0] = 2;
  far_away.translation = {3e6, 0, 0};
  nowhere.translation = {kNaN, 0, 0};
  for (const bool layers : {false, true})
    for (const Pose& broken : {scaled, far_away, nowhere}) {
      Scene scene = one_sensor();
      scene.still.layers = layers;
      Sensor sensor(scene);
      const Packet first = sensor.see(wall());
      Frame frame = sensor.frame(wall());
      frame.T_world_depth = broken;
      const auto refused = sensor.send(frame);
      ASSERT_FALSE(refused);
      EXPECT_EQ(refused.error().cause, Error::Cause::invalid);
      EXPECT_TRUE(test::is_one_line(refused.error().message)) << refused.error().message;
      EXPECT_NE(refused.error().message.find("frame 1: camera or pose cannot be used"),
                std::string::npos)
          << refused.error().message;
      const Packet next = sensor.see(wall());
      EXPECT_EQ(next.sequence, 1u);
      EXPECT_EQ(next.manifest, first.manifest) << "what was sent before still holds";
    }
}

TEST(SensorNode, ToldIsWhereColourSeesWhatNoMeshShows) {
  for (const bool layers : {false, true}) {
    Scene scene = one_sensor();
    scene.still.layers = layers;
    scene.volume = Box3d{{-9, -9, 1}, {9, 9, 9}};
    Sensor sensor(scene);
    const auto blind = [&](const Solids& solids) {
      return sensor.see(solids).sources.at(0).blind_color;
    };
    const TileMask none = blind(wall());
    ASSERT_TRUE(none.is_of(96, 64));
    EXPECT_EQ(std::ranges::count(none.tiles, 1), 0);
    const TileMask before = blind(test::wall_with_box({-0.15, -0.15, 0.6}));
    EXPECT_TRUE(before.at(2, 1) && before.at(3, 2)) << "the box is before the volume";
    EXPECT_FALSE(before.at(0, 0) || before.at(5, 3));
    EXPECT_EQ(std::ranges::count(blind(test::wall_with_box({-0.15, -0.15, 1.2})).tiles, 1), 0);
  }
}

// Determinism.

TEST(SensorNode, SameBytesOnOneAndTwoThreads) {
  Scene patches = one_sensor();
  patches.fusion.decomposition = Decomposition::patches;
  patches.fusion.patches_x = patches.fusion.patches_y = 2;
  for (const Scene& scene : {one_sensor(), with_layers(), patches}) {
    std::vector<std::vector<std::byte>> sent[2];
    for (const int threads : {1, 2})
      Arena(threads).run([&] {
        Sensor sensor(scene);
        for (int i = 0; i < 16; ++i) {
          Solids solids = test::furnished_room();
          solids.balls[0].center.x += 0.1 * (i / 12);  // learnt, it moves
          Frame frame = sensor.frame(solids);
          frame.depth = test::with_noise(frame.depth, 0.001, 1 + i);
          auto bytes = sensor.send(frame);
          ASSERT_TRUE(bytes);
          sent[threads - 1].push_back(*std::move(bytes));
        }
      });
    EXPECT_EQ(sent[0], sent[1]);
  }
}

}  // namespace
}  // namespace mr
