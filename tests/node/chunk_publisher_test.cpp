#include "mr/node/chunk_publisher.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <set>

#include "mr/codec/mesh_codec.h"
#include "support/meshes.h"

namespace mr {
namespace {

Mesh surface(float bump = 0) {
  Mesh mesh = test::grid({-1, 1, 1}, {3, 0, 0}, {0, -2, 0}, 30, 20);
  mesh.positions[25].z += bump;
  set_view(mesh, ViewId{0});
  return *codec::snap_to_lattice(mesh, Lattice{});
}

Packet publish(node::ChunkPublisher& publisher, const Mesh& mesh,
               const node::CubeErrors& errors = {}) {
  Packet packet;
  publisher.set_moving(mesh, errors);
  EXPECT_TRUE(publisher.publish(5, packet));
  return packet;
}

TEST(ChunkPublisher, OnlyWhatChangedIsSentAgain) {
  Scene scene;
  node::ChunkPublisher publisher(scene, SensorId{2});
  const Packet first = publish(publisher, surface());
  EXPECT_GT(first.manifest.size(), 2u);
  EXPECT_EQ(first.chunks.size(), first.manifest.size());
  const Packet second = publish(publisher, surface());
  EXPECT_EQ(second.manifest, first.manifest);
  EXPECT_TRUE(second.chunks.empty());
  const Packet third = publish(publisher, surface(0.02f));
  EXPECT_EQ(third.manifest.size(), first.manifest.size());
  ASSERT_EQ(third.chunks.size(), 1u);
  EXPECT_EQ(first.manifest[0].version, 1u);
  EXPECT_EQ(third.chunks[0].key.version, 3u) << "of the third publication";
  EXPECT_EQ(third.chunks[0].key.id.source, SensorId{2});
  for (const ChunkKey& key : third.manifest) EXPECT_TRUE(publisher.find(key));
}

TEST(ChunkPublisher, ChunkThatComesBackHasANewVersion) {
  Scene scene;
  node::ChunkPublisher publisher(scene, SensorId{0});
  const Packet first = publish(publisher, surface());
  publish(publisher, Mesh{});
  const Packet again = publish(publisher, surface());
  EXPECT_EQ(again.chunks.size(), first.chunks.size());
  for (std::size_t i = 0; i < again.manifest.size(); ++i)
    EXPECT_GT(again.manifest[i].version, first.manifest[i].version);
}

TEST(ChunkPublisher, WithoutReuseEverythingIsSent) {
  Scene scene;
  scene.reuse_chunks = false;
  node::ChunkPublisher publisher(scene, SensorId{0});
  publish(publisher, surface());
  const Packet second = publish(publisher, surface());
  EXPECT_EQ(second.chunks.size(), second.manifest.size());
}

TEST(ChunkPublisher, WhatIsNotSetAgainIsWhatItWas) {
  Scene scene;
  node::ChunkPublisher publisher(scene, SensorId{0});
  const Packet first = publish(publisher, surface());
  Packet second;
  ASSERT_TRUE(publisher.publish(5, second));
  EXPECT_EQ(second.manifest, first.manifest);
  EXPECT_TRUE(second.chunks.empty());
}

TEST(ChunkPublisher, EachChunkHasItsOwnError) {
  Scene scene;
  node::ChunkPublisher publisher(scene, SensorId{0});
  node::CubeErrors errors;
  for (const auto& [cube, piece] : node::split_by_cube(surface(), scene.fusion.chunk_m))
    errors.raise(cube, 0.001f * static_cast<float>(2 + cube.x));
  const Packet packet = publish(publisher, surface(), errors);
  std::set<float> different;
  for (const EncodedChunk& chunk : packet.chunks) {
    EXPECT_FLOAT_EQ(chunk.error_m, 0.001f * static_cast<float>(2 + chunk.key.id.cube.x));
    different.insert(chunk.error_m);
  }
  EXPECT_GT(different.size(), 1u);
}

class LittleStillSurface : public testing::Test {
 protected:
  /// Sets it in cubes of half a chunk, higher by `bump_m`.
  void set(float bump_m = 0) {
    Mesh mesh = surface();
    for (Vec3f& p : mesh.positions) p.z += bump_m;
    mesh = *codec::snap_to_lattice(mesh, Lattice{});
    std::map<Vec3i, node::SurfacePiece> pieces;
    for (auto& [cube, piece] : node::split_by_cube(mesh, scene_.fusion.chunk_m / 2))
      pieces[cube].mesh = std::move(piece);
    publisher_.set_all_still(std::move(pieces));
  }
  Packet publish(node::Allowance allowed) {
    Packet packet;
    EXPECT_TRUE(publisher_.publish(5, packet, allowed));
    EXPECT_TRUE(std::ranges::is_sorted(packet.manifest));
    EXPECT_TRUE(std::ranges::is_sorted(packet.chunks, {}, &EncodedChunk::key));
    for (const ChunkKey& key : packet.manifest) EXPECT_TRUE(publisher_.find(key));
    return packet;
  }
  static double bytes_of(const Packet& packet) {
    double out = 0;
    for (const EncodedChunk& chunk : packet.chunks)
      out += static_cast<double>(chunk.payload.size());
    return out;
  }

