// Scenes whose still and moving surfaces are apart (still.layers): what a client has of them is one
// surface, whole at every capture, and costs little where nothing moves.

#include <gtest/gtest.h>

#include <chrono>
#include <random>
#include <set>
#include <thread>

#include "mr/codec/head.h"
#include "mr/codec/receiver.h"
#include "mr/kit/topology.h"
#include "mr/node/capture.h"
#include "mr/node/sensor_node.h"
#include "mr/node/sources.h"
#include "mr/still/background.h"
#include "support/layers.h"

namespace mr {
namespace {

using node::StillWork;
using test::Captures;
using test::Difference;
using test::doubled_share;
using test::Reference;
using test::rig_scene;
using test::share_without;
using test::small_rig;
using test::with_layers;

constexpr int kBothShown = 2;  // captures at the end of the hand-over in which much is drawn twice

/// A rig with a walking person; with noise, in the Kinects' binned mode, as depth edges, whose
/// pixels are never learnt, are a smaller share of larger pictures.
RigConfig walked_through(bool noise) {
  RigConfig rig = small_rig(300);
  rig.people = 1;
  if (!noise) return rig;
  rig.depth_width = 320, rig.depth_height = 288, rig.color_width = 320, rig.color_height = 180;
  return test::noisy(rig);
}

void expect_whole(const std::vector<int>& moments, bool noise) {
  const Scene scene = rig_scene(walked_through(noise));
  Captures here(with_layers(scene));
  Reference reference(scene);
  for (const int moment : moments) {
    here.run_to(moment);
    const Difference d = reference.compare(here);
    SCOPED_TRACE(testing::Message() << "capture " << moment << ": " << d);
    EXPECT_LT(d.missing, 0.015);
    EXPECT_LT(d.ghost, d.usual_ghost + 0.002);
    EXPECT_LT(d.doubled, d.usual_doubled + (moment / kBothShown == 10 ? 0.15 : 0.025));
  }
  EXPECT_TRUE(here.told.empty());
}

TEST(Layers, NothingIsMissingOrDoubledWhereSomebodyWalks) {
  expect_whole({12, 20, 22, 27, 28, 30, 38, 60, 100}, false);
}

TEST(Layers, NothingIsMissingOrDoubledInNoise) { expect_whole({12, 20, 22, 28, 38}, true); }

TEST(Layers, AStillRoomCostsNothing) {
  Captures here(with_layers(rig_scene(small_rig(200))));
  here.run_to(100);
  const auto keys = here.keys(Layer::still);
  EXPECT_GT(keys.size(), 20u);
  std::uint64_t bytes = 0;
  while (here.number() < 160) {
    here.next();
    EXPECT_EQ(here.keys(Layer::still) == keys, true) << here.number();
    EXPECT_TRUE(here.keys(Layer::moving).empty()) << here.number();
    EXPECT_EQ(here.texture_bytes, 0u) << here.number();
    EXPECT_TRUE(here.packet().chunks.empty()) << here.number();
    bytes += here.mesh_bytes;
  }
  EXPECT_LT(bytes / 60, 400u);  // the whole head now and then
}

TEST(Layers, SameBytesOnAnyNumberOfThreads) {
  RigConfig rig = small_rig(40, {test::box_gone(17), test::light_off(20, 5)});
  rig.people = 1;
  const Scene scene = with_layers(rig_scene(test::noisy(rig)));
  std::vector<std::vector<std::byte>> first;
  for (const int threads : {1, 2, 8}) {
    Captures here(scene, threads);
    std::vector<std::vector<std::byte>> packets;
    while (here.number() < 26) here.next(), packets.push_back(here.bytes());
    if (first.empty()) first = packets;
    for (std::size_t i = 0; i < first.size(); ++i)
      EXPECT_EQ(packets[i] == first[i], true) << "capture " << i << ", " << threads << " threads";
  }
}

TEST(Layers, TreesAndRegionsGiveTheSurfaceOfOneMerger) {
  RigConfig rig = small_rig(100);
  rig.sensors = 4;
  const Scene one = with_layers(rig_scene(rig));
  Scene two = one, regions = one;
  two.mergers = {{"west", {"cam-0", "cam-1"}, 50},
                 {"east", {"cam-2", "cam-3"}, 50},
                 {"root", {"west", "east"}, 50}};
  regions.mergers = {
      {"west", rig.sensor_ids(), 50, 0, Box3d{{-3.84, -3.84, -1.28}, {0, 3.84, 3.84}}},
      {"east", rig.sensor_ids(), 50, 0, Box3d{{0, -3.84, -1.28}, {3.84, 3.84, 3.84}}},
      {"root", {"west", "east"}, 50}};
  Captures flat(one);
  flat.run_to(30);
  const Mesh a = flat.surface();
  EXPECT_GT(surface_area_m2(flat.surface_of(Layer::still)), 0.98 * surface_area_m2(a));
  for (const Scene& scene : {two, regions}) {
    Captures layered(scene);
    while (layered.number() < 30) {
      layered.next();
      EXPECT_LT(share_without(a, layered.surface(), 2.5 * one.voxel_m), 0.02) << layered.number();
    }
    const Mesh b = layered.surface();
    EXPECT_NEAR(surface_area_m2(b) / surface_area_m2(a), 1, 0.03);
    EXPECT_LT(share_without(a, b, 0.5 * one.voxel_m), 0.02);
    EXPECT_LT(share_without(b, a, 0.5 * one.voxel_m), 0.02);
    EXPECT_LT(doubled_share(kit::weld(b), 2.5 * one.voxel_m),
              doubled_share(kit::weld(a), 2.5 * one.voxel_m) + 0.01);
    EXPECT_EQ(layered.scene().views.size(), flat.scene().views.size());
    EXPECT_TRUE(layered.told.empty());
  }
}

using Chunks = std::map<Vec3i, Mesh>;

/// Open edges of surface that crosses a face of the chunk grid, shifted by so much, along that face
/// and with surface beyond.
int open_along_faces(const Chunks& chunks, const Scene& scene, double shift_m = 0) {
  Mesh all;
  for (const auto& [cube, mesh] : chunks) append(all, mesh);
  all = kit::weld(all);
  const Mesh* meshes[] = {&all};
  const kit::RayScene rays(meshes);
  const std::vector<std::uint8_t> uses = kit::edge_table(all).uses;
  const auto voxel_m = static_cast<float>(scene.voxel_m);
  const auto is_near = [&](Vec3f p, int axis) {
    return std::abs(std::remainder(double(p[axis]) - shift_m, scene.fusion.chunk_m)) < voxel_m;
  };
  int count = 0;
  for (std::uint32_t h = 0; h < uses.size(); ++h) {
    const Vec3f a = all.positions[kit::edge_from(all, h)], b = all.positions[kit::edge_to(all, h)];
    if (uses[h] != 1) continue;
    const Vec3f normal = normalized(all.area_normal(h / 3)), out = normalized(cross(b - a, normal));
    bool along = false;  // and across it: the floor lies in a face, and all its holes near one
    for (int axis = 0; axis < 3; ++axis)
      along |= is_near(a, axis) && is_near(b, axis) && std::abs(normal[axis]) < 0.7f;
    if (!along) continue;
    count += rays.nearest((a + b) * 0.5f + out * (voxel_m / 2), voxel_m / 4).has_value();
  }
  return count;
}

/// A sensor's still surface while things happen.
TEST(Layers, ChunksMadeAtDifferentTimesFit) {
  RigConfig rig = test::noisy(small_rig(200, {test::box_gone(70), test::chair_moved(80)}));
  rig.depth_width = 320, rig.depth_height = 288;
  const Scene scene = *node::prepare_scene(with_layers(rig_scene(rig)));
  const SensorConfig& sensor = scene.sensors[0];
  const SensorId wanted[] = {SensorId{0}};
  const auto sources = node::open_sources(scene, wanted);
  const sensor::Registration registration(sensor, SensorId{0});
  const Camera& camera = registration.depth_camera();
  still::Background background(camera, sensor.T_world_depth[0],
                               {.precision = sensor.precision,
                                .fps = scene.fps,
                                .after_s = scene.still.after_s,
                                .chunk_m = scene.fusion.chunk_m});
  node::StillSurface surface(scene);
  const double error_m = node::sensor_plan(scene, SensorId{0}).still_error_m;
  Chunks chunks;
  std::map<Vec3i, int> made_at;
  for (int i = 0; i < 115; ++i) {
    Frame frame = registration.undistort(**sources[0]->next());
    if (!background.update(frame.depth).still_changed) continue;
    frame.depth = background.still();
    const ImageDepth depth = node::prepare_depth(scene, camera, frame);
    const auto changed =
        surface.update(depth, camera, frame.T_world_depth, sensor.precision, error_m);
    ASSERT_TRUE(changed);
    for (const node::StillChunk& chunk : *changed) {
      made_at[chunk.cube] = i, chunks[chunk.cube] = chunk.piece.mesh;
      if (chunk.piece.mesh.empty()) chunks.erase(chunk.cube);
    }
    // It is what would be made of this picture at once.
    node::StillSurface fresh(scene);
    const auto all = fresh.update(depth, camera, frame.T_world_depth, sensor.precision, error_m);
    ASSERT_TRUE(all);
    int other = 0;
    Chunks at_once;
    for (const node::StillChunk& chunk : *all)
      if (!chunk.piece.mesh.empty()) at_once[chunk.cube] = chunk.piece.mesh;
    EXPECT_EQ(at_once.size(), chunks.size());
    for (const auto& [cube, mesh] : at_once) other += mesh != chunks[cube];
    EXPECT_EQ(other, 0) << "of " << at_once.size() << " chunks, capture " << i;
    // Small holes may lie anywhere: 6 to 16 edges at faces, 7 to 12 elsewhere.
    EXPECT_LE(open_along_faces(chunks, scene), open_along_faces(chunks, scene, 0.4) + 12) << i;
  }
  std::set<int> times;
  for (const auto& [cube, at] : made_at) times.insert(at);
  EXPECT_GT(times.size(), 2u);
}

/// The state of a receiver of one sensor: the still chunks received so far and the moving surface.
/// It acknowledges the still surface, or never does.
struct OneSensor {
  node::SensorNode node;
  bool says_so = true;
  Chunks still = {};
  std::uint64_t sequence = 0;
  double moving_m2 = 0;

