#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "mr/core/mesh.h"
#include "support/merger_rig.h"

namespace mr {
namespace {

using test::box_on_the_right;
using test::doubled_share;
using test::ids_of;
using test::keys_of;
using test::kLearnt;
using test::Merger;
using test::of_layer;
using test::seen_together_m2;
using test::Solids;
using test::two_sensors_below_west;
using test::two_sensors_with_layers;
using test::unit_of;
using test::wall;

// Layers: what stays, and what moves.

TEST(MergeNodeLayers, TheRoomIsSentOnceAndThenOnlyWhatMoves) {
  Merger root(two_sensors_with_layers());
  const double seen = seen_together_m2(root.scene());
  for (int i = 0; i < kLearnt; ++i) {
    root.see(wall());
    EXPECT_NEAR(surface_area_m2(root.surface()), seen, 0.08 * seen) << "tick " << i;
    EXPECT_LT(doubled_share(root.surface()), 0.002) << "tick " << i;
  }
  const Packet still = root.see(wall());
  EXPECT_EQ(of_layer(still.manifest, Layer::still), still.manifest) << "nothing moves";
  EXPECT_TRUE(still.chunks.empty());
  EXPECT_FALSE(root.node.reused());
  const double half = root.scene().fusion.chunk_m / 2;
  for (const auto& chunk : root.decoded().chunks) {
    EXPECT_EQ(chunk->key.id.source, kMergedSource);
    const auto cube = vec_cast<double>(chunk->key.id.cube);
    for (std::size_t t = 0; t < chunk->mesh.triangles.size(); ++t) {
      const auto in = vec_cast<double>(chunk->mesh.centroid(t)) / half - cube;
      EXPECT_TRUE(in.x >= 0 && in.y >= 0 && in.z >= 0 && in.x < 1 && in.y < 1 && in.z < 1);
    }
  }

  const Packet moving = root.see(box_on_the_right(0));
  EXPECT_EQ(of_layer(moving.manifest, Layer::still), still.manifest) << "the room stays";
  EXPECT_EQ(keys_of(moving.chunks), of_layer(moving.manifest, Layer::moving));
  const Mesh box = root.surface(Layer::moving);
  EXPECT_GT(surface_area_m2(box), 0.3 * 0.3 * 0.6) << "its front";
  for (const Vec3f p : box.positions) EXPECT_TRUE(p.x > 0.9f && p.z < 2) << "and no wall";
  const auto whole = root.node.surface();
  EXPECT_NEAR(surface_area_m2(*whole), surface_area_m2(root.surface()), 1e-6) << "both layers";
  EXPECT_EQ(root.see(wall()).manifest, still.manifest) << "it left";
}

TEST(MergeNodeLayers, TheRootTexturesTheRoomByPlates) {
  Merger root(two_sensors_with_layers());
  Packet packet;
  std::size_t plates = 0;
  for (int i = 0; i < kLearnt; ++i) {
    packet = root.see(wall());
    plates += unit_of(packet, StreamId{1}) != nullptr;
  }
  ASSERT_EQ(ids_of(packet.views), (std::vector{ViewId{0}, ViewId{0}, ViewId{1}, ViewId{1}}))
      << "each with its plate";
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_EQ(packet.views[i].layer, i % 2 ? Layer::still : Layer::moving);
    EXPECT_EQ(packet.views[i].stream, StreamId{i % 2 == 1});
  }
  EXPECT_GE(plates, 1u);
  EXPECT_LT(plates, kLearnt / 2u) << "a picture that did not change is not sent again";
  EXPECT_EQ(root.decoded().textures.size(), 2u);
  const Mesh still = root.surface(Layer::still);
  double textured = 0;
  const std::vector<ViewId> views = triangle_views(still);
  for (std::size_t t = 0; t < views.size(); ++t)
    if (views[t] != kNoView) textured += length(still.area_normal(t)) / 2;
  EXPECT_GT(textured, 0.7 * surface_area_m2(still)) << "pictures are less high than depth";
  for (const SourceInfo& source : packet.sources)
    EXPECT_TRUE(source.confirmed_depth.empty() && source.confirmed_color.empty())
        << "nobody above the root needs that";
}

TEST(MergeNodeLayers, WhatMovesIsNotTexturedByWhoSeesAPostBeforeIt) {
  Merger root(two_sensors_with_layers());
  Solids room = wall();
  room.boxes.push_back({{0.24, -0.8, 0.8}, {0.46, 0.8, 0.9}});  // hides it from the right sensor
  for (int i = 0; i < kLearnt; ++i) root.see(room);
  room.boxes.push_back({{-0.05, -0.15, 1.6}, {0.25, 0.15, 1.7}});
  root.see(room);
  const Mesh box = root.surface(Layer::moving);
  const std::vector<ViewId> views = triangle_views(box);
  EXPECT_GT(std::ranges::count(views, ViewId{0}), 5);
  EXPECT_EQ(std::ranges::count(views, ViewId{1}), 0);
}

TEST(MergeNodeLayers, AnInnerMergerHandsOnWhatIsConfirmed) {
  Merger west(two_sensors_below_west(two_sensors_with_layers()), false);
  Packet packet;
  for (int i = 0; i < kLearnt; ++i) packet = west.see(wall());
  EXPECT_EQ(ids_of(packet.views), (std::vector{ViewId{0}, ViewId{1}})) << "plates are the root's";
  for (const SourceInfo& source : packet.sources) {
    EXPECT_GT(std::ranges::count(source.confirmed_depth.tiles, 1), 40);
    EXPECT_GT(std::ranges::count(source.confirmed_color.tiles, 1), 10);
  }
  EXPECT_EQ(doubled_share(west.surface(Layer::still)), 0);
}

TEST(MergeNodeLayers, TheRootTellsItsInputsOnceThatItShowsTheirRoom) {
  Merger root(two_sensors_with_layers());
  std::set<std::size_t> inputs;
  for (int i = 0; i < kLearnt; ++i) {
    const Packet packet = root.see(wall());
    for (const auto& [input, sequence] : root.node.take_shown()) {
      EXPECT_LE(sequence, packet.sequence) << "no more than was sent";
      EXPECT_FALSE(of_layer(packet.manifest, Layer::still).empty());
      inputs.insert(input);
    }
    EXPECT_TRUE(root.node.take_shown().empty());
  }
  EXPECT_EQ(inputs, (std::set<std::size_t>{0, 1}));
  root.see(wall());
  EXPECT_TRUE(root.node.take_shown().empty()) << "nothing of it is new";
}

TEST(MergeNodeLayers, AnInnerMergerTellsItsInputsWhenTheOneAboveShowsTheirRoom) {
  Merger west(two_sensors_below_west(two_sensors_with_layers()), false);
  std::uint64_t first_still = 0, newest = 0;
  for (int i = 0; i < kLearnt; ++i) {
    const Packet packet = west.see(wall());
    newest = packet.sequence;
    if (first_still == 0 && !of_layer(packet.manifest, Layer::still).empty()) first_still = newest;
    EXPECT_TRUE(west.node.take_shown().empty()) << "nobody said so";
  }
  ASSERT_GT(first_still, 0u);
  const auto shown = [](std::uint64_t sequence) {
    return codec::Control{.key_frames = {}, .chunks = {}, .taken = {}, .shown = sequence};
  };
  west.node.answer(shown(first_still - 1));
  EXPECT_TRUE(west.node.take_shown().empty());
  west.node.answer(shown(newest));
  const auto told = west.node.take_shown();
  ASSERT_EQ(told.size(), 2u);
  EXPECT_EQ(told[0].first, 0u);
  EXPECT_EQ(told[1].first, 1u);
  EXPECT_TRUE(west.node.take_shown().empty());
  west.node.answer(shown(newest));
  EXPECT_TRUE(west.node.take_shown().empty()) << "it was told already";
}

}  // namespace
}  // namespace mr
