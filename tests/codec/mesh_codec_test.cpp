#include "mr/codec/mesh_codec.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <random>
#include <set>

#include "support/meshes.h"
#include "support/seal.h"

namespace mr::codec {
namespace {

using test::grid;
using Key = std::array<Vec3f, 3>;

/// A triangle's corners, the smallest first, in the same winding.
Key key_of(const Mesh& mesh, std::size_t t) {
  Key key = {mesh.corner(t, 0), mesh.corner(t, 1), mesh.corner(t, 2)};
  std::rotate(key.begin(), std::min_element(key.begin(), key.end()), key.end());
  return key;
}

/// What a mesh means, whatever the order of its triangles and vertices.
std::multimap<Key, ViewId> content(const Mesh& mesh) {
  std::multimap<Key, ViewId> out;
  const auto views = triangle_views(mesh);
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) out.emplace(key_of(mesh, t), views[t]);
  return out;
}

Mesh one_view(Mesh mesh, ViewId view = ViewId{3}) {
  mesh.views = {{0, static_cast<std::uint32_t>(mesh.triangles.size()), view}};
  return mesh;
}

Mesh snapped(const Mesh& mesh, const Lattice& lattice = {}) {
  auto out = snap_to_lattice(mesh, lattice);
  EXPECT_TRUE(out) << out.error().message;
  return std::move(*out);
}

/// A bumpy surface of about 2 n² triangles, on the lattice, textured by one view.
Mesh surface(int n, const Lattice& lattice = {}, unsigned seed = 1) {
  return snapped(one_view(grid({0, 0, 1}, {1.28f, 0, 0}, {0, 1.28f, 0}, n, n, 0.01f, seed)),
                 lattice);
}

/// Labels by blocks of the plane, every `every`-th triangle without view.
void label_in_blocks(Mesh& mesh, int views, std::size_t every = 0) {
  std::vector<ViewId> labels(mesh.triangles.size());
  for (std::size_t t = 0; t < labels.size(); ++t) {
    const Vec3f c = mesh.centroid(t);
    const int block = static_cast<int>(c.x * 8) + 8 * static_cast<int>(c.y * 8);
    labels[t] = ViewId{10 * static_cast<std::uint32_t>(((block % views) + views) % views) + 5};
    if (every != 0 && t % every == 0) labels[t] = kNoView;
  }
  set_triangle_views(mesh, labels);
}

EncodedChunk encoded(const Mesh& mesh, int speed = 5, const Lattice& lattice = {}) {
  const Chunk chunk{{{{1, -2, 3}, SensorId{7}}, 1, 42}, 0.25f, mesh};
  auto out = encode_chunk(chunk, lattice, speed);
  EXPECT_TRUE(out) << out.error().message;
  return out ? *out : EncodedChunk{};
}

Mesh decoded(const EncodedChunk& chunk, const Lattice& lattice = {}) {
  auto out = decode_chunk(chunk, lattice);
  EXPECT_TRUE(out) << out.error().message;
  return out ? out->mesh : Mesh{};
}

Error::Cause cause_of(const Result<EncodedChunk>& result) {
  EXPECT_FALSE(result);
  return result ? Error::Cause::io : result.error().cause;
}

// ---- snapping ----

TEST(SnapToLattice, WeldsAndDropsWhatHasNoArea) {
  Mesh mesh;
  mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1.0001f, 0, 0}, {0.5f, 0, 0}, {9, 9, 9}};
  mesh.triangles = {{0, 1, 2}, {0, 3, 2}, {1, 3, 2}, {0, 4, 1}, {2, 0, 1}, {0, 2, 1}};
  mesh.views = {{0, 2, ViewId{1}}, {2, 4, ViewId{2}}};
  const Mesh out = snapped(mesh);
  EXPECT_EQ(out.positions.size(), 3u) << "unused and doubled vertices go";
  ASSERT_EQ(out.triangles.size(), 2u) << "one each way round stays";
  EXPECT_EQ(out.views, (std::vector<ViewRun>{{0, 1, ViewId{1}}, {1, 1, ViewId{2}}}));
}

