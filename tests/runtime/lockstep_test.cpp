#include "mr/runtime/lockstep_scene.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "mr/codec/head.h"
#include "mr/codec/mesh_codec.h"
#include "mr/codec/packet_codec.h"
#include "mr/core/parallel.h"
#include "mr/core/trace.h"
#include "mr/kit/image_io.h"
#include "mr/kit/raycast.h"
#include "mr/kit/topology.h"
#include "mr/sensor/rgbd_images.h"
#include "mr/synth/room.h"

namespace mr {
namespace {

/// Small pictures and coarse voxels: seconds, not minutes.
Scene small_room(int sensors = 4) {
  Scene scene;
  scene.id = "small-room";
  scene.voxel_m = 0.03, scene.fusion.truncation_m = 0.12, scene.fusion.chunk_m = 1.28;
  scene.simplify.ratio = 0.2;
  scene.rig = RigConfig{};
  scene.rig->sensors = sensors;
  scene.rig->depth_width = 320, scene.rig->depth_height = 288;
  scene.rig->color_width = 320, scene.rig->color_height = 180;
  MergerConfig root{.id = "root", .inputs = {}, .deadline_ms = 50};
  for (int i = 0; i < sensors; ++i) root.inputs.push_back("cam-" + std::to_string(i));
  scene.mergers = {root};
  return scene;
}

std::unique_ptr<runtime::LockstepScene> run(const Scene& scene, int frames,
                                            runtime::RunReport* report = nullptr, int threads = 2) {
  std::unique_ptr<runtime::LockstepScene> out;
  Arena arena(threads);
  arena.run([&] {
    auto pipeline = runtime::LockstepScene::open(scene);
    ASSERT_TRUE(pipeline) << pipeline.error().message;
    const auto result = (*pipeline)->run(frames);
    ASSERT_TRUE(result) << result.error().message;
    if (report) *report = *result;
    out = *std::move(pipeline);
  });
  return out;
}

Mesh whole(const DecodedScene& scene) {
  Mesh mesh;
  for (const auto& chunk : scene.chunks) append(mesh, chunk->mesh);
  return kit::weld(mesh);
}

/// Root mean square distance from a's triangles to b, along b-facing rays, ignoring what b lacks.
double rms_distance(const Mesh& a, const Mesh& b, double reach) {
  const Mesh* meshes[] = {&b};
  const kit::RayScene rays(meshes);
  double sum = 0, area = 0;
  for (std::size_t t = 0; t < a.triangles.size(); ++t) {
    const Vec3f n = normalized(a.area_normal(t)), c = a.centroid(t);
    const auto out = rays.first_hit(c, n, 0, static_cast<float>(reach)),
               in = rays.first_hit(c, -n, 0, static_cast<float>(reach));
    if (!out && !in) continue;
    const double d = std::min(out ? out->distance : 1e9f, in ? in->distance : 1e9f);
    const double w = length(a.area_normal(t));
    sum += w * d * d, area += w;
  }
  return area > 0 ? std::sqrt(sum / area) : 1e9;
}

TEST(LockstepScene, ToldCostsOfCapturesAddUpToTheReport) {
  Arena(2).run([] {
    auto pipeline = runtime::LockstepScene::open(small_room(2));
    ASSERT_TRUE(pipeline) << pipeline.error().message;
    double mesh_bytes = 0, texture_bytes = 0, cpu_ms = 0;
    std::vector<bool> key_frames;
    runtime::RunListener listener;
    listener.captured = [&](int, const runtime::CaptureCost& cost) {
      EXPECT_TRUE(cost.shown);
      EXPECT_GT(cost.head_bytes, 0u);
      EXPECT_GT(cost.mesh_bytes, cost.head_bytes);
      EXPECT_GT(cost.critical_path_ms, 0);
      EXPECT_GT(cost.sensors_cpu_ms, 0);
      EXPECT_GT(cost.mergers_cpu_ms, 0);
      mesh_bytes += static_cast<double>(cost.mesh_bytes + cost.head_bytes);
      texture_bytes += static_cast<double>(cost.texture_bytes);
      cpu_ms += cost.sensors_cpu_ms + cost.mergers_cpu_ms;
      key_frames.push_back(cost.key_frame);
    };
    const double before_ms = process_cpu_ms();
    const auto report = (*pipeline)->run(3, listener);
    ASSERT_TRUE(report) << report.error().message;
    EXPECT_NEAR(mesh_bytes / 3, report->mesh_bytes_per_frame, 1);
    EXPECT_NEAR(texture_bytes / 3, report->texture_bytes_per_frame, 1);
    EXPECT_LT(cpu_ms, process_cpu_ms() - before_ms) << "the client and the rig work, too";
    EXPECT_EQ(key_frames, (std::vector<bool>{true, false, false}));
  });
}

TEST(LockstepScene, RoomComesThroughWholeAndTextured) {
  runtime::RunReport report;
  const auto pipeline = run(small_room(), 2, &report);
  ASSERT_TRUE(pipeline);
  const DecodedScene& scene = *pipeline->decoded();
  EXPECT_EQ(scene.views.size(), 4u);
  const Mesh mesh = whole(scene);
  const Mesh truth = synth::make_room(*small_room().rig).mesh;
  EXPECT_LT(rms_distance(mesh, truth, 0.2), 0.02);
  EXPECT_EQ(kit::count_nonmanifold_edges(mesh), 0u);

  double textured = 0;
  const auto views = triangle_views(mesh);
  for (std::size_t t = 0; t < views.size(); ++t)
    if (views[t] != kNoView) textured += 0.5 * length(mesh.area_normal(t));
  EXPECT_GT(textured, 0.6 * surface_area_m2(mesh));

  EXPECT_EQ(report.frames, 2);
  EXPECT_TRUE(report.drops.empty());
  EXPECT_EQ(report.triangles, mesh.triangles.size());
  for (const char* stage : {"register", "fuse", "simplify", "encode_mesh", "encode_video"})
    EXPECT_TRUE(report.sensor_stages_ms.contains(stage)) << stage;
  for (const char* stage : {"decode", "overlap", "islands", "zipper", "simplify", "atlas",
                            "encode_mesh", "encode_atlas"})
    EXPECT_TRUE(report.merge_stages_ms.contains(stage)) << stage;
  const auto json = nlohmann::json::parse(to_json(report));
  for (const char* key :
       {"scene", "frames", "fps", "sensors", "threads", "peak_rss_mb", "triangles", "vertices",
        "mesh_bytes_per_frame", "refresh_bytes", "texture_bytes_per_frame", "chunks", "drops",
        "nodes", "throughput_fps", "latency_ms"})
    EXPECT_TRUE(json.contains(key)) << key;
}

TEST(LockstepScene, ChunkBordersAreClosedForTheClient) {
  // Borders between chunks are no boundary of the welded mesh: along a cube's face no edge is open
  // unless the surface ends there. Removing the cube's neighbours must open edges, so the test
  // could fail.
  const auto pipeline = run(small_room(2), 1);
  ASSERT_TRUE(pipeline);
  const DecodedScene& scene = *pipeline->decoded();
  std::size_t open_apart = 0;
  for (const auto& chunk : scene.chunks) open_apart += kit::count_boundary_edges(chunk->mesh);
  EXPECT_GT(scene.chunks.size(), 5u);
  EXPECT_LT(kit::count_boundary_edges(whole(scene)) + 500, open_apart);
}

TEST(LockstepScene, SameBytesOnAnyNumberOfThreads) {
  std::vector<std::vector<std::byte>> packets;
  for (const int threads : {1, 2, 8}) {
    const auto pipeline = run(small_room(2), 1, nullptr, threads);
    ASSERT_TRUE(pipeline);
    packets.push_back(pipeline->last_packet());
  }
  EXPECT_EQ(packets[0], packets[1]);
  EXPECT_EQ(packets[0], packets[2]);
}

TEST(LockstepScene, TwoLayersGiveTheSurfaceOfOne) {
  Scene one = small_room();
  one.rig->noise = false;
  Scene two = one;
  two.mergers = {{"west", {"cam-0", "cam-1"}, 50},
                 {"east", {"cam-2", "cam-3"}, 50},
                 {"root", {"west", "east"}, 50}};
  const auto flat = run(one, 1), layered = run(two, 1);
  ASSERT_TRUE(flat && layered);
  const Mesh a = whole(*flat->decoded()), b = whole(*layered->decoded());
  // Tolerance: half a voxel RMS both ways, and the area within 3 %.
  EXPECT_LT(rms_distance(a, b, 0.2), 0.5 * one.voxel_m);
  EXPECT_LT(rms_distance(b, a, 0.2), 0.5 * one.voxel_m);
  EXPECT_NEAR(surface_area_m2(b) / surface_area_m2(a), 1, 0.03);
  EXPECT_EQ(layered->decoded()->views.size(), 4u);
}

/// The share of a surface that is textured by a view, by area.
double textured_share(const Mesh& mesh, ViewId view) {
  double sum = 0;
  const auto views = triangle_views(mesh);
  for (std::size_t t = 0; t < views.size(); ++t)
    if (views[t] == view) sum += 0.5 * length(mesh.area_normal(t));
  return sum / surface_area_m2(mesh);
}

/// The share of b's area, away from other surface, that `a` has within 5 cm: how much is covered.
double covered_share(const Mesh& a, const Mesh& b) {
  const Mesh* meshes[] = {&a};
  const kit::RayScene rays(meshes);
  double sum = 0;
  for (std::size_t t = 0; t < b.triangles.size(); ++t)
    if (rays.nearest(b.centroid(t), 0.05f)) sum += 0.5 * length(b.area_normal(t));
  return sum / surface_area_m2(b);
}

/// A small room seen by a Kinect and by a LiDAR with a panorama camera.
Scene room_with_lidar() {
  Scene scene = small_room(1);
  scene.voxel_m = 0.04, scene.fusion.truncation_m = 0.16;
  scene.rig->lidars = 1;
  scene.sensors = synth::rig_sensors(*scene.rig);
  scene.mergers[0].inputs.push_back("lidar-0");
  scene.sensors[1].depth_camera.width = 1024;
  scene.sensors[1].color_camera->width = 768, scene.sensors[1].color_camera->height = 384;
  return scene;
}

TEST(LockstepScene, LidarAndKinectMakeOneSurface) {
  const Scene scene = room_with_lidar();
  const auto both = run(scene, 1);
  ASSERT_TRUE(both);
  const Mesh mesh = whole(*both->decoded());
  const Mesh truth = synth::make_room(*scene.rig).mesh;
  EXPECT_LT(rms_distance(mesh, truth, 0.2), 0.02);
  EXPECT_EQ(kit::count_nonmanifold_edges(mesh), 0u);
  EXPECT_EQ(both->decoded()->sources.size(), 2u);
  // The LiDAR's walls and floor are textured by its panorama, what the Kinect sees by that.
  EXPECT_GT(textured_share(mesh, ViewId{0}), 0.05);
  EXPECT_GT(textured_share(mesh, ViewId{1}), 0.5);
  // Each has surface that the other lacks, and together they do not double it.
  const auto kinect = run(small_room(1), 1);
  ASSERT_TRUE(kinect);
  const Mesh of_kinect = whole(*kinect->decoded());
  EXPECT_GT(covered_share(mesh, of_kinect), 0.97);
  EXPECT_LT(covered_share(of_kinect, mesh), 0.6);
}

TEST(LockstepScene, PatchesComeThroughWithoutGaps) {
  Scene scene = small_room(1);
  scene.rig->noise = false;
  const auto chunks = run(scene, 1);
  scene.fusion.decomposition = Decomposition::patches;
  scene.fusion.patches_x = 3, scene.fusion.patches_y = 2;
  const auto patches = run(scene, 1);
  ASSERT_TRUE(patches && chunks);
  const Mesh a = whole(*chunks->decoded()), b = whole(*patches->decoded());
  EXPECT_NEAR(surface_area_m2(b) / surface_area_m2(a), 1, 0.02);
  // Unzipped, the borders of the patches would add about a third.
  EXPECT_LT(static_cast<double>(kit::count_boundary_edges(b)),
            1.12 * static_cast<double>(kit::count_boundary_edges(a)));
}

/// Two sensors that look at a wall 1.5 m away, as files in a folder of their own.
class LockstepSceneFromFiles : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ =
        std::filesystem::temp_directory_path() / ("mr_pipeline_" + std::to_string(::getpid()));
    std::filesystem::create_directories(folder_);
    for (int i = 0; i < 3; ++i) write_frame(i);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  void write_frame(int i) {
    write_depth(depth(i), 1500);
    ImageRgb color(160, 120, 90);
    for (int x = 0; x < 80; ++x)
      for (int y = 0; y < 60; ++y) *color.at(x, y) = 230;
    ASSERT_TRUE(kit::write_png(folder_ / ("color" + std::to_string(i) + ".png"), color));
  }
  static void write_depth(const std::filesystem::path& file, int value) {
    std::ofstream out(file, std::ios::binary);
    out << "P5\n160 120\n65535\n";
    for (int i = 0; i < 160 * 120; ++i)
      out << static_cast<char>(value >> 8) << static_cast<char>(value & 255);
  }
  std::filesystem::path depth(int i) const {
    return folder_ / ("depth" + std::to_string(i) + ".pgm");
  }

