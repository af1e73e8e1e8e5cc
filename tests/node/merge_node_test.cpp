#include "mr/node/merge_node.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "mr/codec/head.h"
#include "mr/codec/packet_codec.h"
#include "mr/codec/receiver.h"
#include "mr/core/parallel.h"
#include "mr/kit/topology.h"
#include "support/merger_rig.h"

namespace mr {
namespace {

using node::MergeNode;
using std::chrono::milliseconds;
using test::box_on_the_right;
using test::doubled_share;
using test::facing_the_wall;
using test::ids_of;
using test::kApart_m;
using test::keys_of;
using test::kLearnt;
using test::kWall_m;
using test::Merger;
using test::seen_together_m2;
using test::Solids;
using test::two_sensors;
using test::two_sensors_below_west;
using test::two_sensors_with_layers;
using test::unit_of;
using test::wall;

codec::Control key_frames_of(std::vector<StreamId> streams) {
  return {.key_frames = std::move(streams), .chunks = {}, .taken = {}};
}

// What the head says.

TEST(MergeNode, HeadNamesSceneMergerAndTick) {
  Scene scene = two_sensors();
  scene.coding.texture_qp = 31, scene.coding.texture_scale = 0.5;
  scene.merge.simplify.ratio = 0.75;
  Merger root(scene, true, {.epoch = 9, .now = {}});
  EXPECT_EQ(root.node.id(), "root");
  for (std::uint64_t i = 0; i < 3; ++i) {
    const TimePoint tick = root.now();
    const Packet packet = root.see(wall());
    EXPECT_EQ(packet.scene, "rig");
    EXPECT_EQ(packet.node, "root");
    EXPECT_EQ(packet.epoch, 9u);
    EXPECT_EQ(packet.sequence, i);
    EXPECT_EQ(packet.captured_at, tick) << "a multiple of the frame period";
    EXPECT_EQ(packet.plan, (CodingPlan{{0.75, 0}, 0, 5, 0.5, 31, 0.5, 23}));
    EXPECT_TRUE(packet.marks.empty()) << "there is no clock";
    ASSERT_EQ(packet.sources.size(), 2u);
    for (std::uint32_t s = 0; s < 2; ++s)
      EXPECT_EQ(packet.sources[s],
                (SourceInfo{SensorId{s}, tick + test::kExposure / 2, scene.sensors[s].depth_camera,
                            scene.sensors[s].T_world_depth[0], scene.sensors[s].precision}));
  }
}

TEST(MergeNode, AnInnerMergerDoesNotSayThatItDecimates) {
  Scene scene = two_sensors_below_west();
  scene.merge.simplify.ratio = 0.75;
  EXPECT_EQ(Merger(scene, false).see(wall()).plan.decimation.ratio, 1);
}

TEST(MergeNode, AClockMarksBeginningAndEndAfterTheMarksOfTheInputs) {
  int asked = 0;
  const TimePoint start{std::chrono::hours(2)};
  Merger root(two_sensors(), true,
              {.epoch = 0, .now = [&] { return start + std::chrono::seconds(asked++); }});
  const TimePoint before = start - std::chrono::hours(1);
  for (std::uint32_t i = 0; i < 2; ++i) {
    Packet packet = *codec::HeadReader().read(root.sense(i, wall()));
    packet.marks = {{"sensors/coded", before + std::chrono::seconds(i)}};
    ASSERT_TRUE(root.receive(i, codec::encode_packet(packet)));
  }
  EXPECT_EQ(root.merged().marks,
            (std::vector<TimeMark>{{"sensors/coded", before + std::chrono::seconds(1)},
                                   {"root/gathered", start},
                                   {"root/merged", start + std::chrono::seconds(1)}}));
}

TEST(MergeNode, WholeHeadIsSentToWhoAsks) {
  Merger root(two_sensors());
  for (int i = 0; i < 5; ++i) root.see(wall());
  codec::HeadReader late;
  const auto read_next = [&] {
    for (std::uint32_t i = 0; i < 2; ++i) EXPECT_TRUE(root.receive(i, root.sense(i, wall())));
    return late.read(*root.merge());
  };
  EXPECT_FALSE(read_next());
  EXPECT_TRUE(late.lacks_base());
  root.node.answer({.key_frames = {}, .chunks = {}, .taken = {}, .whole_head = true});
  const auto packet = read_next();
  ASSERT_TRUE(packet) << packet.error().message;
  EXPECT_EQ(packet->sequence, 6u);
}

// The surface.

TEST(MergeNode, WhatTwoSensorsSeeBecomesOneLayer) {
  for (const bool is_root : {true, false}) {
    Merger merger(is_root ? two_sensors() : two_sensors_below_west(), is_root);
    const Packet packet = merger.see(wall());
    const Mesh mesh = merger.surface();
    for (const Vec3f p : mesh.positions) EXPECT_NEAR(p.z, kWall_m, 0.002);
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
      EXPECT_LT(mesh.area_normal(t).z, 0) << "turned away from the sensors";
    const double seen = seen_together_m2(merger.scene());
    EXPECT_LE(surface_area_m2(mesh), seen * 1.001);
    EXPECT_GE(surface_area_m2(mesh), seen * 0.93) << "a voxel's width less on every side";
    EXPECT_EQ(doubled_share(mesh), 0);
    EXPECT_EQ(kit::count_nonmanifold_edges(mesh), 0u);
    for (const EncodedChunk& chunk : packet.chunks) EXPECT_EQ(chunk.key.id.source, kMergedSource);
    EXPECT_EQ(keys_of(packet.chunks), packet.manifest);
    EXPECT_TRUE(std::ranges::is_sorted(packet.manifest));

    const auto kept = merger.node.surface();
    ASSERT_TRUE(kept);
    EXPECT_EQ(kept->triangles.size(), mesh.triangles.size()) << "it is what was sent";
    EXPECT_NEAR(surface_area_m2(*kept), surface_area_m2(mesh), 1e-6);
  }
}

TEST(MergeNode, NoSurfaceBeforeTheFirstMerge) {
  EXPECT_FALSE(Merger(two_sensors()).node.surface());
}

TEST(MergeNode, SurfacesMeetInTheWorldWhereverTheirSensorsStand) {
  const Vec3d middle{0, 0, kWall_m};
  Merger root(test::scene_of_sensors({look_at({-1.1, -0.3, 0.1}, middle, {0.2, -1, 0}),
                                      look_at({0.9, 0.4, -0.2}, middle, {-0.1, -1, 0})}));
  root.see(wall());
  const Mesh mesh = root.surface();
  for (const Vec3f p : mesh.positions) EXPECT_NEAR(p.z, kWall_m, 0.015);
  EXPECT_LT(doubled_share(mesh), 0.002);
  EXPECT_GT(surface_area_m2(mesh), 4.2);
}

TEST(MergeNode, SensorsOnTwoSidesOfABoardGiveBothSides) {
  Solids board;
  board.boxes = {{{-0.5, -0.4, 0.9}, {0.5, 0.4, 1.1}}};
  Merger root(
      test::scene_of_sensors({facing_the_wall(), look_at({0, 0, 2}, {0, 0, 1}, {0, -1, 0})}));
  root.see(board);
  const Mesh mesh = root.surface();
  double front = 0, back = 0;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const double z = mesh.area_normal(t).z / 2;
    (z < 0 ? front : back) += std::abs(z);
    EXPECT_NEAR(mesh.centroid(t).z, z < 0 ? 0.9 : 1.1, 0.02);
  }
  EXPECT_NEAR(front, 0.8, 0.15);
  EXPECT_NEAR(back, 0.8, 0.15);
}

TEST(MergeNode, GapsAndIslandsAreTreatedAsTheSceneAsks) {
  // Two sensors that see the wall left and right of a strip 20 cm wide, and a box.
  const auto area_m2 = [](double gap_m, double island_area_m2) {
    Scene scene =
        test::scene_of_sensors({facing_the_wall({-1.2, 0, 0}), facing_the_wall({1.2, 0, 0})});
    scene.merge.gap_m = gap_m, scene.merge.island_area_m2 = island_area_m2;
    Merger root(scene);
    root.see(test::wall_with_box({1.1, 0, 1.3}));
    return surface_area_m2(root.surface());
  };
  const double usual = area_m2(0, 0);
  EXPECT_NEAR(area_m2(0.4, 0) - usual, 0.2 * 1.8, 0.12);
  EXPECT_NEAR(usual - area_m2(0, 0.5), 0.3 * 0.3, 0.04);
}

TEST(MergeNode, OnlyTheRootDecimates) {
  const auto merge = [](bool is_root, double ratio) {
    Scene scene = is_root ? two_sensors() : two_sensors_below_west();
    scene.simplify.ratio = 0.8;
    scene.merge.simplify.ratio = ratio;
    Merger merger(scene, is_root);
    merger.see(test::furnished_room());
    float error_m = 0;
    for (const auto& chunk : merger.decoded().chunks) error_m = std::max(error_m, chunk->error_m);
    return std::pair(static_cast<double>(merger.surface().triangles.size()), error_m);
  };
  const auto [all, error_m] = merge(true, 1);
  const auto [half, error_of_half_m] = merge(true, 0.5);
  EXPECT_GT(all, 500);
  EXPECT_GT(error_m, 0) << "what the sensors' decimation cost is handed on";
  EXPECT_LT(half, 0.55 * all);
  EXPECT_GT(half, 0.25 * all);
  EXPECT_GT(error_of_half_m, error_m);
  EXPECT_EQ(merge(false, 0.5), merge(false, 1));
}

TEST(MergeNode, ARegionIsOwnedByOneMerger) {
  Scene scene = two_sensors_below_west();
  const double middle = 0;  // a border of the chunk grid
  MergerConfig left = scene.mergers[0], right = left;
  left.region = Box3d{{-5.12, -5.12, -5.12}, {middle, 5.12, 5.12}};
  right.region = Box3d{{middle, -5.12, -5.12}, {5.12, 5.12, 5.12}};
  Merger whole(scene, false), west(scene, false, {}, &left), east(scene, false, {}, &right);
  whole.see(wall()), west.see(wall()), east.see(wall());
  const Mesh of_west = west.surface(), of_east = east.surface();
  for (std::size_t t = 0; t < of_west.triangles.size(); ++t)
    EXPECT_LT(of_west.centroid(t).x, middle);
  for (std::size_t t = 0; t < of_east.triangles.size(); ++t)
    EXPECT_GE(of_east.centroid(t).x, middle);
  EXPECT_NEAR(surface_area_m2(of_west) + surface_area_m2(of_east), surface_area_m2(whole.surface()),
              0.01);
}

TEST(MergeNode, TheOrderOfInputsMattersNeitherToTheHeadNorToTheSurface) {
  Scene turned = two_sensors();
  std::ranges::reverse(turned.mergers[0].inputs);
  Merger a(two_sensors()), b(turned);
  const Packet of_a = a.see(wall()), of_b = b.see(wall());
  EXPECT_EQ(of_a.sources, of_b.sources);
  EXPECT_EQ(of_a.views, of_b.views);
  const Mesh mesh_a = a.surface(), mesh_b = b.surface();
  EXPECT_NEAR(surface_area_m2(mesh_a), surface_area_m2(mesh_b), 0.01);
  EXPECT_EQ(doubled_share(mesh_b), 0);
}

// Chunks from tick to tick.

TEST(MergeNode, UnchangedInputsAreNotMergedAgain) {
  Merger root(two_sensors());
  const Packet first = root.see(wall());
  EXPECT_FALSE(root.node.reused());
  const Packet second = root.see(wall());
  EXPECT_TRUE(root.node.reused());
  EXPECT_EQ(root.node.trace().stages().at("overlap").size(), 1u);
  EXPECT_EQ(second.manifest, first.manifest);
  EXPECT_TRUE(second.chunks.empty());
  EXPECT_EQ(second.sources.at(1).captured_at - first.sources.at(1).captured_at, milliseconds(100))
      << "but the pictures are new";
  root.see(box_on_the_right(0));
  EXPECT_FALSE(root.node.reused());
}

TEST(MergeNode, AChunkFarFromAllChangeKeepsItsKey) {
  Merger root(two_sensors());
  const Packet first = root.see(box_on_the_right(0)), second = root.see(box_on_the_right(0.2));
  int kept = 0, fresh = 0;
  for (const ChunkKey& key : second.manifest) {
    const bool is_kept = std::ranges::count(first.manifest, key) > 0;
    const bool is_sent = std::ranges::count(keys_of(second.chunks), key) > 0;
    EXPECT_NE(is_kept, is_sent) << "a key names one content for ever";
    EXPECT_TRUE(is_kept || key.id.cube.x >= -2) << "the left sensor alone sees that";
    kept += is_kept, fresh += is_sent;
  }
  EXPECT_GT(kept, 3);
  EXPECT_GT(fresh, 0);
}

TEST(MergeNode, AChunkThatIsAskedForIsSentAgain) {
  Merger root(two_sensors());
  const Packet first = root.see(wall());
  const EncodedChunk& wanted = first.chunks.at(1);
  ChunkKey unknown = wanted.key, of_a_sensor = wanted.key;
  unknown.version += 40, of_a_sensor.id.source = SensorId{0};
  const auto answer = codec::decode_chunks(root.node.answer(
      {.key_frames = {}, .chunks = {unknown, of_a_sensor, wanted.key}, .taken = {}}));
  ASSERT_TRUE(answer) << answer.error().message;
  EXPECT_EQ(*answer, std::vector<EncodedChunk>{wanted});
  ASSERT_TRUE(root.node.find(wanted.key));
  EXPECT_EQ(*root.node.find(wanted.key), wanted);
  EXPECT_FALSE(root.node.find(unknown));

  EXPECT_TRUE(
      root.node.answer({.key_frames = {}, .chunks = {unknown, of_a_sensor}, .taken = {}}).empty());
  EXPECT_TRUE(root.node.answer({}).empty());
  EXPECT_TRUE(root.see(wall()).chunks.empty()) << "a request is no reason to send all of it";
}

TEST(MergeNode, ABackgroundIsNamedAlwaysAndBroughtOnce) {
  Merger root(two_sensors());
  EncodedChunk background = Merger(two_sensors()).see(wall()).chunks.at(0);
  background.key = {{{9, 9, 9}, kBackgroundSource}, 0, 1};
  root.node.set_background({background});
  const auto see = [&] {
    for (std::uint32_t i = 0; i < 2; ++i) EXPECT_TRUE(root.receive(i, root.sense(i, wall())));
    return *codec::decode_packet(*root.merge());
  };
  const Packet first = see(), second = see();  // the first ones bring their heads themselves
  for (const Packet& packet : {first, second})
    EXPECT_EQ(std::ranges::count(packet.manifest, background.key), 1);
  EXPECT_EQ(std::ranges::count(first.chunks, background), 1);
  EXPECT_TRUE(second.chunks.empty());
  EXPECT_EQ(*root.node.find(background.key), background);
}

// Inputs that are not there, or broken.

TEST(MergeNode, TheRestIsMergedWithoutAMissingInput) {
  Merger root(two_sensors());
  const double one = test::seen_wall_m2(root.scene().sensors[0].depth_camera);
  const Packet alone = root.see(wall(), {1});
  ASSERT_EQ(alone.sources.size(), 1u);
  EXPECT_EQ(alone.sources[0].sensor, SensorId{0});
  EXPECT_EQ(ids_of(alone.views), std::vector{ViewId{0}});
  EXPECT_NEAR(surface_area_m2(root.surface()), one, 0.08 * one);

  const Packet both = root.see(wall());
  EXPECT_EQ(both.sources.size(), 2u);
  EXPECT_EQ(ids_of(both.views), (std::vector{ViewId{0}, ViewId{1}}));
  EXPECT_GT(surface_area_m2(root.surface()), 1.3 * one);

  const Packet late = root.see(wall(), {0});
  EXPECT_EQ(late.sources.size(), 2u) << "for a while it is shown as it was";
  EXPECT_LT(late.sources.at(0).captured_at, late.sources.at(1).captured_at);
  Packet gone;
  for (int i = 0; i < 8; ++i) gone = root.see(wall(), {0});
  ASSERT_EQ(gone.sources.size(), 1u);
  EXPECT_EQ(gone.sources[0].sensor, SensorId{1});
  EXPECT_NEAR(surface_area_m2(root.surface()), one, 0.08 * one);
  for (const auto& chunk : root.decoded().chunks)
    for (const ViewId view : triangle_views(chunk->mesh)) EXPECT_NE(view, ViewId{0});
}

TEST(MergeNode, ABrokenPacketIsRefusedAndAllIsWholeSoonAfter) {
  for (const bool is_root : {true, false}) {
    Merger merger(is_root ? two_sensors() : two_sensors_below_west(), is_root);
    for (int i = 0; i < 5; ++i) merger.see(wall());
    ASSERT_TRUE(merger.receive(0, merger.sense(0, wall())));
    std::vector<std::byte> half = merger.sense(1, wall());
    half.resize(half.size() / 2);
    for (const auto& broken : {half, std::vector<std::byte>{}, std::vector<std::byte>(1000)}) {
      const Status refused = merger.receive(1, broken);
      ASSERT_FALSE(refused);
      EXPECT_TRUE(test::is_one_line(refused.error().message)) << refused.error().message;
      EXPECT_NE(refused.error().message.find("cam-1"), std::string::npos);
    }
    EXPECT_EQ(merger.node.inputs().drops().total(), 3u);
    const Packet then = merger.merged();
    ASSERT_EQ(then.sources.size(), 2u) << "it is shown as it was";
    EXPECT_EQ(then.sources[0].captured_at - then.sources[1].captured_at, milliseconds(100));
    merger.see(wall());  // its picture builds on one that was lost
    const TimePoint now = merger.now();
    const Packet whole = merger.see(wall());
    ASSERT_EQ(whole.sources.size(), 2u);
    EXPECT_EQ(whole.sources[1].captured_at, now + test::kExposure / 2);
    EXPECT_EQ(whole.sequence, 7u);
    merger.decoded();
  }
}

TEST(MergeNode, APacketOfAnotherNodeIsRefused) {
  Merger root(two_sensors());
  const Status refused = root.receive(0, root.sense(1, wall()));
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().cause, Error::Cause::invalid);
}