  Scene scene_;
  node::ChunkPublisher publisher_{scene_, SensorId{0}};
};

TEST_F(LittleStillSurface, ComesPieceByPieceWithinItsBytes) {
  set();
  EXPECT_TRUE(publisher_.waiting_still().empty()) << "it may still come with the next packet";
  publish({0});
  const std::size_t all = publisher_.waiting_still().size();
  ASSERT_GT(all, 4u);
  const double first_guess = publisher_.waiting_bytes();
  EXPECT_GT(first_guess, 0);
  constexpr double kBytes = 700;
  std::size_t named = 0;
  int packets = 0;
  while (publisher_.waiting_bytes() > 0) {
    ASSERT_LT(++packets, 100);
    const Packet packet = publish({kBytes});
    EXPECT_LE(bytes_of(packet), kBytes);
    EXPECT_FALSE(packet.chunks.empty());
    named += packet.chunks.size();
    EXPECT_EQ(packet.manifest.size(), named) << "what was sent, and nothing else";
    EXPECT_EQ(publisher_.waiting_still().size(), all - named);
  }
  EXPECT_GT(packets, 2);
  EXPECT_EQ(named, all);
  EXPECT_TRUE(publish({kBytes}).chunks.empty());
}

TEST_F(LittleStillSurface, WhatWaitsIsShownAsItWas) {
  set();
  const Packet before = publish({});
  set(0.05f);
  EXPECT_GT(publisher_.waiting_bytes(), 0);
  const Packet held = publish({0});
  EXPECT_EQ(publisher_.waiting_still().size(), before.manifest.size());
  EXPECT_EQ(held.manifest, before.manifest);
  EXPECT_TRUE(held.chunks.empty());
  set(0.1f);  // again, before anything of it was sent
  EXPECT_EQ(publish({0}).manifest, before.manifest);
  const Packet all = publish({});
  EXPECT_EQ(all.chunks.size(), before.manifest.size());
  for (const EncodedChunk& chunk : all.chunks) {
    const auto decoded = codec::decode_chunk(chunk, Lattice{});
    ASSERT_TRUE(decoded);
    EXPECT_NEAR(decoded->mesh.positions[0].z, 1.1, 0.025) << "the newest";
  }
}

TEST_F(LittleStillSurface, OtherViewsWaitButAreNoOtherSurface) {
  set();
  publish({});
  std::map<Vec3i, node::SurfacePiece> pieces;
  for (auto& [cube, piece] : node::split_by_cube(surface(), scene_.fusion.chunk_m / 2)) {
    set_view(piece, ViewId{1});
    pieces[cube].mesh = std::move(piece);
  }
  publisher_.set_all_still(std::move(pieces));
  publish({0});
  EXPECT_GT(publisher_.waiting_bytes(), 0);
  EXPECT_TRUE(publisher_.waiting_still().empty());
}

TEST_F(LittleStillSurface, WhatIsGoneIsGoneAtOnce) {
  set();
  publish({});
  publisher_.set_all_still({});
  EXPECT_TRUE(publish({0}).manifest.empty());
  set();
  publisher_.set_all_still({});
  EXPECT_EQ(publisher_.waiting_bytes(), 0);
}

TEST_F(LittleStillSurface, APieceThatNeverFitsComesAnyway) {
  set();
  EXPECT_TRUE(publish({1}).chunks.empty());
  EXPECT_EQ(publish({1, true}).chunks.size(), 1u);
}

TEST_F(LittleStillSurface, WhatMovesDoesNotWait) {
  set();
  publisher_.set_moving(surface(), {});
  const auto bytes = publisher_.code_moving(5);
  ASSERT_TRUE(bytes);
  const Packet packet = publish({0});
  EXPECT_GT(packet.chunks.size(), 0u);
  EXPECT_EQ(bytes_of(packet), static_cast<double>(*bytes));
  for (const EncodedChunk& chunk : packet.chunks) EXPECT_EQ(chunk.key.id.layer, Layer::moving);
}

TEST_F(LittleStillSurface, SoDoesABackgroundModel) {
  EncodedChunk chunk;
  chunk.key.id.source = kBackgroundSource;
  std::vector<EncodedChunk> background;
  for (int i = 0; i < 4; ++i) {
    chunk.key.id.cube.x = i;
    chunk.payload = std::vector<std::byte>(1000);
    background.push_back(chunk);
  }
  publisher_.add_background(background);
  EXPECT_EQ(publisher_.waiting_bytes(), 4000);
  EXPECT_EQ(publish({2500}).manifest.size(), 2u);
  const Packet rest = publish({2500});
  EXPECT_EQ(rest.chunks.size(), 2u);
  EXPECT_EQ(rest.manifest.size(), 4u);
  EXPECT_EQ(publisher_.waiting_bytes(), 0);
}

TEST(CubeErrors, WhereNothingIsKnownThoseAroundCount) {
  node::CubeErrors errors;
  EXPECT_EQ(errors.at({0, 0, 0}), 0);
  errors.raise({0, 0, 0}, 0.001f);
  errors.raise({1, 0, 0}, 0.002f);
  errors.raise({9, 0, 0}, 0.004f);
  errors.raise({0, 0, 0}, 0.0005f);  // less than what is known
  EXPECT_FLOAT_EQ(errors.at({0, 0, 0}), 0.001f);
  EXPECT_FLOAT_EQ(errors.around({0, 0, 0}), 0.002f);
  EXPECT_FLOAT_EQ(errors.at({0, 1, 1}), 0.002f) << "its neighbours'";
  EXPECT_FLOAT_EQ(errors.at({0, -50, 0}), 0.004f) << "the largest of all";
}

TEST(CubeErrors, DecimationAddsToWhatWas) {
  node::CubeErrors before, by_decimation;
  before.raise({0, 0, 0}, 0.001f);
  before.raise({5, 0, 0}, 0.003f);
  by_decimation.raise({1, 0, 0}, 0.002f);
  by_decimation.raise({5, 0, 0}, 0.0f);
  const node::CubeErrors after = decimated(before, by_decimation);
  EXPECT_FLOAT_EQ(after.at({1, 0, 0}), 0.003f) << "the surface around had 0.001";
  EXPECT_FLOAT_EQ(after.at({5, 0, 0}), 0.003f);
}

TEST(CubeErrors, OfAMeshAreItsVerticesErrors) {
  const Mesh mesh = surface();
  std::vector<float> of_vertices(mesh.positions.size(), 0.0f);
  of_vertices[mesh.triangles[0][1]] = 0.004f;
  node::CubeErrors errors;
  errors.raise(mesh, of_vertices, 1.28);
  EXPECT_FLOAT_EQ(errors.most_m(), 0.004f);
  EXPECT_FLOAT_EQ(errors.at(node::cube_of(vec_cast<double>(mesh.centroid(0)), 1.28)), 0.004f);
  EXPECT_FLOAT_EQ(errors.at(node::cube_of({1.9, -0.9, 1}, 1.28)), 0);
}

TEST(SplitByCube, EveryTriangleOnceAndBordersFit) {
  const Mesh mesh = surface();
  std::size_t triangles = 0;
  for (const auto& [cube, piece] : node::split_by_cube(mesh, 1.28)) {
    triangles += piece.triangles.size();
    for (std::size_t t = 0; t < piece.triangles.size(); ++t)
      EXPECT_EQ(static_cast<int>(std::floor(piece.centroid(t).x / 1.28)), cube.x);
    for (const Vec3f p : piece.positions)
      EXPECT_NE(std::find(mesh.positions.begin(), mesh.positions.end(), p), mesh.positions.end());
  }
  EXPECT_EQ(triangles, mesh.triangles.size());
}

}  // namespace
}  // namespace mr
