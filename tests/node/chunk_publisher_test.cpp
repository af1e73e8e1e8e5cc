#include "mr/node/chunk_publisher.h"

#include <gtest/gtest.h>

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