TEST(MergeNode, InputsWithoutSurfaceGiveAnEmptyPacket) {
  Merger root(two_sensors());
  root.see(wall());
  const Packet packet = root.see({});
  EXPECT_TRUE(packet.manifest.empty());
  EXPECT_EQ(packet.sources.size(), 2u);
  EXPECT_FALSE(root.see(wall()).chunks.empty());
}

TEST(MergeNode, ATickThatCannotBeCodedIsAnErrorAndTheNextIsFine) {
  Scene scene = two_sensors();
  scene.atlas.width = scene.atlas.height = 16;  // room for one tile
  Merger root(scene);
  EXPECT_EQ(root.see(wall(), {1}).sequence, 0u);
  for (std::uint32_t i = 0; i < 2; ++i) ASSERT_TRUE(root.receive(i, root.sense(i, wall())));
  const auto refused = root.merge();
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().cause, Error::Cause::too_large);
  EXPECT_TRUE(test::is_one_line(refused.error().message)) << refused.error().message;
  for (int i = 0; i < 8; ++i) {  // until the right one is gone
    ASSERT_TRUE(root.receive(0, root.sense(0, wall())));
    if (i < 7) static_cast<void>(root.merge());
  }
  const Packet next = root.merged();
  EXPECT_EQ(next.sources.size(), 1u);
}