  Scene scene() const {
    Scene scene;
    scene.id = "files";
    scene.voxel_m = 0.02, scene.fusion.truncation_m = 0.08;
    for (int s = 0; s < 2; ++s) {
      SensorConfig sensor;
      sensor.id = "s" + std::to_string(s);
      sensor::RgbdImagesSource source;
      for (int i = 0; i < 3; ++i) {
        source.depth.push_back(depth(i));
        source.color.push_back(folder_ / ("color" + std::to_string(i) + ".png"));
      }
      sensor.source = source;
      Camera c;
      c.width = 160, c.height = 120, c.fx = c.fy = 140, c.cx = 80, c.cy = 60;
      sensor.depth_camera = c;
      sensor.color_camera = c;
      sensor.T_world_depth = {Pose{{}, {0.4 * s, 0.013, 0.007}}};
      scene.sensors.push_back(sensor);
    }
    scene.mergers = {{"root", {"s0", "s1"}, 50}};
    return scene;
  }

  std::filesystem::path folder_;
};

TEST_F(LockstepSceneFromFiles, WallSeenTwiceIsOneSurface) {
  runtime::RunReport report;
  const auto pipeline = run(scene(), 3, &report);
  ASSERT_TRUE(pipeline);
  const Mesh mesh = whole(*pipeline->decoded());
  const double one = 1.5 * 159 / 140 * 1.5 * 119 / 140;
  EXPECT_NEAR(surface_area_m2(mesh), one + 0.4 * 1.5 * 119 / 140, 0.08);
  for (const Vec3f p : mesh.positions) EXPECT_NEAR(p.z, 1.507f, 0.004f);
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) ASSERT_LT(mesh.area_normal(t).z, 0);
  // The wall stands still: only the first frame costs mesh.
  EXPECT_EQ(report.frames, 3);
  EXPECT_EQ(report.chunks_kept, 2 * report.chunks_new);
}

