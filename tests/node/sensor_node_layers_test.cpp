#include "mr/node/sensor_node.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <string>

#include "mr/codec/alpha_codec.h"
#include "support/one_sensor.h"

namespace mr {
namespace {

using test::keys_of;
using test::kLearnt;
using test::of_layer;
using test::one_sensor;
using test::Sensor;
using test::Solids;
using test::wall;
using test::wall_and_box;
using test::with_layers;

// Layers: what stays, and what moves.

TEST(SensorNodeLayers, TheRoomIsSentOnceAndThenOnlyWhatMoves) {
  Sensor sensor(with_layers());
  for (int i = 0; i < kLearnt; ++i) sensor.see(wall());
  const Packet still = sensor.see(wall());
  EXPECT_EQ(of_layer(still.manifest, Layer::still), still.manifest) << "nothing moves";
  EXPECT_TRUE(still.chunks.empty());
  Sensor without(one_sensor());
  without.see(wall());
  EXPECT_NEAR(surface_area_m2(sensor.surface()), surface_area_m2(without.surface()), 0.05);
  for (const auto& chunk : sensor.chunks()) {
    EXPECT_EQ(chunk->key.id.source, SensorId{0});
    EXPECT_GE(chunk->error_m, 0);
    EXPECT_LT(chunk->error_m, sensor.scene().voxel_m);
    for (const SensorId id : triangle_sensors(chunk->mesh)) EXPECT_EQ(id, SensorId{0});
  }

  const Packet moving = sensor.see(wall_and_box());
  EXPECT_EQ(of_layer(moving.manifest, Layer::still), still.manifest) << "the room stays";
  EXPECT_EQ(keys_of(moving.chunks), of_layer(moving.manifest, Layer::moving));
  const Mesh box = test::all_of(sensor.chunks(Layer::moving));
  EXPECT_GT(surface_area_m2(box), 0.3 * 0.3 * 0.7) << "its front";
  EXPECT_LT(surface_area_m2(box), 0.4);
  for (const Vec3f p : box.positions) EXPECT_LT(p.z, 1.9) << "the wall behind is known";

  EXPECT_EQ(sensor.see(wall()).manifest, still.manifest) << "it left";
}

TEST(SensorNodeLayers, FeaturesTellOfTheSurfaceThatMoves) {
  Scene scene = with_layers();
  scene.rate.model = RateConfig::Model::ours;
  Sensor sensor(scene);
  const auto see = [&](const Solids& solids) {
    const Packet packet = sensor.see(solids);
    codec::Control control;
    control.shown = packet.sequence;
    sensor.node.answer(control);
    EXPECT_EQ(packet.features.size(), 1u);
    return rate::features_of(packet.features.at(0).values).value();
  };
  const rate::SceneFeatures all = see(wall());
  EXPECT_GT(all.mask_coverage, 0.5) << "nothing is known yet";
  for (int i = 0; i < kLearnt; ++i) see(wall());
  const rate::SceneFeatures none = see(wall());
  EXPECT_EQ(none.mask_coverage, 0);
  EXPECT_EQ(none.triangles, 0);
  const rate::SceneFeatures box = see(wall_and_box());
  EXPECT_GT(box.mask_coverage, 0);
  EXPECT_LT(box.mask_coverage, 0.5 * all.mask_coverage);
  EXPECT_GT(box.triangles, 0);
  EXPECT_LT(box.triangles, 0.5 * all.triangles);
}

TEST(SensorNodeLayers, ConfirmedTilesAreWhereNothingMoves) {
  Sensor sensor(with_layers());
  EXPECT_EQ(std::ranges::count(sensor.see(wall()).sources[0].confirmed_depth.tiles, 1), 0)
      << "nothing is known yet";
  for (int i = 0; i < kLearnt; ++i) sensor.see(wall());
  const SourceInfo still = sensor.see(wall()).sources.at(0);
  EXPECT_EQ(still.confirmed_depth.tile_px, 8);
  EXPECT_EQ(still.confirmed_depth.columns, 10);
  EXPECT_EQ(still.confirmed_depth.rows, 8);
  EXPECT_EQ(still.confirmed_color.tile_px, 16);
  EXPECT_EQ(still.confirmed_color.columns, 6);
  EXPECT_EQ(still.confirmed_color.rows, 4);
  ASSERT_EQ(still.confirmed_depth.tiles.size(), 80u);
  ASSERT_EQ(still.confirmed_color.tiles.size(), 24u);
  EXPECT_TRUE(still.confirmed_depth.at(5, 5) && still.confirmed_color.at(3, 2));
  const SourceInfo moving = sensor.see(wall_and_box()).sources.at(0);
  ASSERT_EQ(moving.confirmed_depth.tiles.size(), 80u);
  ASSERT_EQ(moving.confirmed_color.tiles.size(), 24u);
  EXPECT_FALSE(moving.confirmed_depth.at(5, 5)) << "the box is there";
  EXPECT_TRUE(moving.confirmed_depth.at(1, 1));
  EXPECT_FALSE(moving.confirmed_color.at(3, 2));
  EXPECT_TRUE(moving.confirmed_color.at(0, 0));
}

/// The picture is white where the colour camera sees a box that is not that far away.
Frame with_white_box(const Sensor& sensor, Frame frame, const Solids& solids) {
  const SensorConfig& config = sensor.scene().sensor(frame.sensor);
  const Camera& camera = *config.color_camera;
  const ImageDepth depth =
      test::depth_picture(solids, camera, frame.T_world_depth * config.T_color_depth.inverse());
  for (int y = 0; y < camera.height; ++y)
    for (int x = 0; x < camera.width; ++x)
      if (*depth.at(x, y) < 1.9f) std::fill_n(frame.color.at(x, y), 3, std::uint8_t{255});
  return frame;
}

TEST(SensorNodeLayers, TheOutlineIsThatOfThePicture) {
  Sensor sensor(with_layers());
  for (int i = 0; i < kLearnt; ++i)
    EXPECT_TRUE(sensor.see(wall()).alpha.empty()) << "nothing moves";
  const Solids box = wall_and_box();
  Frame frame = with_white_box(sensor, sensor.frame(box), box);
  const ImageRgb color = frame.color;
  for (int y = 0; y < 34; ++y) std::fill_n(frame.depth.row(y), 80, 0.0f);  // half of the box, too
  const Packet packet = sensor.packet(std::move(frame));
  ASSERT_EQ(packet.alpha.size(), 1u);
  EXPECT_EQ(packet.alpha[0].stream, packet.views.at(0).stream);
  ASSERT_EQ(packet.alpha[0].width, 48);
  ASSERT_EQ(packet.alpha[0].height, 32);
  const auto alpha = codec::decode_alpha(packet.alpha[0].data, 48, 32);
  ASSERT_TRUE(alpha);
  int cut = 0;
  for (int y = 0; y < 32; ++y)
    for (int x = 0; x < 48; ++x) {
      if (color.at(2 * x, 2 * y)[2] == 255 && color.at(2 * x + 1, 2 * y + 1)[2] == 255) {
        EXPECT_TRUE(*alpha->at(x, y)) << x << ' ' << y << " shows the box";
      }
      cut += !*alpha->at(x, y);
    }
  EXPECT_GT(cut, 100) << "the wall beside it";
  double front = 0;
  const Mesh moving = test::all_of(sensor.chunks(Layer::moving));
  for (std::size_t t = 0; t < moving.triangles.size(); ++t)
    if (moving.centroid(t).z < 1.7f) front += length(moving.area_normal(t)) / 2;
  EXPECT_GT(front, 0.3 * 0.3 * 0.7) << "half of it has no depth";
  EXPECT_TRUE(sensor.see(wall()).alpha.empty()) << "it left";
}

TEST(SensorNodeLayers, AnEmptyFrameIsNoNewsOnceTheRoomIsKnown) {
  Sensor sensor(with_layers());
  for (int i = 0; i < kLearnt; ++i) sensor.see(wall());
  const auto surface = sensor.node.reconstruct(sensor.frame({}));
  ASSERT_TRUE(surface);
  EXPECT_TRUE(surface->mesh.empty());
  EXPECT_FALSE(sensor.node.is_empty(*surface)) << "what is still counts";
}

TEST(SensorNodeLayers, AFrameThatComesToNothingLosesNoChunk) {
  Sensor usual(with_layers()), disturbed(with_layers());
  for (int i = 0; i < kLearnt; ++i) {
    usual.see(wall());
    Frame frame = disturbed.frame(wall());
    if (i >= 18) {  // by then the room was learnt
      disturbed.packet(frame);
      continue;
    }
    frame.T_world_depth.translation.x = 3e6;
    EXPECT_FALSE(disturbed.send(frame));
  }
  usual.see(wall()), disturbed.see(wall());
  const auto a = usual.chunks(Layer::still), b = disturbed.chunks(Layer::still);
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    EXPECT_EQ(a[i]->key.id, b[i]->key.id);
    EXPECT_EQ(a[i]->mesh, b[i]->mesh);
  }
}

TEST(SensorNodeLayers, ChunksOfTheRoomWaitForAFrameThatIsSent) {
  Scene scene = with_layers();
  scene.lattice.origin.z = 1.75 + scene.lattice.step_m() * Lattice::kCells / 2;
  Sensor usual(scene), disturbed(scene);
  for (int i = 0; i < 20; ++i)  // what moves lies beyond the lattice while the wall is learnt
    EXPECT_FALSE(
        disturbed.send(disturbed.frame(test::wall_with_box({-0.8 + 0.35 * (i % 5), 0.1, 1.4}))));
  for (int i = 0; i < kLearnt; ++i) usual.see(wall()), disturbed.see(wall());
  EXPECT_TRUE(disturbed.chunks(Layer::moving).empty());
  EXPECT_NEAR(surface_area_m2(disturbed.surface()), surface_area_m2(usual.surface()), 0.01);
}

TEST(SensorNodeLayers, OverALinkOfKnownLimitTheRoomComesPieceByPiece) {
  Scene scene = with_layers();
  scene.fusion.chunk_m = 0.32;  // so that there are pieces
  scene.rate.model = RateConfig::Model::ours;
  Sensor usual(scene);
  scene.links = {{usual.node.id(), "root", 0.1}};
  Sensor paced(scene);
  const auto see = [](Sensor& sensor) {
    const Packet packet = sensor.see(wall());
    sensor.node.answer({.key_frames = {}, .chunks = {}, .taken = {}, .shown = packet.sequence});
    double still = 0;
    for (const EncodedChunk& chunk : packet.chunks)
      if (chunk.key.id.layer == Layer::still) still += static_cast<double>(chunk.payload.size());
    return still;
  };
  double most_usual = 0, most_paced = 0, first_m2 = 0;
  int with_some = 0;  // captures that show some of the room as still, and not all
  for (int i = 0; i < 12 * kLearnt; ++i) {
    most_usual = std::max(most_usual, see(usual));
    most_paced = std::max(most_paced, see(paced));
    const double shown_m2 = surface_area_m2(paced.surface());
    if (i == 0) first_m2 = shown_m2;
    EXPECT_GT(shown_m2, 0.95 * first_m2) << "what waits is shown as moving, capture " << i;
    const std::size_t still = paced.chunks(Layer::still).size();
    with_some += still > 0 && still < usual.chunks(Layer::still).size();
  }
  EXPECT_LT(most_paced, 0.3 * most_usual);
  EXPECT_GT(with_some, 20);
  EXPECT_NEAR(surface_area_m2(paced.surface()), surface_area_m2(usual.surface()), 0.01);
  EXPECT_EQ(paced.chunks(Layer::still).size(), usual.chunks(Layer::still).size());
  EXPECT_TRUE(paced.chunks(Layer::moving).empty()) << "handed over once it was sent";
}

TEST(SensorNodeLayers, WatchedFramesTeachTheRoomWithoutPackets) {
  Sensor sensor(with_layers());
  int watched = 0;
  while (sensor.node.watch(sensor.frame(wall()))) ASSERT_LT(++watched, 200);
  EXPECT_GT(watched, 3);
  EXPECT_FALSE(sensor.node.watch(sensor.frame(wall())));
  const Packet first = sensor.see(wall());
  EXPECT_EQ(first.sequence, 0u);
  EXPECT_FALSE(of_layer(first.manifest, Layer::still).empty());
  Sensor without(one_sensor());
  EXPECT_FALSE(without.node.watch(without.frame(wall())));
}

TEST(SensorNodeLayers, APushedCameraLearnsTheRoomAnewAndSaysSoOnce) {
  Sensor sensor(with_layers());
  for (int i = 0; i < kLearnt; ++i) sensor.see(wall());
  Solids other = wall();
  other.boxes[0].low.z += 0.3;
  int told = 0;
  for (int i = 0; i < kLearnt; ++i) {
    const auto surface = sensor.node.reconstruct(sensor.frame(other));
    ASSERT_TRUE(surface);
    ASSERT_TRUE(sensor.node.code(*surface));
    if (!surface->still.began_anew) continue;
    ++told;
    const std::string line = sensor.node.pushed(surface->frame);
    EXPECT_TRUE(test::is_one_line(line));
    EXPECT_NE(line.find("frame " + std::to_string(surface->frame.index) + ": "), std::string::npos);
  }
  EXPECT_EQ(told, 1);
}

TEST(SensorNodeLayers, WhatBecameStillIsSentAsMovingUntilTheReceiverShowsIt) {
  Sensor sensor(with_layers(), 0, {}, node::StillWork::beside);
  constexpr int kTicks = 20;  // three times that are few enough for all to be made within the ticks
  Packet packet;
  for (int i = 0; i < kTicks; ++i) packet = sensor.see(wall());
  EXPECT_FALSE(of_layer(packet.manifest, Layer::still).empty());
  EXPECT_FALSE(of_layer(packet.manifest, Layer::moving).empty()) << "nobody shows it yet";

  const std::uint64_t newest = packet.sequence;
  sensor.node.answer({.key_frames = {}, .chunks = {}, .taken = {}, .shown = newest + 1000});
  for (int i = 0; i < kTicks; ++i) packet = sensor.see(wall());
  EXPECT_FALSE(of_layer(packet.manifest, Layer::moving).empty()) << "that is of another epoch";

  sensor.node.answer({.key_frames = {}, .chunks = {}, .taken = {}, .shown = newest});
  for (int i = 0; i < kTicks; ++i) packet = sensor.see(wall());
  EXPECT_TRUE(of_layer(packet.manifest, Layer::moving).empty());
}

}  // namespace
}  // namespace mr