  Mesh surface(Frame frame) {
    auto made = node.reconstruct(std::move(frame));
    EXPECT_TRUE(made);
    for (const node::StillChunk& chunk : made->still.chunks) {
      still[chunk.cube] = chunk.piece.mesh;
      if (chunk.piece.mesh.empty()) still.erase(chunk.cube);
    }
    EXPECT_TRUE(node.code(*made));
    if (says_so) node.answer({.key_frames = {}, .chunks = {}, .taken = {}, .shown = sequence});
    ++sequence;
    moving_m2 = surface_area_m2(made->mesh);
    Mesh out = std::move(made->mesh);
    for (const auto& [cube, mesh] : still) append(out, mesh);
    return out;
  }
};

/// Live, still chunks are made beside the live path: they are the same, and until they are there
/// what moves shows their place.
TEST(Layers, StillChunksMadeBesideAreTheSameAndLeaveNoHole) {
  const Scene scene =
      *node::prepare_scene(with_layers(rig_scene(small_rig(400, {test::chair_moved(80)}))));
  const SensorId wanted[] = {SensorId{0}};
  const auto sources = node::open_sources(scene, wanted);
  OneSensor at_once{node::SensorNode(scene, SensorId{0}, {}, StillWork::at_once)},
      beside{node::SensorNode(scene, SensorId{0}, {}, StillWork::beside)};
  constexpr int kChangesEnd = 171;
  bool same = false;
  for (int i = 0; i < 400 && !(same && i > kChangesEnd); ++i) {
    const Frame frame = **sources[0]->next();
    const Mesh expected = at_once.surface(frame), actual = beside.surface(frame);
    // Some jobs take several captures; the last one has time to finish.
    if (i >= 80) std::this_thread::sleep_for(std::chrono::milliseconds(i < 164 ? i % 7 : 60));
    // Moving surface too small to be distinguished from noise arrives with its chunk.
    if (i % 4 == 0) {
      EXPECT_LT(share_without(expected, actual, scene.voxel_m), 0.015) << "capture " << i;
    }
    same = at_once.still == beside.still;
  }
  EXPECT_TRUE(same);
}

/// Until a live sensor hears that its still surface is shown, all of it goes on as moving; but not
/// for ever.
TEST(Layers, ASensorSendsAsMovingWhatNobodySaysIsShown) {
  const Scene scene = *node::prepare_scene(with_layers(rig_scene(small_rig(400))));
  const SensorId wanted[] = {SensorId{0}};
  const auto sources = node::open_sources(scene, wanted);
  OneSensor heard{node::SensorNode(scene, SensorId{0}, {}, StillWork::beside)},
      unheard{node::SensorNode(scene, SensorId{0}, {}, StillWork::beside), false};
  double room_m2 = 0;
  auto run_to = [&, next = 0](int end, std::chrono::milliseconds pause = {}) mutable {
    for (; next < end; ++next) {
      const Frame frame = **sources[0]->next();
      room_m2 = surface_area_m2(heard.surface(frame));
      unheard.surface(frame);
      std::this_thread::sleep_for(pause);
    }
  };
  run_to(100);
  EXPECT_LT(heard.moving_m2, 0.02 * room_m2);
  EXPECT_GT(unheard.moving_m2, 0.5 * room_m2);
  unheard.says_so = true;
  run_to(112, std::chrono::milliseconds(100));  // what is made beside has time to finish
  EXPECT_LT(unheard.moving_m2, 0.02 * room_m2);
}

/// A scene's nodes; what the root sends, and what it answers.
class Nodes {
 public:
  explicit Nodes(const Scene& scene, StillWork work = StillWork::at_once)
      : scene_(*node::prepare_scene(scene)), root_(scene_, scene_.mergers[0], true, {}, work) {
    const std::vector<SensorId> all = all_sensors(scene_.sensors);
    for (const SensorId id : all)
      sensors_.push_back(std::make_unique<node::SensorNode>(scene_, id, node::NodeClock{}, work));
    sources_ = node::open_sources(scene_, all);
  }