/// What one sensor node sends for a wall 1.5 m away; for nothing in front of it with 0.
std::vector<std::byte> wall_packet(const Scene& s, node::SensorNode& sensor, float depth_m = 1.5f) {
  Frame frame;
  frame.depth = ImageDepth(160, 120, depth_m);
  frame.color = ImageRgb(160, 120, 128);
  frame.T_world_depth = s.sensors[0].T_world_depth[0];
  const auto surface = sensor.reconstruct(frame);
  EXPECT_TRUE(surface);
  auto bytes = sensor.code(*surface);
  EXPECT_TRUE(bytes);
  return *bytes;
}

/// Passes requests of a merger to its only input, and the answers back; returns how many chunks
/// were asked for.
std::size_t serve(node::MergeNode& merger, node::SensorNode& sensor, TimePoint now) {
  std::size_t asked = 0;
  for (const auto& [input, request] : merger.inputs().requests(now)) {
    asked += request.chunks.size();
    const auto answer = sensor.answer(request);
    if (!answer.empty()) merger.inputs().take_answer(input, answer, now);
  }
  return asked;
}

/// Merges what is ready; whether a packet came of it.
bool merges(node::MergeNode& merger, TimePoint now) {
  const auto captures = merger.inputs().next_set(now);
  if (!captures || !*captures) return false;
  const auto bytes = merger.merge(**captures);
  return bytes && codec::decode_packet(*bytes);
}