TEST(SnapToLattice, IsIdempotentAndWithinHalfAStep) {
  const Mesh mesh = grid({-3, 2, 1}, {2, 0, 0.3f}, {0, 2, 0.1f}, 20, 20, 0.01f);
  const Mesh once = snapped(mesh);
  EXPECT_TRUE(once.views.empty()) << "not labelled before, not labelled after";
  EXPECT_EQ(snapped(once), once);
  ASSERT_EQ(once.triangles.size(), mesh.triangles.size());
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    for (int c = 0; c < 3; ++c)
      EXPECT_LE(length(once.corner(t, c) - mesh.corner(t, c)), 0.00049f * 1.7321f);
}

TEST(SnapToLattice, RefusesWhatWouldCrashDraco) {
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  constexpr float kInf = std::numeric_limits<float>::infinity();
  for (const float bad : {kNan, kInf, -kInf, 513.0f, -513.0f, 1e30f, 512.0f}) {
    Mesh mesh = surface(4);
    mesh.positions[7].y = bad;
    const auto out = snap_to_lattice(mesh, {});
    ASSERT_FALSE(out) << bad;
    EXPECT_EQ(out.error().cause, Error::Cause::invalid);
    EXPECT_EQ(cause_of(encode_chunk({{}, 0, mesh}, {}, 5)), Error::Cause::invalid) << bad;
  }
}

// ---- round trips ----

TEST(MeshCodec, GeometryAndWindingSurviveAtEverySpeed) {
  const Mesh mesh = surface(30);
  for (int speed = 0; speed <= 10; ++speed) {
    const EncodedChunk chunk = encoded(mesh, speed);
    EXPECT_EQ(chunk.views, std::vector{ViewId{3}});
    const auto back = decode_chunk(chunk, {});
    ASSERT_TRUE(back) << back.error().message;
    EXPECT_EQ(back->key, chunk.key);
    EXPECT_EQ(back->error_m, 0.25f);
    EXPECT_EQ(content(back->mesh), content(mesh));
    EXPECT_EQ(back->mesh.positions.size(), mesh.positions.size());
  }
}

TEST(MeshCodec, SameMeshGivesTheSameBytes) {
  Mesh mesh = surface(20);
  label_in_blocks(mesh, 3);
  EXPECT_EQ(encoded(mesh), encoded(mesh));
}

TEST(MeshCodec, NeighboursMeetInTheSameFloats) {
  const Mesh whole =
      snapped(one_view(grid({-1, -1, 0.7f}, {2, 0, 0.4f}, {0, 2, -0.3f}, 40, 40, 0.015f, 5)));
  std::vector<std::uint8_t> left(whole.triangles.size()), right(left);
  for (std::size_t t = 0; t < left.size(); ++t) {
    left[t] = whole.centroid(t).x < 0;
    right[t] = !left[t];
  }
  const Mesh a = select_triangles(whole, left), b = select_triangles(whole, right);
  const std::set<Vec3f> in_a(a.positions.begin(), a.positions.end());
  std::set<Vec3f> border;
  for (const Vec3f& p : b.positions)
    if (in_a.contains(p)) border.insert(p);
  ASSERT_GE(border.size(), 41u);
  for (int speed = 0; speed <= 10; ++speed) {
    const Mesh da = decoded(encoded(a, speed)), db = decoded(encoded(b, 10 - speed));
    const std::set<Vec3f> pa(da.positions.begin(), da.positions.end());
    const std::set<Vec3f> pb(db.positions.begin(), db.positions.end());
    for (const Vec3f& p : border) EXPECT_TRUE(pa.contains(p) && pb.contains(p)) << speed;
  }
}