  std::vector<std::byte> next() {
    TimePoint now{};
    for (std::size_t i = 0; i < sensors_.size(); ++i) {
      Frame frame = **sources_[i]->next();
      now = frame.captured_at();
      const auto surface = sensors_[i]->reconstruct(std::move(frame));
      EXPECT_TRUE(root_.inputs().receive(i, *sensors_[i]->code(*surface), now));
    }
    const auto captures = root_.inputs().next_set(now + std::chrono::milliseconds(60));
    auto bytes = *root_.merge(**captures);
    for (const auto& [input, sequence] : root_.take_shown()) {
      sensors_[input]->answer({.key_frames = {}, .chunks = {}, .taken = {}, .shown = sequence});
      told_.insert(input);
    }
    return bytes;
  }
  /// Number of sensors informed that their still surface is shown.
  std::size_t told() const { return told_.size(); }
  Mesh surface() const { return *root_.surface(); }
  std::vector<std::byte> answer(const codec::Control& request) { return root_.answer(request); }
  const Scene& scene() const { return scene_; }

 private:
  Scene scene_;
  std::vector<std::unique_ptr<FrameSource>> sources_;
  std::vector<std::unique_ptr<node::SensorNode>> sensors_;
  node::MergeNode root_;
  std::set<std::size_t> told_;
};

/// Live, a merger's still work goes on beside its ticks, too: nothing is missing meanwhile, and in
/// the end it shows the same.
TEST(Layers, AStillSurfaceMergedBesideTheTicksLeavesNoHole) {
  RigConfig rig = small_rig(400, {test::chair_moved(70)});
  const Scene scene = with_layers(rig_scene(rig));
  Nodes at_once(scene), beside(scene, StillWork::beside);
  double missing = 1;
  for (int i = 0; i < 190; ++i) {
    at_once.next(), beside.next();
    if (i >= 70) std::this_thread::sleep_for(std::chrono::milliseconds(i < 170 ? i % 7 : 60));
    if (i % 4 != 0 && i != 189) continue;
    const Mesh expected = at_once.surface(), actual = beside.surface();
    missing = share_without(expected, actual, scene.voxel_m);
    EXPECT_LT(missing, 0.02) << "capture " << i;
    EXPECT_LT(share_without(actual, expected, scene.voxel_m), i < 189 ? 0.06 : 0.01) << i;
  }
}

/// Who takes a node's packets, on a line that may lose some, and asks for what is lacking.
class Taker {
 public:
  Taker(Nodes& nodes, double loss) : nodes_(nodes), loss_(loss), receiver_(nodes.scene().lattice) {}

