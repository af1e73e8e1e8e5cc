#include "mr/model/background.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <cstring>
#include <map>
#include <random>
#include <set>

#include "mr/codec/background_chunks.h"
#include "mr/codec/mesh_codec.h"
#include "mr/core/file.h"
#include "mr/core/parallel.h"
#include "mr/kit/image_io.h"
#include "mr/kit/topology.h"
#include "mr/model/export.h"
#include "support/glb.h"
#include "support/meshes.h"

namespace mr::model {
namespace {

using codec::decode_chunk;
using Rgb = std::array<std::uint8_t, 3>;

const Lattice kLattice{};
constexpr double kChunk_m = 0.5;
/// Turns glTF's +Y to the world's +Z.
const Pose kUpright{{{1, 0, 0, 0, 0, -1, 0, 1, 0}}, {}};

Result<std::vector<EncodedChunk>> encoded(const Result<ColoredMesh>& mesh, double chunk_m) {
  if (!mesh) return mesh.error();
  return codec::encode_background(*mesh, kLattice, chunk_m);
}

Result<std::vector<EncodedChunk>> encode_glb(std::span<const std::byte> glb, double chunk_m,
                                             double max_edge_m, const Notice& notice = {}) {
  return encoded(read_background(glb, {}, kLattice, max_edge_m, notice), chunk_m);
}

Result<std::vector<EncodedChunk>> encode_file(const BackgroundConfig& config, double max_edge_m) {
  return encoded(load_background(config, kLattice, max_edge_m), kChunk_m);
}

std::vector<Chunk> decoded(const Result<std::vector<EncodedChunk>>& chunks,
                           const Lattice& lattice = kLattice) {
  std::vector<Chunk> out;
  EXPECT_TRUE(chunks) << chunks.error().message;
  if (!chunks) return out;
  for (const EncodedChunk& chunk : *chunks) {
    auto back = decode_chunk(chunk, lattice);
    EXPECT_TRUE(back) << back.error().message;
    if (back) out.push_back(std::move(*back));
  }
  return out;
}

/// All chunks as one mesh, welded.
Mesh joined(const std::vector<Chunk>& chunks) {
  Mesh out;
  for (const Chunk& chunk : chunks) append(out, chunk.mesh);
  return kit::weld(out);
}

std::map<Vec3f, Rgb> colors_of(const std::vector<Chunk>& chunks) {
  std::map<Vec3f, Rgb> out;
  for (const Chunk& chunk : chunks)
    for (std::size_t v = 0; v < chunk.colors.size(); ++v) {
      const auto [at, is_new] = out.try_emplace(chunk.mesh.positions[v], chunk.colors[v]);
      EXPECT_TRUE(is_new || at->second == chunk.colors[v]) << "chunks agree at their borders";
    }
  return out;
}

double longest_edge_m(const Mesh& mesh) {
  double longest = 0;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    for (int i = 0; i < 3; ++i)
      longest = std::max<double>(longest, length(mesh.corner(t, (i + 1) % 3) - mesh.corner(t, i)));
  return longest;
}

Error::Cause cause_of(const std::vector<std::byte>& glb) {
  const auto chunks = encode_glb(glb, kChunk_m, 0.1);
  EXPECT_FALSE(chunks);
  if (chunks) return Error::Cause::io;
  const std::string& message = chunks.error().message;
  EXPECT_FALSE(message.empty());
  EXPECT_EQ(message.find('\n'), std::string::npos) << message;
  return chunks.error().cause;
}

/// A smooth picture: red grows to the right, green down.
ImageRgb ramp(int width, int height) {
  ImageRgb image(width, height);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      image.at(x, y)[0] = static_cast<std::uint8_t>(40 + 200 * x / width);
      image.at(x, y)[1] = static_cast<std::uint8_t>(40 + 200 * y / height);
      image.at(x, y)[2] = 90;
    }
  return image;
}

/// A textured wall that stands 2 m before a camera at the origin, as our exporter writes it.
DecodedScene background_scene() {
  DecodedScene scene;
  View view;
  view.id = ViewId{0};
  view.width = 128, view.height = 128;
  view.fx = view.fy = 100, view.cx = view.cy = 63.5;
  view.image_rect = view.atlas_rect = {0, 0, 128, 128};
  scene.views = {view};
  scene.textures[StreamId{0}] = std::make_shared<ImageRgb>(ramp(128, 128));
  auto chunk = std::make_shared<Chunk>();
  chunk->mesh = test::grid({-1, 1, 2}, {2, 0, 0}, {0, -2, 0}, 2, 2);
  set_view(chunk->mesh, ViewId{0});
  scene.chunks = {chunk};
  return scene;
}

class Background : public testing::Test {
 protected:
  void SetUp() override {
    const auto* test = testing::UnitTest::GetInstance()->current_test_info();
    file_ = std::filesystem::temp_directory_path() /
            ("mr_background_" + std::to_string(::getpid()) + "_" + test->name() + ".glb");
  }
  void TearDown() override { std::filesystem::remove(file_); }

