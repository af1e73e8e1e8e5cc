#include "mr/node/chunk_publisher.h"

#include <gtest/gtest.h>

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

Packet publish(node::ChunkPublisher& publisher, const Mesh& mesh) {
  Packet packet;
  EXPECT_TRUE(publisher.publish(mesh, 0.001f, 5, packet));
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