// Pictures.

TEST(MergeNode, TheRootComposesOneAtlas) {
  for (const double scale : {1.0, 0.5}) {
    Scene scene = two_sensors();
    scene.coding.texture_scale = scale;
    Merger root(scene);
    const Packet packet = root.see(wall());
    ASSERT_EQ(packet.textures.size(), 1u);
    const TextureUnit& unit = packet.textures[0];
    EXPECT_EQ(unit.stream, StreamId{0});
    EXPECT_TRUE(unit.key_frame);
    ASSERT_EQ(ids_of(packet.views), (std::vector{ViewId{0}, ViewId{1}}));
    for (const View& view : packet.views) {
      EXPECT_EQ(view.stream, StreamId{0});
      EXPECT_EQ(view.layout, unit.layout);
      EXPECT_EQ(view.image_rect, (Rect{0, 0, 96, 64}));
      EXPECT_EQ(view.atlas_rect.width, 96 * scale);
      EXPECT_EQ(view.atlas_rect.height, 64 * scale);
      EXPECT_LE(view.atlas_rect.x + view.atlas_rect.width, unit.width);
      EXPECT_LE(view.atlas_rect.y + view.atlas_rect.height, unit.height);
      EXPECT_EQ(view.camera(), *scene.sensor(sensor_of(view.id)).color_camera);
    }
    EXPECT_NE(packet.views[0].atlas_rect, packet.views[1].atlas_rect);

    // Each side is textured by who sees it, and nearly all is.
    double textured = 0;
    const Mesh mesh = root.surface();
    const std::vector<ViewId> views = triangle_views(mesh);
    for (std::size_t t = 0; t < views.size(); ++t) {
      if (views[t] != kNoView) textured += length(mesh.area_normal(t)) / 2;
      EXPECT_TRUE(views[t] != ViewId{1} || mesh.centroid(t).x > -kApart_m / 2);
      EXPECT_TRUE(views[t] != ViewId{0} || mesh.centroid(t).x < kApart_m / 2);
    }
    EXPECT_GT(textured, 0.7 * surface_area_m2(mesh)) << "pictures are less high than depth";
  }
}