TEST_F(LockstepSceneFromFiles, LossIsMendedByAKeyFrame) {
  const Scene s = scene();
  node::SensorNode sensor(s, SensorId{0});
  node::MergeNode merger(s, s.mergers[0], true);
  TimePoint now{};
  codec::HeadReader heads;
  const auto shown = [&] {  // the capture that the merger shows after one more packet
    now += std::chrono::milliseconds(40);
    auto packet = heads.read(wall_packet(s, sensor));
    packet->captured_at = now;
    EXPECT_TRUE(merger.inputs().receive(0, codec::encode_packet(*packet), now));
    serve(merger, sensor, now);
    const auto captures = merger.inputs().next_set(now + std::chrono::milliseconds(60));
    return captures && *captures ? (*captures)->scenes.at(0).captured_at : TimePoint{};
  };
  EXPECT_EQ(shown(), now);
  wall_packet(s, sensor);           // lost on the way
  EXPECT_EQ(shown(), TimePoint{});  // its pictures refer to the lost one: nothing new to merge
  EXPECT_EQ(shown(), now);
}

TEST_F(LockstepSceneFromFiles, WhoLeavesTheVolumeLeavesTheScene) {
  const Scene s = scene();
  node::SensorNode sensor(s, SensorId{0});
  node::MergeNode merger(s, s.mergers[0], true);
  TimePoint now{};
  for (const float depth_m : {1.5f, 0.0f, 1.5f}) {
    now += std::chrono::milliseconds(40);
    auto packet = *codec::decode_packet(wall_packet(s, sensor, depth_m));
    packet.captured_at = now;
    EXPECT_EQ(packet.manifest.empty(), depth_m == 0);
    ASSERT_TRUE(merger.inputs().receive(0, codec::encode_packet(packet), now));
    const auto captures = merger.inputs().next_set(now + std::chrono::milliseconds(60));
    ASSERT_TRUE(captures && *captures);
    const auto merged = merger.merge(**captures);
    ASSERT_TRUE(merged);
    EXPECT_EQ(codec::decode_packet(*merged)->manifest.empty(), depth_m == 0);
  }
}