TEST(MeshCodec, CodingAgainDoesNotDrift) {
  Mesh mesh = surface(25);
  label_in_blocks(mesh, 4, 9);
  const auto first = content(mesh);
  for (int round = 0; round < 6; ++round) mesh = decoded(encoded(mesh, 2 * round));
  EXPECT_EQ(content(mesh), first);
}

TEST(MeshCodec, LabelsSurvivePerTriangle) {
  for (const int views : {1, 2, 5, 60}) {
    for (const std::size_t every : {0u, 7u}) {
      Mesh mesh = surface(24);
      label_in_blocks(mesh, views, every);
      for (const int speed : {0, 4, 5, 6, 7, 10}) {
        const EncodedChunk chunk = encoded(mesh, speed);
        EXPECT_EQ(chunk.views.size(), static_cast<std::size_t>(views));
        const Mesh back = decoded(chunk);
        EXPECT_EQ(content(back), content(mesh)) << views << " views, speed " << speed;
        EXPECT_EQ(back.views, mesh.views) << "sorted by view, the same counts";
        EXPECT_EQ(back.positions.size(), mesh.positions.size()) << "welded across labels";
      }
    }
  }
}

TEST(MeshCodec, MarksOfGuessesStayWithTheirTriangles) {
  for (const int views : {1, 4}) {
    Chunk chunk{{}, 0.001f, surface(40)};
    if (views > 1) label_in_blocks(chunk.mesh, views);
    const auto is_guessed = [](const Mesh& mesh, std::size_t t) {
      const Vec3f c = mesh.centroid(t);
      return c.x > 0.5f && c.x < 0.6f && c.y < 0.9f;
    };
    for (std::size_t t = 0; t < chunk.mesh.triangles.size(); ++t)
      chunk.guessed.push_back(is_guessed(chunk.mesh, t));
    const auto coded = encode_chunk(chunk, {}, 5);
    ASSERT_TRUE(coded) << coded.error().message;
    EXPECT_FALSE(coded->guessed.empty());
    const auto decoded = decode_chunk(*coded, {});
    ASSERT_TRUE(decoded) << decoded.error().message;
    ASSERT_EQ(decoded->guessed.size(), decoded->mesh.triangles.size());
    for (std::size_t t = 0; t < decoded->guessed.size(); ++t)
      EXPECT_EQ(decoded->guessed[t] != 0, is_guessed(decoded->mesh, t)) << t;

    EncodedChunk wrong = *coded;
    wrong.guessed = {{wrong.triangles - 1, 2}};
    EXPECT_FALSE(decode_chunk(wrong, {}));
    chunk.guessed.pop_back();
    EXPECT_FALSE(encode_chunk(chunk, {}, 5));
  }
}

TEST(MeshCodec, NoViewAtAllNeedsNoLabels) {
  const Mesh mesh = one_view(surface(10), kNoView);
  const EncodedChunk chunk = encoded(mesh);
  EXPECT_TRUE(chunk.views.empty());
  EXPECT_EQ(content(decoded(chunk)), content(mesh));
}

TEST(MeshCodec, LabelsCostLittle) {
  Mesh mesh = surface(50);
  const auto plain = encoded(mesh).payload.size();
  label_in_blocks(mesh, 2);
  EXPECT_LT(static_cast<double>(encoded(mesh).payload.size()), 1.10 * static_cast<double>(plain));
}