TEST(MergeNode, AnOccluderThatIsInNoMeshIsNotPrintedOnTheWall) {
  for (const bool layers : {false, true}) {
    Scene scene = two_sensors();
    scene.still.layers = layers;
    scene.volume = Box3d{{-9, -9, 1.2}, {9, 9, 9}};
    Merger root(scene);
    // Before the volume, and hides the middle of the wall from the left sensor alone.
    const Solids solids = test::wall_with_box({-0.5, -0.15, 0.6});
    for (int i = 0; i < (layers ? kLearnt : 1); ++i) root.see(solids);
    const Mesh mesh = root.surface();
    const std::vector<ViewId> views = triangle_views(mesh);
    double hidden_m2 = 0;
    for (std::size_t t = 0; t < views.size(); ++t) {
      const Vec3f p = mesh.centroid(t);
      if (p.x < -0.05f || p.x > 0.5f || std::abs(p.y) > 0.25f) continue;
      hidden_m2 += length(mesh.area_normal(t)) / 2;
      EXPECT_EQ(views[t], ViewId{1}) << p.x << " " << p.y;
    }
    EXPECT_GT(hidden_m2, 0.2) << layers;
  }
}

TEST(MergeNode, AnInnerMergerHandsPicturesOnUntouched) {
  Merger west(two_sensors_below_west(), false);
  for (int tick = 0; tick < 3; ++tick) {
    std::vector<View> views;
    std::vector<TextureUnit> units;
    for (std::uint32_t i = 0; i < 2; ++i) {
      const auto bytes = west.sense(i, wall());
      const Packet packet = *codec::decode_packet(bytes);  // the first ones bring their heads
      views.insert(views.end(), packet.views.begin(), packet.views.end());
      units.insert(units.end(), packet.textures.begin(), packet.textures.end());
      ASSERT_TRUE(west.receive(i, bytes));
    }
    const Packet packet = west.merged();
    EXPECT_EQ(packet.views, views);
    EXPECT_EQ(packet.textures, units);
    EXPECT_EQ(units.size(), 2u);
  }
  // Triangles name who measured them, for the root to choose.
  for (const auto& chunk : west.decoded().chunks)
    for (const SensorId sensor : triangle_sensors(chunk->mesh)) EXPECT_LT(sensor, SensorId{2});
}