  std::filesystem::path file_;
};

// ---- our own files ----

TEST_F(Background, WhatWeExportedComesBackInPlaceWithItsColours) {
  const std::pair<Vec3d, Pose> cases[] = {{{0, 1, 0}, {}}, {{0, 0, 1}, kUpright}};
  for (const auto& [up, T_world_model] : cases) {
    const DecodedScene scene = background_scene();
    ASSERT_TRUE(export_scene(scene, up, file_).ok());
    const auto chunks = decoded(encode_file({file_, T_world_model}, 0.05));
    const auto colors = colors_of(chunks);
    Box3f box;
    for (const auto& [p, color] : colors) {
      box.add(p);
      EXPECT_FLOAT_EQ(p.z, 2);
      const double x = 100 * p.x / p.z + 63.5, y = 100 * p.y / p.z + 63.5;  // pixel, by hand
      EXPECT_NEAR(color[0], 40 + 200 * x / 128, 3);
      EXPECT_NEAR(color[1], 40 + 200 * y / 128, 3);
      EXPECT_NEAR(color[2], 90, 1);
    }
    EXPECT_EQ(box.low, (Vec3f{-1, -1, 2}));
    EXPECT_EQ(box.high, (Vec3f{1, 1, 2}));
    const Mesh mesh = joined(chunks);
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
      EXPECT_LT(mesh.area_normal(t).z, 0) << "the side that was in front still is";
    EXPECT_NEAR(surface_area_m2(mesh), 4, 1e-4);
  }
}

TEST_F(Background, SurvivesItsOwnExport) {
  ASSERT_TRUE(export_scene(background_scene(), {0, 0, 1}, file_).ok());
  const auto first = decoded(encode_file({file_, kUpright}, 0.05));
  DecodedScene scene;
  for (const Chunk& chunk : first) scene.chunks.push_back(std::make_shared<Chunk>(chunk));
  ASSERT_TRUE(export_scene(scene, {0, 0, 1}, file_).ok());
  const auto second = decoded(encode_file({file_, kUpright}, 0.05));
  EXPECT_EQ(colors_of(second), colors_of(first)) << "positions and colours, to the last bit";
}

TEST_F(Background, PlyAndObjTakeItAlong) {
  const auto glb = test::glb_of(test::box({0, 0, 0}, {1, 1, 1}), {.factor = {1, 0.25f, 0}});
  DecodedScene scene;
  for (Chunk& chunk : decoded(encode_glb(glb, 5, 2)))
    scene.chunks.push_back(std::make_shared<Chunk>(std::move(chunk)));
  std::filesystem::path ply = file_, obj = file_;
  ply.replace_extension(".ply"), obj.replace_extension(".obj");
  ASSERT_TRUE(export_scene(scene, {0, 0, 1}, ply).ok());
  const auto bytes = read_file(ply);
  ASSERT_TRUE(bytes);
  const std::string text(reinterpret_cast<const char*>(bytes->data()), bytes->size());
  EXPECT_NE(text.find("element vertex 8\n"), std::string::npos);
  const std::size_t first = text.find("end_header\n") + 11;
  for (std::size_t v = 0; v < 8; ++v)
    EXPECT_EQ(text.substr(first + 15 * v + 12, 3), (std::string{'\xFF', '\x89', '\0'}));
  ASSERT_TRUE(export_scene(scene, {0, 0, 1}, obj).ok());
  const auto model = read_file(obj);
  ASSERT_TRUE(model);
  EXPECT_NE(std::string(reinterpret_cast<const char*>(model->data()), model->size())
                .find("usemtl background\n"),
            std::string::npos);
  for (const auto& file : {ply, obj}) std::filesystem::remove(file);
  std::filesystem::remove(obj.replace_extension(".mtl"));
}

TEST_F(Background, ChunksAreCutByTheGridAndWeldClosed) {
  const Mesh ball = test::sphere({0.1f, 0.2f, 0.3f}, 0.8f, 12);
  const auto glb = test::glb_of(ball);
  const auto coded = encode_glb(glb, kChunk_m, 0.08);
  ASSERT_TRUE(coded) << coded.error().message;
  ASSERT_GT(coded->size(), 8u);
  for (std::size_t i = 0; i < coded->size(); ++i) {
    const EncodedChunk& chunk = (*coded)[i];
    EXPECT_EQ(chunk.key.id.source, kBackgroundSource);
    EXPECT_EQ(chunk.key.version, 1u);
    EXPECT_EQ(chunk.key.level, 0u);
    EXPECT_TRUE(chunk.views.empty());
    if (i > 0) {
      EXPECT_LT((*coded)[i - 1].key, chunk.key);
    }
  }
  const auto chunks = decoded(coded);
  for (const Chunk& chunk : chunks)
    for (std::size_t t = 0; t < chunk.mesh.triangles.size(); ++t)
      for (int axis = 0; axis < 3; ++axis)
        EXPECT_EQ(std::floor(chunk.mesh.centroid(t)[axis] / kChunk_m), chunk.key.id.cube[axis]);
  const Mesh mesh = joined(chunks);
  EXPECT_EQ(kit::count_boundary_edges(mesh), 0u);
  EXPECT_EQ(kit::count_nonmanifold_edges(mesh), 0u);
  EXPECT_LE(longest_edge_m(mesh), 0.08);
  EXPECT_NEAR(surface_area_m2(mesh), surface_area_m2(ball), 0.01);
}

TEST_F(Background, NoEdgeIsLongerThanAskedFor) {
  const auto glb = test::glb_of(test::box({-1, -0.5f, 0}, {1, 0.5f, 0.02f}));
  for (const double max_edge_m : {1.0, 0.2, 0.03}) {
    const auto chunks = decoded(encode_glb(glb, 5, max_edge_m));
    const Mesh mesh = joined(chunks);
    EXPECT_LE(longest_edge_m(mesh), max_edge_m);
    EXPECT_EQ(kit::count_boundary_edges(mesh), 0u);
  }
}

TEST_F(Background, IsCutMoreCoarselyRatherThanNotAtAll) {
  const auto glb = test::glb_of(test::grid({0, 0, 0}, {100, 0, 0}, {0, 100, 0}, 1, 1));
  std::vector<std::string> notices;
  const auto chunks =
      encode_glb(glb, 20, 0.01, [&](const std::string& n) { notices.push_back(n); });
  ASSERT_TRUE(chunks) << chunks.error().message;
  std::size_t triangles = 0;
  for (const EncodedChunk& chunk : *chunks) triangles += chunk.triangles;
  EXPECT_LE(triangles, 2'000'000u);
  EXPECT_GT(triangles, 100'000u);
  ASSERT_EQ(notices.size(), 1u);
  EXPECT_NE(notices[0].find("instead of 1.0 cm"), std::string::npos) << notices[0];
}

TEST_F(Background, IsTheSameOnAnyNumberOfThreads) {
  const auto glb = test::glb_of(test::sphere({}, 1, 20), {.picture = ramp(300, 200)});
  Result<std::vector<EncodedChunk>> one = Error{}, eight = Error{};
  Arena(1).run([&] { one = encode_glb(glb, kChunk_m, 0.03); });
  Arena(8).run([&] { eight = encode_glb(glb, kChunk_m, 0.03); });
  ASSERT_TRUE(one && eight);
  EXPECT_EQ(*one, *eight);
}

// ---- what glTF can say ----

TEST_F(Background, NodesPlaceScaleTurnAndMirror) {
  const Mesh square = test::grid({0, 0, 0}, {1, 0, 0}, {0, 1, 0}, 1, 1);
  const auto nodes = nlohmann::json::parse(R"([
    {"translation": [0, 0, 5], "children": [1, 2]},
    {"mesh": 0, "scale": [2, 2, 2], "rotation": [0, 0, 0.7071067811865476, 0.7071067811865476]},
    {"mesh": 0, "matrix": [-1,0,0,0, 0,1,0,0, 0,0,1,0, 3,0,1,1]}])");
  const auto glb = test::glb_of(square, {.nodes = nodes});
  const Mesh mesh = joined(decoded(encode_glb(glb, 50, 10)));
  ASSERT_EQ(mesh.triangles.size(), 4u);
  Box3f turned, mirrored;
  for (const Vec3f p : mesh.positions) (p.z == 5 ? turned : mirrored).add(p);
  EXPECT_EQ(turned.low, (Vec3f{-2, 0, 5}));
  EXPECT_EQ(turned.high, (Vec3f{0, 2, 5}));
  EXPECT_EQ(mirrored.low, (Vec3f{2, 0, 6}));
  EXPECT_EQ(mirrored.high, (Vec3f{3, 1, 6}));
  for (std::size_t t = 0; t < 4; ++t)
    EXPECT_GT(mesh.area_normal(t).z, 0) << "a mirror keeps the outside outside";
}

TEST_F(Background, ColoursAreTheProductOfAll) {
  const Mesh square = test::grid({0, 0, 0}, {1, 0, 0}, {0, 1, 0}, 1, 1);
  ImageRgb white(4, 4, 255);
  const Vec3f half{0.5f, 1, 0.25f};
  const auto glb = test::glb_of(
      square, {.picture = white, .factor = {0.5f, 0.5f, 1}, .colors = {half, half, half, half}});
  for (const auto& [p, color] : colors_of(decoded(encode_glb(glb, 50, 0.3)))) {
    EXPECT_EQ(color, (Rgb{137, 188, 137})) << "sRGB of 0.25, 0.5, 0.25";
  }
}

TEST_F(Background, FineTexturesAreAveragedNotAliased) {
  ImageRgb stripes(512, 512);
  for (int y = 0; y < 512; ++y)
    for (int x = 0; x < 512; ++x) std::memset(stripes.at(x, y), x % 2 ? 255 : 0, 3);
  const auto glb =
      test::glb_of(test::grid({0, 0, 0}, {1, 0, 0}, {0, 1, 0}, 1, 1), {.picture = stripes});
  for (const auto& [p, color] : colors_of(decoded(encode_glb(glb, 50, 0.1))))
    EXPECT_NEAR(color[0], 188, 1) << "half the light";
}

TEST_F(Background, CoordinatesOutsideThePictureWrapAsTheSamplerSays) {
  ImageRgb quarters(2, 1);
  std::memset(quarters.at(1, 0), 255, 3);  // black on the left, white on the right
  const Mesh strip = test::grid({0, 0, 0}, {4, 0, 0}, {0, 0.25f, 0}, 16, 1);
  const std::map<int, std::array<int, 4>> expected = {
      {10497, {0, 255, 0, 255}}, {33648, {0, 255, 255, 0}}, {33071, {0, 255, 255, 255}}};
  for (const auto& [wrap, want] : expected) {
    // u runs from 0 to 2 along the strip; each metre is half a picture.
    const auto glb = test::glb_of(strip, {.picture = quarters, .wrap = wrap, .u_scale = 2});
    const auto colors = colors_of(decoded(encode_glb(glb, 50, 1)));
    for (int i = 0; i < 4; ++i) {
      const auto at = colors.find({0.5f + static_cast<float>(i), 0, 0});
      ASSERT_NE(at, colors.end());
      EXPECT_EQ(at->second[0], want[i]) << "wrap " << wrap << ", metre " << i;
    }
  }
}

TEST_F(Background, TrianglesNeedNoIndices) {
  const Mesh square = test::grid({0, 0, 0}, {1, 0, 0}, {0, 1, 0}, 1, 1);
  const auto glb = test::glb_of(square, {.indexed = false});
  const Mesh mesh = joined(decoded(encode_glb(glb, 50, 10)));
  EXPECT_EQ(mesh.triangles.size(), 2u);
  EXPECT_EQ(mesh.positions.size(), 4u);
}

// ---- files that cannot be trusted ----

TEST_F(Background, LiesAreErrors) {
  using Json = nlohmann::json;
  const Mesh square = test::grid({0, 0, 0}, {1, 0, 0}, {0, 1, 0}, 1, 1);
  const auto broken = [&](const std::function<void(Json&)>& change) {
    return cause_of(test::glb_of(square, {.picture = ramp(8, 8), .change = change}));
  };
  using enum Error::Cause;
  EXPECT_EQ(broken([](Json& j) { j["accessors"][0]["count"] = 5; }), corrupt);
  EXPECT_EQ(broken([](Json& j) { j["accessors"][0]["count"] = 4000000000000000000; }), corrupt);
  EXPECT_EQ(broken([](Json& j) { j["accessors"][0]["byteOffset"] = 4000000000000000000; }),
            corrupt);
  EXPECT_EQ(broken([](Json& j) { j["accessors"][0]["bufferView"] = 99; }), corrupt);
  EXPECT_EQ(broken([](Json& j) { j["accessors"][0]["type"] = "VEC4"; }), corrupt);
  EXPECT_EQ(broken([](Json& j) { j["accessors"][0]["componentType"] = 5130; }), unsupported);
  EXPECT_EQ(broken([](Json& j) { j["bufferViews"][0]["byteOffset"] = 1 << 20; }), corrupt);
  EXPECT_EQ(broken([](Json& j) { j["bufferViews"][0]["byteStride"] = 8; }), corrupt);
  EXPECT_EQ(broken([](Json& j) { j["bufferViews"][0]["buffer"] = 7; }), corrupt);
  EXPECT_EQ(broken([](Json& j) { j["buffers"][0]["uri"] = "../../etc/passwd"; }), unsupported);
  EXPECT_EQ(broken([](Json& j) { j["buffers"].push_back(j["buffers"][0]); }), unsupported);
  EXPECT_EQ(broken([](Json& j) { j["buffers"][0]["byteLength"] = 0; }), corrupt);
  EXPECT_EQ(broken([](Json& j) { j["images"][0] = {{"uri", "x.png"}}; }), unsupported);
  EXPECT_EQ(broken([](Json& j) { j["images"][0]["bufferView"] = 0; }), unsupported);
  EXPECT_EQ(broken([](Json& j) { j["nodes"][0]["children"] = {0}; }), corrupt);
  EXPECT_EQ(broken([](Json& j) { j["nodes"][0]["mesh"] = 3; }), corrupt);
  EXPECT_EQ(broken([](Json& j) { j["nodes"][0]["matrix"] = {1, 2, 3}; }), corrupt);
  EXPECT_EQ(broken([](Json& j) { j["nodes"][0]["scale"] = {1e300, 1e300, 1e300}; }), invalid);
  EXPECT_EQ(broken([](Json& j) { j["scenes"][0]["nodes"] = Json::array(); }), empty);
  EXPECT_EQ(broken([](Json& j) { j.erase("scenes"); }), empty);
  EXPECT_EQ(broken([](Json& j) { j["extensionsRequired"] = {"KHR_draco_mesh_compression"}; }),
            unsupported);
  EXPECT_EQ(broken([](Json& j) { j["meshes"][0]["primitives"][0]["mode"] = 5; }), unsupported);
  EXPECT_EQ(broken([](Json& j) { j["meshes"][0]["primitives"][0]["mode"] = 1; }), empty);
  EXPECT_EQ(broken([](Json& j) { j["meshes"][0]["primitives"][0]["indices"] = 0; }), corrupt);
  EXPECT_EQ(broken([](Json& j) { j["meshes"][0]["primitives"][0]["material"] = 9; }), corrupt);
  EXPECT_EQ(broken([](Json& j) {
              Json deep = Json::array();
              for (int i = 0; i < 100; ++i) deep = Json::array({deep});
              j["extras"] = deep;
            }),
            corrupt);
}

TEST_F(Background, NumbersMustBeFiniteAndIndicesThere) {
  Mesh mesh = test::grid({0, 0, 0}, {1, 0, 0}, {0, 1, 0}, 1, 1);
  mesh.triangles[1][2] = 4;
  EXPECT_EQ(cause_of(test::glb_of(mesh)), Error::Cause::corrupt);
  mesh.triangles[1][2] = 3;
  mesh.positions[0].x = std::nanf("");
  EXPECT_EQ(cause_of(test::glb_of(mesh)), Error::Cause::corrupt);
  mesh.positions[0].x = 1e6f;
  EXPECT_EQ(cause_of(test::glb_of(mesh)), Error::Cause::invalid) << "beyond the lattice";
  mesh.positions[0].x = 0;
  for (Vec3f& p : mesh.positions) p = p * 1e-5f;
  EXPECT_EQ(cause_of(test::glb_of(mesh)), Error::Cause::empty) << "all in one place";
}

TEST_F(Background, EveryTruncationIsAnErrorAndCorruptionNeverCrashes) {
  const auto good =
      test::glb_of(test::grid({0, 0, 0}, {1, 0, 0}, {0, 1, 0}, 2, 2), {.picture = ramp(8, 8)});
  for (std::size_t bytes = 0; bytes < good.size(); bytes += 7)
    cause_of({good.begin(), good.begin() + static_cast<std::ptrdiff_t>(bytes)});
  std::mt19937 random(3);
  int survived = 0;
  for (int i = 0; i < 2000; ++i) {
    auto bad = good;
    for (int flips = 1 + static_cast<int>(random() % 3); flips > 0; --flips)
      bad[random() % bad.size()] = static_cast<std::byte>(random() % 256);
    const auto chunks = encode_glb(bad, kChunk_m, 0.5);
    if (chunks) ++survived;
  }
  EXPECT_GT(survived, 0);
}

TEST_F(Background, ErrorsNameTheFile) {
  const auto missing = encode_file({file_, {}}, 0.1);
  ASSERT_FALSE(missing);
  EXPECT_EQ(missing.error().cause, Error::Cause::not_found);
  EXPECT_NE(missing.error().message.find(file_.string()), std::string::npos);
  ASSERT_TRUE(write_file(file_, "no model").ok());
  const auto wrong = encode_file({file_, {}}, 0.1);
  ASSERT_FALSE(wrong);
  EXPECT_EQ(wrong.error().cause, Error::Cause::corrupt);
  EXPECT_NE(wrong.error().message.find(file_.string()), std::string::npos);
}

}  // namespace
}  // namespace mr::model