TEST(MeshCodec, EverySurfaceThatIsNoManifold) {
  Mesh fan;  // five triangles on one edge, three more at one of its ends
  fan.positions = {{0, 0, 0}, {0, 0, 1}};
  for (int i = 0; i < 11; ++i)
    fan.positions.push_back({std::cos(0.5f * i), std::sin(0.5f * i), 0.25f * (i % 3)});
  for (std::uint32_t i = 2; i < 7; ++i) fan.triangles.push_back({0, 1, i});
  for (std::uint32_t i = 7; i < 12; ++i) fan.triangles.push_back({0, i, i + 1});
  const Mesh hourglass = [] {  // two boxes that share one corner
    Mesh m = test::box({0, 0, 0}, {1, 1, 1});
    append(m, test::box({1, 1, 1}, {2, 2, 2}));
    return m;
  }();
  Mesh sheet = grid({0, 0, 0}, {1, 0, 0}, {0, 1, 0}, 4, 4);  // both sides of one sheet
  for (std::size_t t = 0; t < 32; ++t)
    sheet.triangles.push_back(
        {sheet.triangles[t][0], sheet.triangles[t][2], sheet.triangles[t][1]});
  for (const Mesh& shape : {fan, hourglass, sheet})
    for (const int speed : {0, 5, 10}) {
      Mesh mesh = snapped(one_view(shape));
      std::vector<ViewId> labels(mesh.triangles.size());
      for (std::size_t t = 0; t < labels.size(); ++t) labels[t] = static_cast<ViewId>(t % 3);
      for (const bool labelled : {false, true}) {
        if (labelled) set_triangle_views(mesh, labels);
        const Mesh back = decoded(encoded(mesh, speed));
        EXPECT_EQ(content(back), content(mesh));
        EXPECT_EQ(back.positions.size(), mesh.positions.size());
      }
    }
}

TEST(MeshCodec, TrianglesTwiceAreKept) {
  Mesh mesh = surface(3);
  mesh.triangles.push_back(mesh.triangles[4]);
  mesh = one_view(mesh);
  EXPECT_EQ(content(decoded(encoded(mesh))), content(mesh));
}

TEST(MeshCodec, RandomTriangleSoups) {
  std::mt19937 random(11);
  for (int round = 0; round < 60; ++round) {
    Mesh soup;
    const unsigned vertices = 4 + random() % 12, triangles = 1 + random() % 60;
    for (unsigned v = 0; v < vertices; ++v)
      soup.positions.push_back({0.01f * static_cast<float>(random() % 200),
                                0.01f * static_cast<float>(random() % 200),
                                0.01f * static_cast<float>(random() % 200)});
    for (unsigned t = 0; t < triangles; ++t)
      soup.triangles.push_back({static_cast<std::uint32_t>(random() % vertices),
                                static_cast<std::uint32_t>(random() % vertices),
                                static_cast<std::uint32_t>(random() % vertices)});
    Mesh mesh = snapped(soup);
    if (mesh.empty()) continue;
    std::vector<ViewId> labels(mesh.triangles.size());
    for (ViewId& label : labels)
      label = random() % 4 == 3 ? kNoView : static_cast<ViewId>(random() % 3);
    set_triangle_views(mesh, labels);
    EXPECT_EQ(content(decoded(encoded(mesh, round % 11))), content(mesh)) << round;
  }
}

TEST(MeshCodec, OneTriangle) {
  Mesh mesh;
  mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  mesh.triangles = {{0, 1, 2}};
  mesh = snapped(one_view(mesh));
  for (int speed = 0; speed <= 10; ++speed)
    EXPECT_EQ(content(decoded(encoded(mesh, speed))), content(mesh));
}

TEST(MeshCodec, OtherLattices) {
  for (const int step_exp : {-9, -10, -11})
    for (const Vec3d origin : {Vec3d{}, Vec3d{12.5, -300.25, 7}, Vec3d{1000, 0, -2000}}) {
      const Lattice lattice{origin, step_exp};
      const Vec3f at = vec_cast<float>(origin);
      Mesh mesh = snapped(
          one_view(grid(at + Vec3f{0.1f, 0.2f, 0.3f}, {1, 0, 0.2f}, {0, 1, 0.1f}, 15, 15, 0.01f)),
          lattice);
      label_in_blocks(mesh, 3);
      const EncodedChunk chunk = encoded(mesh, 5, lattice);
      EXPECT_EQ(content(decoded(chunk, lattice)), content(mesh));
    }
}

