#include "mr/model/export.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <csignal>
#include <cstring>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <sstream>

#include "mr/core/file.h"
#include "mr/kit/image_io.h"
#include "mr/model/bake.h"
#include "support/meshes.h"

namespace mr::model {
namespace {

using Json = nlohmann::json;
using testing::ElementsAre;
using testing::IsEmpty;
using testing::UnorderedElementsAre;

constexpr Vec3d kUp{0, 0, 1}, kYUp{0, 1, 0};  ///< nothing is turned with the latter

class Export : public testing::Test {
 protected:
  void SetUp() override {
    const auto* test = testing::UnitTest::GetInstance()->current_test_info();
    folder_ = std::filesystem::temp_directory_path() /
              ("mr_export_" + std::to_string(::getpid()) + "_" + test->name());
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::vector<std::string> files() const {
    std::vector<std::string> names;
    for (const auto& entry : std::filesystem::directory_iterator(folder_))
      names.push_back(entry.path().filename().string());
    return names;
  }

  std::filesystem::path folder_;
};

View view_of(std::uint32_t number, std::uint32_t stream, Rect atlas_rect) {
  View view;
  view.id = ViewId{number};
  view.stream = StreamId{stream};
  view.width = 64, view.height = 48;
  view.fx = 50, view.fy = 52, view.cx = 30.5, view.cy = 24;
  view.image_rect = {0, 0, 64, 48};
  view.atlas_rect = atlas_rect;
  return view;
}

/// Red grows to the right, green down.
ImageRgb ramp(int width, int height, std::uint8_t blue) {
  ImageRgb image(width, height);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      image.at(x, y)[0] = static_cast<std::uint8_t>(255 * x / width);
      image.at(x, y)[1] = static_cast<std::uint8_t>(255 * y / height);
      image.at(x, y)[2] = blue;
    }
  return image;
}

constexpr std::uint32_t kNone = number_of(kNoView);

/// `views`: [T].
std::shared_ptr<const Chunk> chunk_of(Mesh mesh, const std::vector<std::uint32_t>& views) {
  std::vector<ViewId> ids;
  for (const std::uint32_t view : views) ids.push_back(ViewId{view});
  set_triangle_views(mesh, ids);
  auto chunk = std::make_shared<Chunk>();
  chunk->mesh = std::move(mesh);
  return chunk;
}

/// Two chunks, side by side, 2 m before the cameras at the origin: view 0 and 1 share stream 4,
/// view 2 has stream 9; two triangles of each view, and two of none.
DecodedScene wall_scene() {
  DecodedScene scene;
  scene.views = {view_of(0, 4, {0, 0, 64, 48}), view_of(1, 4, {64, 0, 32, 24}),
                 view_of(2, 9, {3, 5, 50, 40})};
  scene.textures[StreamId{4}] = std::make_shared<ImageRgb>(ramp(100, 48, 10));
  scene.textures[StreamId{9}] = std::make_shared<ImageRgb>(ramp(61, 50, 200));
  const Mesh left = test::grid({-0.5f, 0.25f, 2}, {0.5f, 0, 0}, {0, -0.5f, 0}, 2, 1);
  const Mesh right = test::grid({0, 0.25f, 2}, {0.5f, 0, 0}, {0, -0.5f, 0}, 2, 1);
  scene.chunks = {
      chunk_of(left, {0, 0, 1, 1}), chunk_of(right, {1, 1, 2, 2}),
      chunk_of(test::grid({0.5f, 0.25f, 2}, {0.5f, 0, 0}, {0, -0.5f, 0}, 1, 1), {kNone, kNone})};
  return scene;
}

template <typename T>
T get(const std::vector<std::byte>& bytes, std::size_t at) {
  T value{};
  EXPECT_LE(at + sizeof(T), bytes.size());
  if (at + sizeof(T) <= bytes.size()) std::memcpy(&value, bytes.data() + at, sizeof(T));
  return value;
}

/// A .glb read as a strict reader would.
struct Glb {
  Json json;
  std::vector<std::byte> binary;