  void take(const std::vector<std::byte>& bytes) {
    if (std::uniform_real_distribution<>(0, 1)(random_) < loss_) return;
    if (const auto packet = heads_.read(bytes)) receiver_.accept(*packet);
    const codec::Control lacking{
        receiver_.streams_waiting(), receiver_.missing(), {}, heads_.lacks_base()};
    if (lacking.empty()) return;
    const auto answer = nodes_.answer(lacking);
    if (answer.empty()) return;
    const auto chunks = codec::decode_chunks(answer);
    ASSERT_TRUE(chunks);
    for (const EncodedChunk& chunk : *chunks) EXPECT_TRUE(receiver_.provide(chunk));
  }
  void lose(double share) { loss_ = share; }
  std::optional<DecodedScene> scene() const { return receiver_.scene(); }

 private:
  Nodes& nodes_;
  double loss_;
  std::mt19937 random_{3};
  codec::HeadReader heads_;
  codec::Receiver receiver_;
};

/// What has no plate yet is withheld, and sensors go on showing it as moving.
TEST(Layers, ASensorHearsThatItsSurfaceIsShownWhenAllOfItIs) {
  Nodes nodes(with_layers(rig_scene(small_rig(100))));
  Taker taker(nodes, 0);
  int captures = 0;
  for (; nodes.told() == 0 && captures < 100; ++captures) taker.take(nodes.next());
  EXPECT_GT(captures, 8);
  EXPECT_EQ(nodes.told(), nodes.scene().sensors.size());
  const DecodedScene shown = taker.scene().value();
  Mesh still;
  for (const auto& chunk : shown.chunks)
    if (chunk->key.id.layer == Layer::still) append(still, chunk->mesh);
  EXPECT_LT(share_without(nodes.surface(), still, 2.5 * nodes.scene().voxel_m), 0.02);
}

TEST(Layers, WhoJoinsLateOrLosesPacketsHasTheSameScene) {
  RigConfig rig = small_rig(200);
  rig.people = 1;
  Nodes nodes(with_layers(rig_scene(rig)));
  Taker present(nodes, 0), lossy(nodes, 0.2), late(nodes, 0);
  for (int i = 0; i < 96; ++i) {
    const auto bytes = nodes.next();
    if (i == 90) lossy.lose(0);
    present.take(bytes), lossy.take(bytes);
    if (i >= 85) late.take(bytes);
  }
  const auto wanted = present.scene();
  ASSERT_TRUE(wanted);
  ASSERT_EQ(wanted->textures.size(), 2u);  // what moves, and plates
  for (const Taker* taker : {&lossy, &late}) {
    const auto scene = taker->scene();
    ASSERT_TRUE(scene);
    EXPECT_EQ(scene->captured_at, wanted->captured_at);
    EXPECT_EQ(scene->views, wanted->views);
    ASSERT_EQ(scene->chunks.size(), wanted->chunks.size());
    for (std::size_t i = 0; i < wanted->chunks.size(); ++i) {
      EXPECT_EQ(scene->chunks[i]->key, wanted->chunks[i]->key);
      EXPECT_EQ(scene->chunks[i]->mesh, wanted->chunks[i]->mesh);
    }
    for (const auto& [stream, picture] : wanted->textures)
      EXPECT_EQ(*scene->textures.at(stream) == *picture, true) << "stream " << number_of(stream);
  }
}

}  // namespace
}  // namespace mr