TEST(MergeNode, ARootAboveAnInnerMergerShowsTheSame) {
  const Scene scene = two_sensors_below_west();
  Merger west(scene, false), flat(two_sensors());
  MergeNode root(scene, scene.mergers[1], true);
  codec::Receiver receiver(scene.lattice);
  for (std::uint32_t i = 0; i < 2; ++i) ASSERT_TRUE(west.receive(i, west.sense(i, wall())));
  const TimePoint now = west.now() + milliseconds(90);
  ASSERT_TRUE(root.inputs().receive(0, *west.merge(), now));
  const auto captures = root.inputs().next_set(now + milliseconds(60));
  ASSERT_TRUE(captures && *captures);
  const Packet packet = *codec::decode_packet(*root.merge(**captures)), usual = flat.see(wall());
  EXPECT_TRUE(receiver.accept(packet).empty());
  EXPECT_EQ(packet.node, "root");
  EXPECT_EQ(packet.sources, usual.sources);
  EXPECT_EQ(packet.views, usual.views);
  EXPECT_NEAR(surface_area_m2(test::all_of(receiver.scene()->chunks)),
              surface_area_m2(flat.surface()), 0.02);
}

TEST(MergeNode, TheRootGivesAKeyFrameThatWasAskedForOnce) {
  Merger root(two_sensors());
  for (int i = 0; i < 3; ++i) root.see(wall());
  const auto is_key = [&] {
    const Packet packet = root.see(wall());
    const TextureUnit* unit = unit_of(packet, StreamId{0});
    return unit && unit->key_frame;
  };
  EXPECT_FALSE(is_key());
  EXPECT_TRUE(root.node.answer(key_frames_of({StreamId{0}})).empty());
  EXPECT_TRUE(is_key());
  EXPECT_FALSE(is_key());
  EXPECT_TRUE(root.node.take_wanted_key_frames().empty())
      << "the inputs have nothing to do with it";
  root.node.answer(key_frames_of({StreamId{77}}));
  EXPECT_FALSE(is_key()) << "there is no such stream";
}