TEST_F(LockstepSceneFromFiles, PacketsOfOtherSendersAreRefused) {
  const Scene s = scene();
  node::SensorNode sensor(s, SensorId{0});
  node::MergeNode merger(s, s.mergers[0], true);
  node::InputSynchronizer& inputs = merger.inputs();
  const std::vector<std::byte> bytes = wall_packet(s, sensor);
  EXPECT_FALSE(inputs.receive(1, bytes, TimePoint{}));  // s0's packet as if from s1
  auto foreign = *codec::decode_packet(bytes);
  foreign.scene = "another";
  EXPECT_FALSE(inputs.receive(0, codec::encode_packet(foreign), TimePoint{}));
  auto impostor = *codec::decode_packet(bytes);
  impostor.node = "s1";  // right name, but another sensor's view
  EXPECT_FALSE(inputs.receive(1, codec::encode_packet(impostor), TimePoint{}));
  EXPECT_TRUE(inputs.receive(0, bytes, TimePoint{}));
  EXPECT_FALSE(inputs.receive(0, bytes, TimePoint{}));  // twice
  EXPECT_EQ(inputs.drops().total(), 4u);
}

TEST_F(LockstepSceneFromFiles, OneBrokenPictureLeavesTheOtherSensorAlone) {
  Scene s = scene();
  std::filesystem::copy_file(depth(1), depth(7));
  std::filesystem::resize_file(depth(7), 5000);
  s.sensors[1].source.get_if<sensor::RgbdImagesSource>()->depth[1] = depth(7);
  runtime::RunReport report;
  ASSERT_TRUE(run(s, 3, &report));
  EXPECT_EQ(report.frames, 3);
  EXPECT_EQ(report.drops, (std::map<std::string, std::uint64_t>{{"s1: corrupt", 1}}));
}