  explicit Glb(const std::filesystem::path& file) {
    const auto bytes = read_file(file);
    EXPECT_TRUE(bytes.ok());
    EXPECT_EQ(get<std::uint32_t>(*bytes, 0), 0x46546C67u);
    EXPECT_EQ(get<std::uint32_t>(*bytes, 4), 2u);
    EXPECT_EQ(get<std::uint32_t>(*bytes, 8), bytes->size());
    const auto text = get<std::uint32_t>(*bytes, 12);
    EXPECT_EQ(get<std::uint32_t>(*bytes, 16), 0x4E4F534Au);
    EXPECT_EQ(text % 4, 0u);
    const auto* first = reinterpret_cast<const char*>(bytes->data()) + 20;
    json = Json::parse(first, first + text);
    const auto length = get<std::uint32_t>(*bytes, 20 + text);
    EXPECT_EQ(get<std::uint32_t>(*bytes, 24 + text), 0x004E4942u);
    EXPECT_EQ(28 + text + length, bytes->size());
    binary.assign(bytes->begin() + 28 + text, bytes->end());
    EXPECT_LE(json["buffers"][0]["byteLength"], binary.size());
  }

  std::size_t offset(const Json& view, std::size_t bytes) const {
    EXPECT_LE(bytes, view["byteLength"].get<std::size_t>());
    const auto at = view["byteOffset"].get<std::size_t>();
    EXPECT_EQ(at % 4, 0u);
    EXPECT_LE(at + view["byteLength"].get<std::size_t>(), binary.size());
    return at;
  }

  template <typename T>
  std::vector<T> read(int accessor) const {
    const Json& a = json["accessors"][accessor];
    const auto count = a["count"].get<std::size_t>();
    const std::size_t at =
        offset(json["bufferViews"][a["bufferView"].get<int>()], count * sizeof(T));
    std::vector<T> out;
    for (std::size_t i = 0; i < count; ++i) out.push_back(get<T>(binary, at + i * sizeof(T)));
    return out;
  }