TEST(MergeNode, AWishForAKeyFrameTravelsThroughAnInnerMerger) {
  Merger west(two_sensors_below_west(), false);
  for (int i = 0; i < 3; ++i) west.see(wall());
  EXPECT_TRUE(west.node.take_wanted_key_frames().empty());
  EXPECT_TRUE(west.node.answer(key_frames_of({StreamId{1}})).empty());
  const auto wishes = west.node.take_wanted_key_frames();
  EXPECT_EQ(wishes, std::vector{StreamId{1}});
  EXPECT_TRUE(west.node.take_wanted_key_frames().empty());

  west.node.inputs().ask_key_frames(wishes);
  west.see(wall());  // asks the sensor
  const Packet packet = west.see(wall());
  ASSERT_TRUE(unit_of(packet, StreamId{0}) && unit_of(packet, StreamId{1}));
  EXPECT_FALSE(unit_of(packet, StreamId{0})->key_frame);
  EXPECT_TRUE(unit_of(packet, StreamId{1})->key_frame);
}

TEST(MergeNode, TheDrawingIsShownAtTheRootOnly) {
  for (const bool is_root : {true, false}) {
    Merger merger(is_root ? two_sensors() : two_sensors_below_west(), is_root);
    int drawn = 0;
    merger.node.set_drawing_listener([&](const node::RootAtlas::Drawing& drawing) {
      ++drawn;
      EXPECT_EQ(drawing.tick.views.size(), 2u);
      EXPECT_FALSE(drawing.moving.empty());
      EXPECT_EQ(drawing.still, nullptr);
    });
    merger.see(wall()), merger.see(wall());
    EXPECT_EQ(drawn, is_root ? 2 : 0);
  }
}