TEST_F(LockstepSceneFromFiles, BlackRimOfUndistortionIsNotSeen) {
  Scene s = scene();
  for (SensorConfig& sensor :
       s.sensors) {  // a white wall through a lens whose undistorted picture has a rim
    ASSERT_TRUE(kit::write_png(folder_ / "white.png", ImageRgb(160, 120, 255)));
    sensor.source.get_if<sensor::RgbdImagesSource>()->color.assign(3, folder_ / "white.png");
    sensor.color_camera->distortion = DistortionModel::brown;
    sensor.color_camera->k = {0.2, 0, 0, 0, 0, 0};
    sensor.color_camera->fx = sensor.color_camera->fy = 100;  // wider than depth: its rim matters
  }
  const auto pipeline = run(s, 1);
  ASSERT_TRUE(pipeline);
  const DecodedScene& scene = *pipeline->decoded();
  int seen = 0;
  for (const auto& chunk : scene.chunks)
    for (const ViewRun& run : chunk->mesh.views)
      for (std::uint32_t t = run.first; run.id != kNoView && t < run.first + run.count; ++t)
        for (int i = 0; i < 3; ++i) {
          const View& view = scene.views[number_of(run.id)];
          const auto p = project(view.camera(), view.T_world_camera.inverse() *
                                                    vec_cast<double>(chunk->mesh.corner(t, i)));
          const ImageRgb& picture = *scene.textures.at(view.stream);
          const Vec2d uv = atlas_uv(view, *p, picture.width, picture.height);
          const auto color = sample_bilinear(picture, view.atlas_rect, uv.x * picture.width - 0.5,
                                             uv.y * picture.height - 0.5);
          EXPECT_GT(color[0], 200) << p->x << " " << p->y;
          ++seen;
        }
  EXPECT_GT(seen, 10);
}

TEST_F(LockstepSceneFromFiles, BrokenPictureIsACountedDropAndNothingElse) {
  std::filesystem::resize_file(depth(1), 5000);
  runtime::RunReport report;
  ASSERT_TRUE(run(scene(), 3, &report));
  EXPECT_EQ(report.frames, 2);  // both sensors share the files
  EXPECT_EQ(report.drops,
            (std::map<std::string, std::uint64_t>{{"s0: corrupt", 1}, {"s1: corrupt", 1}}));
}