  std::vector<std::uint32_t> indices(const Json& primitive) const {
    const int accessor = primitive["indices"];
    if (json["accessors"][accessor]["componentType"] == 5125) return read<std::uint32_t>(accessor);
    const auto small = read<std::uint16_t>(accessor);
    return {small.begin(), small.end()};
  }
};

TEST_F(Export, GlbHasAPrimitivePerStreamAndOneWithoutTexture) {
  ASSERT_TRUE(export_scene(wall_scene(), kUp, folder_ / "a.glb").ok());
  EXPECT_THAT(files(), ElementsAre("a.glb"));
  const Glb glb(folder_ / "a.glb");
  EXPECT_EQ(glb.json["asset"]["version"], "2.0");
  EXPECT_EQ(glb.json["asset"]["generator"], "MeshReduce");
  EXPECT_EQ(glb.json["extensionsUsed"], Json::array({"KHR_materials_unlit"}));
  EXPECT_EQ(glb.json["samplers"].size(), 1u);
  const Json& primitives = glb.json["meshes"][0]["primitives"];
  ASSERT_EQ(primitives.size(), 3u);
  std::vector<std::size_t> triangles;
  for (const Json& primitive : primitives) {
    const auto positions = glb.read<Vec3f>(primitive["attributes"]["POSITION"]);
    const Json& accessor = glb.json["accessors"][primitive["attributes"]["POSITION"].get<int>()];
    Box3f box;
    for (const Vec3f p : positions) box.add(p);
    for (int i = 0; i < 3; ++i) {
      EXPECT_EQ(accessor["min"][i].get<float>(), box.low[i]);
      EXPECT_EQ(accessor["max"][i].get<float>(), box.high[i]);
    }
    const auto indices = glb.indices(primitive);
    EXPECT_TRUE(std::ranges::all_of(indices, [&](auto i) { return i < positions.size(); }));
    triangles.push_back(indices.size() / 3);
    const Json& material = glb.json["materials"][primitive["material"].get<int>()];
    EXPECT_EQ(material["doubleSided"], true);
    EXPECT_TRUE(material["extensions"].contains("KHR_materials_unlit"));
    const bool textured = material["pbrMetallicRoughness"].contains("baseColorTexture");
    EXPECT_EQ(textured, primitive["attributes"].contains("TEXCOORD_0"));
  }
  EXPECT_THAT(triangles, ElementsAre(6, 2, 2));
}

TEST_F(Export, GlbCoordinatesAreThoseOfTheProjection) {
  const DecodedScene scene = wall_scene();
  ASSERT_TRUE(export_scene(scene, kUp, folder_ / "a.glb").ok());
  const Glb glb(folder_ / "a.glb");
  const Json& primitive = glb.json["meshes"][0]["primitives"][1];  // stream 9, view 2 alone
  const auto positions = glb.read<Vec3f>(primitive["attributes"]["POSITION"]);
  const auto uvs = glb.read<Vec2f>(primitive["attributes"]["TEXCOORD_0"]);
  ASSERT_EQ(positions.size(), 4u);
  ASSERT_EQ(uvs.size(), 4u);
  for (std::size_t v = 0; v < 4; ++v) {
    const Vec3f p = positions[v];
    const double px = 50 * p.x / p.z + 30.5, py = 52 * p.y / p.z + 24;  // by hand
    EXPECT_NEAR(uvs[v].x, ((px + 0.5) * 50 / 64 + 3) / 61, 1e-6);
    EXPECT_NEAR(uvs[v].y, ((py + 0.5) * 40 / 48 + 5) / 50, 1e-6);
  }
}

TEST_F(Export, GlbPicturesAreThoseOfTheStreams) {
  const DecodedScene scene = wall_scene();
  ASSERT_TRUE(export_scene(scene, kUp, folder_ / "a.glb").ok());
  const Glb glb(folder_ / "a.glb");
  ASSERT_EQ(glb.json["images"].size(), 2u);
  for (const int i : {0, 1}) {
    const Json& image = glb.json["images"][i];
    EXPECT_EQ(image["mimeType"], "image/png");
    const Json& view = glb.json["bufferViews"][image["bufferView"].get<int>()];
    const auto* png = glb.binary.data() + glb.offset(view, 0);
    ASSERT_TRUE(
        write_file(folder_ / "picture.png", std::span(png, view["byteLength"].get<std::size_t>()))
            .ok());
    const auto picture = kit::read_color(folder_ / "picture.png");
    ASSERT_TRUE(picture.ok());
    EXPECT_EQ(*picture, *scene.textures.at(StreamId{i == 0 ? 4u : 9u}));
  }
}

TEST_F(Export, ALayersOwnViewsTextureItsChunksWithTheirGain) {
  DecodedScene scene = wall_scene();  // view 1 has a plate, too, in stream 7
  View plate = view_of(1, 7, {4, 2, 32, 24});
  plate.layer = Layer::still, plate.gain = {0.5f, 1, 3};
  scene.views.insert(scene.views.begin() + 2, plate);
  scene.textures[StreamId{7}] = std::make_shared<ImageRgb>(ramp(40, 30, 100));
  auto still = std::make_shared<Chunk>(*scene.chunks[1]);  // of views 1, 1, 2, 2
  still->key.id.layer = Layer::still;
  scene.chunks[1] = still;
  const auto parts = bake(scene);
  ASSERT_TRUE(parts.ok());
  std::map<StreamId, std::size_t> triangles;
  for (const BakedPart& part : *parts)
    if (part.stream) triangles[*part.stream] = part.triangles.size();
  EXPECT_EQ(triangles, (std::map<StreamId, std::size_t>{
                           {StreamId{4}, 4}, {StreamId{7}, 2}, {StreamId{9}, 2}}));
  const auto shown = shown_textures(scene);
  EXPECT_EQ(shown.at(StreamId{4}), scene.textures.at(StreamId{4}));
  const ImageRgb &before = *scene.textures.at(StreamId{7}), &after = *shown.at(StreamId{7});
  for (int y = 0; y < 30; ++y)
    for (int x = 0; x < 40; ++x) {
      const bool inside = x >= 4 && x < 36 && y >= 2 && y < 26;
      ASSERT_EQ(after.at(x, y)[0], inside ? (before.at(x, y)[0] + 1) / 2 : before.at(x, y)[0]);
      ASSERT_EQ(after.at(x, y)[1], before.at(x, y)[1]);
      ASSERT_EQ(after.at(x, y)[2], inside ? 255 : 100);
    }
  ASSERT_TRUE(export_scene(scene, kUp, folder_ / "a.obj").ok());
  EXPECT_THAT(files(), UnorderedElementsAre("a.obj", "a.mtl", "a_4.png", "a_7.png", "a_9.png"));
  const auto picture = kit::read_color(folder_ / "a_7.png");
  ASSERT_TRUE(picture.ok());
  EXPECT_EQ(*picture, after);
}

TEST_F(Export, GlbTurnsUpToY) {
  for (const Vec3d up : {Vec3d{0, 0, 1}, Vec3d{0, 1, 0}, Vec3d{0, -1, 0}, Vec3d{1, 0, 0},
                         normalized(Vec3d{0.2, -0.9, 0.3}), normalized(Vec3d{1e-8, -1, 0}),
                         normalized(Vec3d{0, -1, 1e-4})}) {
    ASSERT_TRUE(export_scene(wall_scene(), up, folder_ / "a.glb").ok());
    const auto q = Glb(folder_ / "a.glb").json["nodes"][0]["rotation"].get<std::array<double, 4>>();
    const Vec3d v{q[0], q[1], q[2]};
    EXPECT_NEAR(dot(v, v) + q[3] * q[3], 1, 1e-12);
    const Vec3d turned = up + cross(v, cross(v, up) + up * q[3]) * 2.0;
    EXPECT_NEAR(length(turned - Vec3d{0, 1, 0}), 0, 2e-6) << up.x << " " << up.y << " " << up.z;
  }
}

TEST_F(Export, GlbUsesWideIndicesWhereNeeded) {
  DecodedScene scene;
  const Mesh grid = test::grid({0, 0, 0}, {1, 0, 0}, {0, 1, 0}, 260, 260);  // 68,121 vertices
  scene.chunks = {chunk_of(grid, std::vector<std::uint32_t>(grid.triangles.size(), kNone))};
  ASSERT_TRUE(export_scene(scene, kUp, folder_ / "a.glb").ok());
  const Glb glb(folder_ / "a.glb");
  const auto indices = glb.indices(glb.json["meshes"][0]["primitives"][0]);
  EXPECT_EQ(glb.json["accessors"][1]["componentType"], 5125);
  EXPECT_EQ(std::ranges::max(indices), 261u * 261 - 1);
}

TEST_F(Export, BakeWeldsAcrossChunksWithinAView) {
  const auto parts = bake(wall_scene());
  ASSERT_TRUE(parts.ok());
  ASSERT_EQ(parts->size(), 3u);
  EXPECT_EQ((*parts)[0].positions.size(), 4u + 6u);  // view 1 spans both chunks
  EXPECT_EQ((*parts)[1].positions.size(), 4u);
  EXPECT_EQ((*parts)[2].positions.size(), 4u);
  EXPECT_TRUE((*parts)[2].uvs.empty());
}

TEST_F(Export, BakeClampsIntoTheTile) {
  DecodedScene scene = wall_scene();
  scene.chunks = {chunk_of(test::grid({-9, 9, 1}, {18, 0, 0}, {0, -18, 0}, 1, 1), {1, 1})};
  const auto parts = bake(scene);
  ASSERT_TRUE(parts.ok());
  for (const Vec2f uv : (*parts)[0].uvs) {
    EXPECT_TRUE(std::abs(uv.x - 64.5 / 100) < 1e-6 || std::abs(uv.x - 95.5 / 100) < 1e-6) << uv.x;
    EXPECT_TRUE(std::abs(uv.y - 0.5 / 48) < 1e-6 || std::abs(uv.y - 23.5 / 48) < 1e-6) << uv.y;
  }
}

/// The wall's left half of view 0, as moving, with a disc as alpha of its picture.
DecodedScene scene_with_alpha(Layer layer) {
  DecodedScene scene = wall_scene();
  auto chunk = std::make_shared<Chunk>(*chunk_of(
      test::grid({-0.6f, 0.4f, 2}, {1.2f, 0, 0}, {0, -0.8f, 0}, 2, 2), std::vector(8, 0u)));
  chunk->key.id.layer = layer;
  scene.chunks = {chunk};
  auto alpha = std::make_shared<Alpha>(Alpha{2, ImageMask(50, 24)});
  for (int y = 0; y < 24; ++y)
    for (int x = 0; x < 50; ++x) *alpha->plane.at(x, y) = std::hypot(x - 15, y - 12) < 5;
  scene.alpha = {{StreamId{4}, alpha}};
  return scene;
}

double area_of(const BakedPart& part) { return surface_area_m2({part.positions, part.triangles}); }

TEST_F(Export, WhatMovesIsCutAlongAlpha) {
  const auto parts = bake(scene_with_alpha(Layer::moving));
  ASSERT_TRUE(parts);
  ASSERT_EQ(parts->size(), 1u);
  // 69 pixels of the plane lie on the disc, each 2x2 of the picture's, at 2 m and 50 and 52 pixels
  // per radian.
  const double disc = 69 * (2 * 2 / 50.0) * (2 * 2 / 52.0);
  EXPECT_NEAR(area_of(parts->front()), disc, 0.02 * disc);
  for (const Vec3f p : parts->front().positions) EXPECT_LT(std::hypot(p.x, p.y), 0.47);
}

TEST_F(Export, WhatStaysIsNotCut) {
  const auto parts = bake(scene_with_alpha(Layer::still));
  ASSERT_TRUE(parts);
  EXPECT_NEAR(area_of(parts->front()), 1.2 * 0.8, 1e-5);
}

TEST_F(Export, AlphaOfAnotherSizeIsAnError) {
  DecodedScene scene = scene_with_alpha(Layer::moving);
  scene.alpha[StreamId{4}] = std::make_shared<Alpha>(Alpha{2, ImageMask(50, 25)});
  EXPECT_FALSE(bake(scene));
}

TEST_F(Export, TrianglesThatReachBehindAPinholeLoseTheirTexture) {
  DecodedScene scene = wall_scene();
  Mesh mesh;
  mesh.positions = {{0, 0, 2}, {1, 0, -1}, {0, 1, 0}, {1, 1, 2}, {1, 0, 2}};
  mesh.triangles = {{0, 1, 2}, {0, 3, 4}, {0, 2, 3}};
  scene.chunks = {chunk_of(mesh, {0, 0, 0})};
  const auto parts = bake(scene);
  ASSERT_TRUE(parts.ok());
  ASSERT_EQ(parts->size(), 2u);
  EXPECT_EQ((*parts)[0].triangles.size(), 1u);
  for (const Vec2f uv : (*parts)[0].uvs) EXPECT_TRUE(std::isfinite(uv.x) && std::isfinite(uv.y));
  EXPECT_FALSE((*parts)[1].stream);
  EXPECT_EQ((*parts)[1].triangles.size(), 2u);
  EXPECT_TRUE(export_scene(scene, kUp, folder_ / "a.glb").ok());
}

TEST_F(Export, TrianglesAcrossAPanoramasSeamStaySmall) {
  DecodedScene scene;
  View view = view_of(0, 0, {0, 0, 368, 180});
  view.kind = View::Kind::equirectangular;
  view.width = 360, view.height = 180;
  view.image_rect = {-4, 0, 368, 180};
  scene.views = {view};
  scene.textures[StreamId{0}] = std::make_shared<ImageRgb>(ramp(368, 180, 0));
  const Mesh behind = test::grid({-0.1f, -0.1f, -2}, {0.2f, 0, 0}, {0, 0.2f, 0}, 3, 3);
  scene.chunks = {chunk_of(behind, std::vector<std::uint32_t>(18, 0))};
  const auto parts = bake(scene);
  ASSERT_TRUE(parts.ok());
  ASSERT_EQ(parts->size(), 1u);
  const BakedPart& part = (*parts)[0];
  bool low = false, high = false;
  for (const Triangle& t : part.triangles) {
    const auto [least, most] = std::minmax({part.uvs[t[0]].x, part.uvs[t[1]].x, part.uvs[t[2]].x});
    EXPECT_LT(most - least, 0.01f);
    (least < 0.5f ? low : high) = true;
  }
  EXPECT_TRUE(low && high);
}

TEST_F(Export, SamplesBetweenPixelCentres) {
  ImageRgb picture(2, 2);
  picture.at(1, 0)[0] = 200, picture.at(0, 1)[1] = 100, picture.at(1, 1)[2] = 40;
  const auto at = [&](float u, float v) { return sample(picture, {u, v}); };
  EXPECT_THAT(at(0.75f, 0.25f), ElementsAre(200, 0, 0));
  EXPECT_THAT(at(0.5f, 0.25f), ElementsAre(100, 0, 0));
  EXPECT_THAT(at(0.5f, 0.5f), ElementsAre(50, 25, 10));
  EXPECT_THAT(at(0, 1), ElementsAre(0, 100, 0));
}

TEST_F(Export, PlyReadsBack) {
  const DecodedScene scene = wall_scene();
  ASSERT_TRUE(export_scene(scene, kYUp, folder_ / "a.PLY").ok());
  const auto bytes = read_file(folder_ / "a.PLY");
  ASSERT_TRUE(bytes.ok());
  const std::string text(reinterpret_cast<const char*>(bytes->data()), bytes->size());
  const std::string end = "end_header\n";
  ASSERT_TRUE(text.starts_with("ply\nformat binary_little_endian 1.0\n"));
  EXPECT_NE(text.find("element vertex 18\n"), std::string::npos);
  EXPECT_NE(text.find("element face 10\n"), std::string::npos);
  std::size_t at = text.find(end) + end.size();
  ASSERT_EQ(bytes->size(), at + 18 * 15 + 10 * 13);
  for (int v = 0; v < 18; ++v, at += 15) {
    const Vec3f p = get<Vec3f>(*bytes, at);
    EXPECT_EQ(p.z, 2);
    const auto c = get<std::array<std::uint8_t, 3>>(*bytes, at + 12);
    if (v >= 14)
      EXPECT_THAT(c, ElementsAre(176, 176, 176));
    else
      EXPECT_EQ(c[2], v < 10 ? 10 : 200);
    if (v >= 4) continue;  // view 0, unscaled: the colour tells the pixel
    EXPECT_NEAR(c[0], 255 * (50 * p.x / p.z + 30.5) / 100, 1.1);
    EXPECT_NEAR(c[1], 255 * (52 * p.y / p.z + 24) / 48, 1.1);
  }
  for (int f = 0; f < 10; ++f, at += 13) {
    EXPECT_EQ(get<std::uint8_t>(*bytes, at), 3);
    for (int i = 0; i < 3; ++i) EXPECT_LT(get<std::uint32_t>(*bytes, at + 1 + 4 * i), 18u);
  }
}

TEST_F(Export, ObjReadsBack) {
  const DecodedScene scene = wall_scene();
  ASSERT_TRUE(export_scene(scene, kYUp, folder_ / "my room.obj").ok());
  EXPECT_THAT(files(),
              UnorderedElementsAre("my room.obj", "my_room.mtl", "my_room_4.png", "my_room_9.png"));
  const auto picture = kit::read_color(folder_ / "my_room_9.png");
  ASSERT_TRUE(picture.ok());
  EXPECT_EQ(*picture, *scene.textures.at(StreamId{9}));

  std::ifstream in(folder_ / "my room.obj");
  std::vector<Vec3f> positions;
  std::vector<Vec2f> uvs;
  std::vector<std::string> materials;
  int faces = 0;
  for (std::string line, word; std::getline(in, line);) {
    std::istringstream words(line);
    words >> word;
    if (word == "v")
      words >> positions.emplace_back().x >> positions.back().y >> positions.back().z;
    if (word == "vt") words >> uvs.emplace_back().x >> uvs.back().y;
    if (word == "usemtl") words >> materials.emplace_back();
    if (word != "f") continue;
    ++faces;
    while (words >> word) {
      const std::size_t slash = word.find('/');
      const auto v = std::stoul(word.substr(0, slash));
      ASSERT_TRUE(v >= 1 && v <= positions.size());
      if (slash == std::string::npos) {
        EXPECT_EQ(materials.back(), "no_view");
        continue;
      }
      const auto vt = std::stoul(word.substr(slash + 1));
      ASSERT_TRUE(vt >= 1 && vt <= uvs.size());
      if (materials.back() != "stream_9") continue;
      const Vec2d pixel = *project(scene.views[2].camera(), vec_cast<double>(positions[v - 1]));
      const Vec2d uv = atlas_uv(scene.views[2], pixel, 61, 50);
      EXPECT_NEAR(uvs[vt - 1].x, uv.x, 1e-6);
      EXPECT_NEAR(uvs[vt - 1].y, 1 - uv.y, 1e-6);
    }
  }
  EXPECT_EQ(faces, 10);
  EXPECT_THAT(materials, ElementsAre("stream_4", "stream_9", "no_view"));

  std::stringstream mtl;
  mtl << std::ifstream(folder_ / "my_room.mtl").rdbuf();
  for (const char* expected : {"newmtl stream_4", "newmtl stream_9", "newmtl no_view",
                               "map_Kd my_room_4.png", "map_Kd my_room_9.png"})
    EXPECT_NE(mtl.str().find(expected), std::string::npos) << expected;
}

/// Vertices of a .glb as a viewer shows them.
std::vector<Vec3d> shown_positions(const Glb& glb) {
  const auto q = glb.json["nodes"][0]["rotation"].get<std::array<double, 4>>();
  const Vec3d v{q[0], q[1], q[2]};
  std::vector<Vec3d> out;
  for (const Json& primitive : glb.json["meshes"][0]["primitives"])
    for (const Vec3f at : glb.read<Vec3f>(primitive["attributes"]["POSITION"])) {
      const Vec3d p = vec_cast<double>(at);
      out.push_back(p + cross(v, cross(v, p) + p * q[3]) * 2.0);
    }
  return out;
}

std::vector<Vec3d> ply_positions(const std::filesystem::path& file) {
  const auto bytes = read_file(file);
  const std::string text(reinterpret_cast<const char*>(bytes->data()), bytes->size());
  const std::size_t count = std::stoul(text.substr(text.find("element vertex ") + 15));
  const std::size_t first = text.find("end_header\n") + 11;
  std::vector<Vec3d> out;
  for (std::size_t v = 0; v < count; ++v)
    out.push_back(vec_cast<double>(get<Vec3f>(*bytes, first + 15 * v)));
  return out;
}

std::vector<Vec3d> obj_positions(const std::filesystem::path& file) {
  std::ifstream in(file);
  std::vector<Vec3d> out;
  for (std::string line, word; std::getline(in, line);) {
    std::istringstream words(line);
    words >> word;
    if (word == "v") words >> out.emplace_back().x >> out.back().y >> out.back().z;
  }
  return out;
}

TEST_F(Export, AllFormatsStandTheSameWay) {
  for (const Vec3d up : {Vec3d{0, 0, 1}, Vec3d{0, 1, 0}, Vec3d{0, -1, 0}, Vec3d{1, 0, 0},
                         normalized(Vec3d{0.2, -0.9, 0.3}), normalized(Vec3d{0, -1, 1e-4})}) {
    for (const char* name : {"a.glb", "a.ply", "a.obj"})
      ASSERT_TRUE(export_scene(wall_scene(), up, folder_ / name).ok());
    const auto glb = shown_positions(Glb(folder_ / "a.glb"));
    const auto ply = ply_positions(folder_ / "a.ply"), obj = obj_positions(folder_ / "a.obj");
    ASSERT_EQ(glb.size(), 18u);
    ASSERT_EQ(ply.size(), glb.size());
    ASSERT_EQ(obj.size(), glb.size());
    for (std::size_t v = 0; v < glb.size(); ++v) {
      EXPECT_NEAR(length(ply[v] - glb[v]), 0, 1e-5);
      EXPECT_NEAR(length(obj[v] - glb[v]), 0, 1e-5);
    }
  }
}

TEST_F(Export, ZUpIsTurnedExactly) {
  ASSERT_TRUE(export_scene(wall_scene(), kUp, folder_ / "a.ply").ok());
  for (const Vec3d p : ply_positions(folder_ / "a.ply")) {
    EXPECT_EQ(p.y, 2);  // the wall lies at z = 2
    EXPECT_EQ(std::abs(p.z), 0.25);
  }
}

TEST_F(Export, TheSameSceneGivesTheSameBytes) {
  for (const char* name : {"a.glb", "b.glb"})
    ASSERT_TRUE(export_scene(wall_scene(), kUp, folder_ / name).ok());
  EXPECT_EQ(*read_file(folder_ / "a.glb"), *read_file(folder_ / "b.glb"));
}

TEST_F(Export, WhatCannotBeExportedIsAnError) {
  const auto cause = [&](const DecodedScene& scene, const char* name = "a.glb", Vec3d up = kUp) {
    const Status status = export_scene(scene, up, folder_ / name);
    EXPECT_FALSE(status.ok());
    return status.ok() ? "ok" : cause_name(status.error().cause);
  };
  EXPECT_STREQ(cause(wall_scene(), "a.stl"), "unsupported");
  EXPECT_STREQ(cause(wall_scene(), "a"), "unsupported");
  EXPECT_STREQ(cause({}), "empty");
  EXPECT_STREQ(cause(wall_scene(), "a.glb", {0, 0, 0}), "invalid");
  EXPECT_STREQ(cause(wall_scene(), "a.glb", {0, std::nan(""), 0}), "invalid");
  DecodedScene broken = wall_scene();
  broken.textures.erase(StreamId{9});
  EXPECT_STREQ(cause(broken), "invalid");
  broken = wall_scene();
  broken.views.pop_back();
  EXPECT_STREQ(cause(broken), "invalid");
  broken = wall_scene();
  broken.views[2].atlas_rect.width = 59;
  EXPECT_STREQ(cause(broken), "invalid");
  Mesh mesh = test::grid({0, 0, 2}, {1, 0, 0}, {0, 1, 0}, 1, 1);
  mesh.positions[1].y = std::numeric_limits<float>::quiet_NaN();
  broken.chunks = {chunk_of(mesh, {kNone, kNone})};
  EXPECT_STREQ(cause(broken), "invalid");
  mesh = test::grid({0, 0, 2}, {1, 0, 0}, {0, 1, 0}, 1, 1);
  mesh.triangles[1][2] = 4;
  broken.chunks = {chunk_of(mesh, {kNone, kNone})};
  EXPECT_STREQ(cause(broken), "invalid");
  EXPECT_THAT(files(), IsEmpty());
}

TEST_F(Export, AMissingFolderIsAnErrorOfIo) {
  for (const char* name : {"a.glb", "a.ply", "a.obj"}) {
    const Status status = export_scene(wall_scene(), kUp, folder_ / "none" / name);
    ASSERT_FALSE(status.ok());
    EXPECT_EQ(status.error().cause, Error::Cause::io);
    EXPECT_NE(status.error().message.find(name[2] == 'o' ? "none" : name), std::string::npos);
  }
  EXPECT_THAT(files(), IsEmpty());
}

/// Files may hold so many bytes only: writing more fails, as on a full disk.
class FileSizeLimit {
 public:
  explicit FileSizeLimit(rlim_t bytes) {
    before_ = std::signal(SIGXFSZ, SIG_IGN);
    getrlimit(RLIMIT_FSIZE, &limit_);
    const rlimit small{bytes, limit_.rlim_max};
    setrlimit(RLIMIT_FSIZE, &small);
  }
  ~FileSizeLimit() {
    setrlimit(RLIMIT_FSIZE, &limit_);
    std::signal(SIGXFSZ, before_);
  }
  FileSizeLimit(const FileSizeLimit&) = delete;
  FileSizeLimit& operator=(const FileSizeLimit&) = delete;

 private:
  rlimit limit_{};
  void (*before_)(int) = nullptr;
};

TEST_F(Export, AFullDiskLeavesNothingBehind) {
  DecodedScene scene;
  const Mesh grid = test::grid({0, 0, 2}, {1, 0, 0}, {0, 1, 0}, 60, 60);
  scene.chunks = {chunk_of(grid, std::vector<std::uint32_t>(grid.triangles.size(), 0))};
  scene.views = {view_of(0, 0, {0, 0, 8, 8})};
  scene.textures[StreamId{0}] = std::make_shared<ImageRgb>(8, 8);
  for (const char* name : {"a.glb", "a.ply", "a.obj"}) {
    Status status;
    {
      // The picture and the materials of the OBJ fit, its geometry does not.
      const FileSizeLimit limit(20000);
      status = export_scene(scene, kUp, folder_ / name);
    }
    ASSERT_FALSE(status.ok()) << name;
    EXPECT_EQ(status.error().cause, Error::Cause::io);
    EXPECT_THAT(files(), IsEmpty()) << name;
  }
}

}  // namespace
}  // namespace mr::model