// Calibration.

/// A tick in which a sensor stands `by` beside its stated place.
Packet see_with_push(Merger& merger, std::uint32_t pushed, Vec3d by, const Solids& solids) {
  for (std::uint32_t i = 0; i < merger.sensors.size(); ++i) {
    Frame frame = test::frame_of(merger.scene(), SensorId{i}, 0, {});
    Pose place = frame.T_world_depth;
    if (i == pushed) place.translation = place.translation + by;
    frame.depth = test::depth_picture(solids, merger.scene().sensors[i].depth_camera, place);
    const auto since = merger.now() - TimePoint(std::chrono::hours(1));
    frame.exposure_start += since, frame.exposure_end += since;
    EXPECT_TRUE(merger.receive(i, merger.sense(frame)));
  }
  return merger.merged();
}

TEST(MergeNode, ResidualsSayHowFarTwoInputsLieApart) {
  Merger exact(two_sensors()), pushed(two_sensors());
  exact.see(wall());
  see_with_push(pushed, 1, {0, 0, 0.03}, wall());
  for (Merger* merger : {&exact, &pushed}) {
    const auto& residuals = merger->node.calibration().residuals();
    ASSERT_EQ(residuals.size(), 1u);
    EXPECT_EQ(residuals[0].a, "cam-0");
    EXPECT_EQ(residuals[0].b, "cam-1");
    EXPECT_NEAR(residuals[0].residual_mm, merger == &exact ? 0 : 30, 4);
    EXPECT_GT(residuals[0].shared_m2, 1);
  }
}

TEST(MergeNode, ASensorThatWasPushedIsBentOnWhileItsRoomRests) {
  constexpr int kRest = 150;  // a fifth of a voxel every 30th tick
  Merger root(two_sensors_with_layers());
  for (int i = 0; i < kLearnt; ++i) root.see(wall());
  for (int i = 0; i < kLearnt + kRest; ++i) see_with_push(root, 1, {0, 0, 0.03}, wall());
  const auto& residuals = root.node.calibration().residuals();
  ASSERT_EQ(residuals.size(), 1u);
  EXPECT_NEAR(residuals[0].residual_mm, 30, 4);
  EXPECT_LT(residuals[0].corrected_mm, 15);
}

TEST(MergeNode, ASensorThatMovedIsBentFromWhereItStandsNow) {
  Merger root(two_sensors());
  see_with_push(root, 1, {0, 0, 0.03}, wall());
  std::vector<kit::Part> parts;
  for (std::uint32_t i = 0; i < 2; ++i) parts.push_back({{}, 0, {test::source(i, {})}});
  parts[1].sources[0].T_world_depth.translation.x += 1;
  const calib::Bends bends = root.node.calibration().bends(parts);
  ASSERT_TRUE(bends[0] && bends[1]);
  EXPECT_EQ(bends[1]->eye(), parts[1].sources[0].T_world_depth.translation);
  EXPECT_NE(bends[1]->offset_m, std::vector<double>(bends[1]->offset_m.size(), 0.0));
}