TEST_F(LockstepSceneFromFiles, MissingFilesAndPosesCostTheirFramesOnly) {
  Scene s = scene();
  s.sensors[0].source.get_if<sensor::RgbdImagesSource>()->depth[0] = folder_ / "none.pgm";
  s.sensors[1].T_world_depth.assign(3, s.sensors[1].T_world_depth[0]);
  s.sensors[1].lost_poses[1] = {Error::Cause::invalid, "no numbers"};
  runtime::RunReport report;
  ASSERT_TRUE(run(s, 3, &report));
  EXPECT_EQ(report.frames, 3);
  EXPECT_EQ(report.drops,
            (std::map<std::string, std::uint64_t>{{"s0: not_found", 1}, {"s1: invalid", 1}}));
}

// s0 → inner → root ← s1: what a merger, the root or the client lack then is no news.
TEST_F(LockstepSceneFromFiles, WhatFollowsFromALostFrameIsNotTold) {
  Scene s = scene();
  s.mergers = {{"inner", {"s0"}, 50}, {"root", {"inner", "s1"}, 50}};
  auto& depths = s.sensors[0].source.get_if<sensor::RgbdImagesSource>()->depth;
  depths[0] = depths[2] = folder_ / "none.pgm";
  s.sensors[1].source.get_if<sensor::RgbdImagesSource>()->depth[2] = folder_ / "none.pgm";
  auto pipeline = runtime::LockstepScene::open(s);
  ASSERT_TRUE(pipeline);
  std::vector<std::string> said;
  runtime::RunListener listener;
  listener.dropped = listener.warned = [&](const std::string& m) { said.push_back(m); };
  const auto report = (*pipeline)->run(3, listener);
  ASSERT_TRUE(report) << report.error().message;
  EXPECT_EQ(report->frames, 2);
  EXPECT_EQ(report->drops,
            (std::map<std::string, std::uint64_t>{{"s0: not_found", 2}, {"s1: not_found", 1}}));
  ASSERT_EQ(said.size(), 3u) << testing::PrintToString(said);
  EXPECT_NE(said[0].find("none.pgm"), std::string::npos) << said[0];
  EXPECT_NE(said[0].find("(frame 0 of sensor 's0' is lost)"), std::string::npos) << said[0];
}

TEST_F(LockstepSceneFromFiles, AWrongPoseIsAWarningAndNoDrop) {
  Scene s = scene();
  s.sensors.push_back(s.sensors[0]);
  s.sensors[2].id = "s2";
  s.sensors[2].T_world_depth[0].translation.z += 0.06;
  s.mergers[0].inputs.push_back("s2");
  auto pipeline = runtime::LockstepScene::open(s);
  ASSERT_TRUE(pipeline);
  std::vector<std::string> dropped, warned;
  runtime::RunListener listener;
  listener.dropped = [&](const std::string& m) { dropped.push_back(m); };
  listener.warned = [&](const std::string& m) { warned.push_back(m); };
  ASSERT_TRUE((*pipeline)->run(3, listener));
  EXPECT_TRUE(dropped.empty()) << dropped[0];
  ASSERT_EQ(warned.size(), 1u) << testing::PrintToString(warned);
  EXPECT_NE(warned[0].find("s2"), std::string::npos) << warned[0];
}

TEST_F(LockstepSceneFromFiles, SensorWithoutSurfaceLeavesTheOthersAlone) {
  Scene s = scene();
  for (int i = 3; i < 6; ++i) write_depth(depth(i), 0);
  s.sensors[1].source.get_if<sensor::RgbdImagesSource>()->depth = {depth(3), depth(4), depth(5)};
  runtime::RunReport report;
  const auto pipeline = run(s, 3, &report);
  ASSERT_TRUE(pipeline);
  EXPECT_EQ(report.frames, 3);
  EXPECT_EQ(report.drops["s1: empty"], 3u);
  EXPECT_NEAR(surface_area_m2(whole(*pipeline->decoded())), 1.5 * 159 / 140 * 1.5 * 119 / 140,
              0.08);
}