TEST(MeshCodec, TheWholeCubeCanBeUsed) {
  const Lattice lattice{{3, -5, 8}, -10};
  const std::int32_t last = Lattice::kCells - 1;
  Mesh mesh;
  for (const Vec3i q :
       {Vec3i{0, 0, 0}, {last, 0, 0}, {0, last, last}, {last, last, last}, {5, 6, 7}})
    mesh.positions.push_back(lattice.position(q));
  mesh.triangles = {{0, 1, 2}, {1, 3, 2}, {0, 4, 1}};
  mesh = one_view(mesh);
  for (const int speed : {0, 5, 10})
    EXPECT_EQ(content(decoded(encoded(mesh, speed, lattice), lattice)), content(mesh));
}

TEST(MeshCodec, LabelsAreSensorsOrViewsOrNone) {
  Mesh by_view = surface(10);
  label_in_blocks(by_view, 3, 4);
  Mesh by_sensor = by_view, bare = by_view;
  std::vector<SensorId> sensors;
  for (const ViewId view : triangle_views(by_view)) sensors.push_back(sensor_of(view));
  set_triangle_sensors(by_sensor, sensors);
  clear_labels(bare);
  for (const Mesh& mesh : {by_view, by_sensor, bare}) {
    const EncodedChunk coded = encoded(mesh);
    EXPECT_EQ(coded.views.size(), mesh.views.empty() ? 0u : 3u);
    EXPECT_EQ(coded.sensors.size(), mesh.sensors.empty() ? 0u : 3u);
    const Mesh back = decoded(coded);
    EXPECT_EQ(back.views, mesh.views);
    EXPECT_EQ(back.sensors, mesh.sensors);
  }
}

// ---- colours ----

using Rgb = std::array<std::uint8_t, 3>;

Chunk background(int n) {
  Chunk chunk{{{{1, -2, 3}, kBackgroundSource}, 0, 1}, 0, surface(n)};
  clear_labels(chunk.mesh);
  std::mt19937 random(7);
  for (std::size_t v = 0; v < chunk.mesh.positions.size(); ++v)
    chunk.colors.push_back({static_cast<std::uint8_t>(random()), static_cast<std::uint8_t>(v),
                            static_cast<std::uint8_t>(random() % 2 * 255)});
  return chunk;
}

std::map<Vec3f, Rgb> colors_by_place(const Chunk& chunk) {
  std::map<Vec3f, Rgb> out;
  for (std::size_t v = 0; v < chunk.colors.size(); ++v)
    out[chunk.mesh.positions[v]] = chunk.colors[v];
  return out;
}

TEST(MeshCodec, ColoursOfABackgroundSurviveExactly) {
  const Chunk chunk = background(20);
  for (int speed = 0; speed <= 10; ++speed) {
    const auto coded = encode_chunk(chunk, {}, speed);
    ASSERT_TRUE(coded) << coded.error().message;
    EXPECT_TRUE(coded->views.empty());
    const auto back = decode_chunk(*coded, {});
    ASSERT_TRUE(back) << back.error().message;
    EXPECT_EQ(back->key, chunk.key);
    EXPECT_EQ(content(back->mesh), content(chunk.mesh));
    ASSERT_EQ(back->colors.size(), back->mesh.positions.size());
    EXPECT_EQ(colors_by_place(*back), colors_by_place(chunk)) << "speed " << speed;
  }
}

TEST(MeshCodec, VerticesOfABackgroundThatManyMeetKeepTheirColour) {
  Mesh hourglass = test::box({0, 0, 0}, {1, 1, 1});  // Draco doubles the corner they share
  append(hourglass, test::box({1, 1, 1}, {2, 2, 2}));
  Chunk chunk{{{{}, kBackgroundSource}, 0, 1}, 0, snapped(hourglass)};
  for (std::size_t v = 0; v < chunk.mesh.positions.size(); ++v)
    chunk.colors.push_back({static_cast<std::uint8_t>(17 * v), 200, 3});
  const auto coded = encode_chunk(chunk, {}, 5);
  ASSERT_TRUE(coded);
  const auto back = decode_chunk(*coded, {});
  ASSERT_TRUE(back) << back.error().message;
  EXPECT_EQ(back->mesh.positions.size(), chunk.mesh.positions.size());
  EXPECT_EQ(colors_by_place(*back), colors_by_place(chunk));
}