TEST(MergeNode, ASensorThatDoesNotFitIsToldOnceAndLeftOutWhereThatIsWanted) {
  for (const double leave_out_mm : {0.0, 40.0}) {
    Scene scene = test::scene_of_sensors(
        {facing_the_wall({-0.3, 0, 0}), facing_the_wall(), facing_the_wall({0.3, 0, 0})});
    scene.merge.leave_out_mm = leave_out_mm;
    Merger root(scene);
    EXPECT_FALSE(root.node.calibration().take_notice());
    see_with_push(root, 2, {0, 0, 0.07}, wall());
    const auto notice = root.node.calibration().take_notice();
    ASSERT_TRUE(notice);
    EXPECT_TRUE(test::is_one_line(*notice));
    EXPECT_NE(notice->find("'cam-2' does not fit its neighbours"), std::string::npos) << *notice;
    EXPECT_FALSE(root.node.calibration().take_notice());
    bool is_shown = false;
    for (const Vec3f p : root.surface().positions) is_shown |= p.z < kWall_m - 0.05;
    EXPECT_EQ(is_shown, leave_out_mm == 0);
  }
}

TEST(MergeNode, RefinedPosesOfSourcesAndViewsNearTheTruthTogether) {
  const Vec3d by{0.02, -0.015, 0.025};
  for (const auto& [is_root, refine] : {std::pair(true, false), {true, true}, {false, true}}) {
    Scene scene = test::scene_of_sensors({look_at({-0.6, -0.2, -0.7}, {0, 0.1, 1.5}, {0, -1, 0}),
                                          look_at({0.6, -0.3, -0.7}, {0, 0.1, 1.5}, {0, -1, 0})});
    scene.merge.refine = refine;
    if (!is_root) scene = two_sensors_below_west(scene);
    Merger merger(scene, is_root);
    Packet packet;
    for (int i = 0; i < 7; ++i)  // what does not change is not looked at
      packet = see_with_push(merger, 1, by + Vec3d{0, 0, 1e-4 * i}, test::furnished_room());
    ASSERT_EQ(packet.sources.size(), 2u);
    ASSERT_EQ(packet.views.size(), 2u);
    const Vec3d apart =
        packet.sources[1].T_world_depth.translation - packet.sources[0].T_world_depth.translation;
    const double off_m = length(apart - Vec3d{1.2, -0.1, 0} - by);
    if (refine)
      EXPECT_LT(off_m, length(by) - 0.003) << "each goes 1 mm every third tick";
    else
      EXPECT_NEAR(off_m, length(by), 1e-9);
    for (std::size_t i = 0; i < 2; ++i) {
      const Pose view = packet.sources[i].T_world_depth * scene.sensors[i].T_color_depth.inverse();
      EXPECT_EQ(packet.sources[i].T_world_depth == scene.sensors[i].T_world_depth[0], !refine);
      for (std::size_t k = 0; k < 16; ++k)
        EXPECT_NEAR(packet.views[i].T_world_camera.matrix()[k], view.matrix()[k], 1e-9);
    }
  }
}

// Determinism.

TEST(MergeNode, SameBytesOnOneAndTwoThreads) {
  for (const bool is_root : {true, false})
    for (const bool layers : {true, false}) {
      Scene scene = layers ? two_sensors_with_layers() : two_sensors();
      if (!is_root) scene = two_sensors_below_west(scene);
      std::vector<std::vector<std::byte>> sent[2];
      for (const int threads : {1, 2})
        Arena(threads).run([&] {
          Merger merger(scene, is_root);
          for (int i = 0; i < 16; ++i) {
            Solids solids = test::furnished_room();
            solids.balls[0].center.x += 0.1 * (i / 13);  // learnt, it moves
            for (std::uint32_t s = 0; s < 2; ++s) {
              Frame frame = test::frame_of(merger.scene(), SensorId{s},
                                           static_cast<std::uint64_t>(i), solids);
              frame.depth = test::with_noise(frame.depth, 0.001, 1 + 2 * i + s);
              ASSERT_TRUE(merger.receive(s, merger.sense(frame)));
            }
            auto bytes = merger.merge();
            ASSERT_TRUE(bytes);
            sent[threads - 1].push_back(*std::move(bytes));
          }
        });
      EXPECT_EQ(sent[0], sent[1]);
    }
}

}  // namespace
}  // namespace mr