TEST_F(LockstepSceneFromFiles, NothingValidAtAllIsAnError) {
  Scene s = scene();
  for (int i = 0; i < 3; ++i) write_depth(depth(i), 0);
  auto pipeline = runtime::LockstepScene::open(s);
  ASSERT_TRUE(pipeline);
  std::vector<std::string> said;
  const auto report = (*pipeline)->run(3, {{}, [&](const std::string& m) { said.push_back(m); }});
  ASSERT_FALSE(report);
  EXPECT_EQ(report.error().cause, Error::Cause::empty);
  EXPECT_EQ(said.size(), 2u) << testing::PrintToString(said);  // that it lasts is no news
  EXPECT_NE(said[0].find("s0"), std::string::npos);
}

TEST_F(LockstepSceneFromFiles, SensorWithoutColourIsTexturedByTheOther) {
  Scene s = scene();
  s.sensors[1].source.get_if<sensor::RgbdImagesSource>()->color.clear();
  s.sensors[1].color_camera.reset();
  const auto pipeline = run(s, 1);
  ASSERT_TRUE(pipeline);
  EXPECT_EQ(pipeline->decoded()->views.size(), 1u);
  const Mesh mesh = whole(*pipeline->decoded());
  const auto views = triangle_views(mesh);
  EXPECT_GT(std::count(views.begin(), views.end(), ViewId{0}), 0);
  EXPECT_GT(std::count(views.begin(), views.end(), kNoView), 0);
}

TEST_F(LockstepSceneFromFiles, SceneWithoutAnyColourStillHasASurface) {
  Scene s = scene();
  for (SensorConfig& sensor : s.sensors) {
    sensor.source.get_if<sensor::RgbdImagesSource>()->color.clear();
    sensor.color_camera.reset();
  }
  const auto pipeline = run(s, 1);
  ASSERT_TRUE(pipeline);
  EXPECT_TRUE(pipeline->decoded()->views.empty());
  EXPECT_FALSE(whole(*pipeline->decoded()).empty());
}

TEST_F(LockstepSceneFromFiles, MergerSurvivesGarbagePackets) {
  const Scene s = scene();
  node::SensorNode sensor(s, SensorId{0});
  node::MergeNode merger(s, s.mergers[0], true);
  node::InputSynchronizer& inputs = merger.inputs();
  const TimePoint now{};
  EXPECT_TRUE(inputs.next_set(now).ok());  // nothing arrived: nothing to merge, no error

  const std::vector<std::byte> garbage(1000, std::byte{0x5a});
  EXPECT_FALSE(inputs.receive(1, garbage, now));
  EXPECT_FALSE(inputs.receive(1, std::span<const std::byte>{}, now));
  const auto bytes = wall_packet(s, sensor);
  EXPECT_FALSE(inputs.receive(1, std::span(bytes).first(bytes.size() / 2), now));  // half a packet
  inputs.take_answer(0, garbage, now);
  ASSERT_TRUE(inputs.receive(0, bytes, now));
  EXPECT_TRUE(merges(merger, now + std::chrono::milliseconds(51)));
  EXPECT_EQ(inputs.drops().total(), 4u);
}

TEST_F(LockstepSceneFromFiles, ChunkLostOnTheWayIsAskedFor) {
  const Scene s = scene();
  node::SensorNode sensor(s, SensorId{0});
  node::MergeNode merger(s, s.mergers[0], true);
  auto packet = codec::decode_packet(wall_packet(s, sensor));
  ASSERT_TRUE(packet);
  packet->chunks.pop_back();
  ASSERT_TRUE(merger.inputs().receive(0, codec::encode_packet(*packet), TimePoint{}));
  const TimePoint later = TimePoint{} + std::chrono::milliseconds(60);
  EXPECT_FALSE(merges(merger, later));
  EXPECT_EQ(serve(merger, sensor, TimePoint{}), 1u);
  EXPECT_TRUE(merges(merger, later));
}

}  // namespace
}  // namespace mr