TEST(MeshCodec, ColoursAreForBackgroundsOnly) {
  const Chunk good = background(6);
  Chunk bad = good;
  bad.key.id.source = SensorId{3};
  EXPECT_EQ(cause_of(encode_chunk(bad, {}, 5)), Error::Cause::invalid);
  bad = good;
  bad.colors.pop_back();
  EXPECT_EQ(cause_of(encode_chunk(bad, {}, 5)), Error::Cause::invalid);
  bad = good;
  bad.mesh = one_view(bad.mesh, ViewId{3});
  EXPECT_EQ(cause_of(encode_chunk(bad, {}, 5)), Error::Cause::invalid);
  auto coded = encode_chunk(good, {}, 5);
  ASSERT_TRUE(coded);
  coded->key.id.source = kMergedSource;
  EXPECT_FALSE(decode_chunk(*coded, {})) << "COLOR where a label should be";
  coded->key.id.source = kBackgroundSource;
  coded->views = {ViewId{1}};
  EXPECT_FALSE(decode_chunk(*coded, {}));
  EncodedChunk plain = encoded(one_view(surface(6), kNoView));
  plain.key.id.source = kBackgroundSource;
  EXPECT_FALSE(decode_chunk(plain, {})) << "no colours";
  Mesh labelled = surface(6);
  label_in_blocks(labelled, 3, 4);
  plain = encoded(labelled);
  plain.key.id.source = kBackgroundSource, plain.views.clear();
  EXPECT_FALSE(decode_chunk(plain, {})) << "a label where COLOR should be";
}

// ---- refusals ----

TEST(MeshCodec, RefusesWhatItCannotCode) {
  EXPECT_EQ(cause_of(encode_chunk({}, {}, 5)), Error::Cause::empty);
  Mesh mesh = surface(4);
  mesh.positions[3].x += 0.0001f;
  EXPECT_EQ(cause_of(encode_chunk({{}, 0, mesh}, {}, 5)), Error::Cause::invalid) << "not snapped";
  mesh = surface(4);
  mesh.sensors = {{0, static_cast<std::uint32_t>(mesh.triangles.size()), SensorId{3}}};
  EXPECT_EQ(cause_of(encode_chunk({{}, 0, mesh}, {}, 5)), Error::Cause::invalid) << "two kinds";
  mesh = surface(4);
  mesh.triangles[0][1] = mesh.triangles[0][0];
  EXPECT_EQ(cause_of(encode_chunk({{}, 0, mesh}, {}, 5)), Error::Cause::invalid) << "no area";
  mesh = surface(4);
  mesh.triangles[0][1] = 1000;
  EXPECT_EQ(cause_of(encode_chunk({{}, 0, mesh}, {}, 5)), Error::Cause::invalid) << "bad index";
  EXPECT_EQ(cause_of(encode_chunk({{}, 0, surface(4)}, {{}, -12}, 5)), Error::Cause::invalid);
  EXPECT_EQ(cause_of(encode_chunk({{}, 0, surface(4)}, {{0.0003, 0, 0}, -10}, 5)),
            Error::Cause::invalid)
      << "an origin between the steps";
}

TEST(MeshCodec, AtMost254Views) {
  for (const std::size_t count : {254u, 255u}) {
    Mesh mesh = surface(16);
    std::vector<ViewId> labels(mesh.triangles.size());
    for (std::size_t t = 0; t < labels.size(); ++t)
      labels[t] = t % 50 == 0 ? kNoView : static_cast<ViewId>(1000 * (t % count));
    set_triangle_views(mesh, labels);
    const auto chunk = encode_chunk({{}, 0, mesh}, {}, 5);
    if (count == 255) {
      EXPECT_EQ(cause_of(chunk), Error::Cause::invalid);
    } else {
      ASSERT_TRUE(chunk);
      EXPECT_EQ(content(decoded(*chunk)), content(mesh));
    }
  }
}

TEST(MeshCodec, PromisesAreChecked) {
  Mesh mesh = surface(10);
  label_in_blocks(mesh, 3);
  const EncodedChunk good = encoded(mesh);
  ASSERT_TRUE(decode_chunk(good, {}));
  const auto refuses = [&](auto&& change) {
    EncodedChunk bad = good;
    change(bad);
    return !decode_chunk(bad, {});
  };
  EXPECT_TRUE(refuses([](EncodedChunk& c) { ++c.triangles; }));
  EXPECT_TRUE(refuses([](EncodedChunk& c) { c.triangles = 0; }));
  EXPECT_TRUE(refuses([](EncodedChunk& c) { c.triangles = 0xFFFFFFFFu; }));
  EXPECT_TRUE(refuses([](EncodedChunk& c) { c.views.pop_back(); })) << "labels beyond the views";
  EXPECT_TRUE(refuses([](EncodedChunk& c) { std::swap(c.views[0], c.views[1]); }));
  EXPECT_TRUE(refuses([](EncodedChunk& c) { c.views[2] = kNoView; }));
  EXPECT_TRUE(refuses([](EncodedChunk& c) { c.payload = {}; }));
  EXPECT_TRUE(refuses([](EncodedChunk& c) { c.error_m = -1; }));
  EXPECT_TRUE(
      refuses([](EncodedChunk& c) { c.error_m = std::numeric_limits<float>::quiet_NaN(); }));
  EncodedChunk plain = encoded(surface(10));
  plain.views = {ViewId{1}, ViewId{2}};
  EXPECT_FALSE(decode_chunk(plain, {})) << "two views and no labels";
  EXPECT_FALSE(decode_chunk(good, {{0, 0, 0}, -9})) << "another lattice";
  EXPECT_FALSE(decode_chunk(good, {{100000, 0, 0}, -10})) << "an unusable lattice";
}

TEST(MeshCodec, EveryTruncationIsAnError) {
  Mesh mesh = surface(6);
  label_in_blocks(mesh, 2);
  const EncodedChunk good = encoded(mesh);
  for (std::size_t bytes = 0; bytes < good.payload.size(); ++bytes) {
    EncodedChunk cut = good;
    test::edit(cut.payload, [&](auto& payload) { payload.resize(bytes); });
    EXPECT_FALSE(decode_chunk(cut, {})) << bytes << " of " << good.payload.size();
  }
}

TEST(MeshCodec, CorruptionNeverCrashes) {
  std::mt19937 random(5);
  int survived = 0;
  for (const int speed : {0, 5, 10}) {
    Mesh mesh = surface(12);
    label_in_blocks(mesh, 3, 5);
    const EncodedChunk good = encoded(mesh, speed);
    for (int i = 0; i < 1500; ++i) {
      EncodedChunk bad = good;
      test::edit(bad.payload, [&](auto& payload) {
        for (int flips = 1 + static_cast<int>(random() % 4); flips > 0; --flips)
          payload[random() % payload.size()] ^= static_cast<std::byte>(1 + random() % 255);
      });
      const auto back = decode_chunk(bad, {});
      if (!back) continue;
      ++survived;
      EXPECT_EQ(back->mesh.triangles.size(), bad.triangles);
      for (const Vec3f& p : back->mesh.positions) EXPECT_EQ(Lattice{}.snap(p), p);
      for (const Triangle& t : back->mesh.triangles)
        for (const std::uint32_t v : t) ASSERT_LT(v, back->mesh.positions.size());
    }
  }
  EXPECT_GT(survived, 0) << "the loop reaches past the header";
}

}  // namespace
}  // namespace mr::codec
