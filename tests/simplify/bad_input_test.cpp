#include <gtest/gtest.h>

#include <functional>
#include <limits>
#include <numbers>
#include <string>

#include "mr/simplify/simplify.h"
#include "support/decimation.h"

namespace mr {
namespace {

using simplify::Simplified;
using simplify::Simplifier;
using simplify::SimplifyOptions;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInfinite = std::numeric_limits<float>::infinity();

struct Named {
  std::string name;
  Mesh mesh;
};

/// A bumpy patch: what is odd is added to it, so that there is something to decimate around.
Mesh patch() { return test::hills(20, 15, 0.05f, 0.004f); }

Mesh with(const std::vector<Vec3f>& positions, const std::vector<Triangle>& triangles) {
  Mesh out = patch();
  append(out, {positions, triangles, {}, {}});
  return out;
}
Mesh with_triangles(const std::vector<Triangle>& triangles) {
  Mesh out = patch();
  out.triangles.insert(out.triangles.end(), triangles.begin(), triangles.end());
  return out;
}

Mesh fan(std::uint32_t blades, bool closed) {
  Mesh out{{{0, 0, 0.1f}}, {}, {}, {}};
  for (std::uint32_t i = 0; i < blades; ++i) {
    const float turn =
        2 * std::numbers::pi_v<float> * static_cast<float>(i) / static_cast<float>(blades);
    out.positions.push_back({std::cos(turn), std::sin(turn), 0});
    const std::uint32_t next = i + 1 < blades ? i + 2 : closed ? 1 : 0;
    if (next != 0) out.triangles.push_back({0, i + 1, next});
  }
  return out;
}

Mesh moebius_strip() {
  constexpr std::uint32_t kAround = 120, kAcross = 6;
  Mesh out;
  for (std::uint32_t i = 0; i < kAround; ++i)
    for (std::uint32_t j = 0; j <= kAcross; ++j) {
      const float turn = 2 * std::numbers::pi_v<float> * static_cast<float>(i) / kAround;
      const float off = 0.3f * (static_cast<float>(j) / kAcross - 0.5f);
      const float radius = 1 + off * std::cos(turn / 2);
      out.positions.push_back(
          {radius * std::cos(turn), radius * std::sin(turn), off * std::sin(turn / 2)});
    }
  const auto at = [](std::uint32_t i, std::uint32_t j) {
    return i < kAround ? i * (kAcross + 1) + j : kAcross - j;  // the last joins the first reversed
  };
  for (std::uint32_t i = 0; i < kAround; ++i)
    for (std::uint32_t j = 0; j < kAcross; ++j) {
      out.triangles.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
      out.triangles.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
    }
  return out;
}

/// Every second triangle faces the other way.
Mesh wound_at_odds() {
  Mesh out = patch();
  for (std::size_t t = 0; t < out.triangles.size(); t += 2)
    std::swap(out.triangles[t][0], out.triangles[t][1]);
  return out;
}

/// Two patches that share one vertex.
Mesh bow_tie() {
  Mesh out = test::grid({0, 0, 0}, {1, 0, 0}, {0, 1, 0}, 10, 10);
  const Mesh other = test::grid({1, 1, 0}, {1, 0, 0}, {0, 1, 0}, 10, 10);
  const auto base = static_cast<std::uint32_t>(out.positions.size());
  append(out, other);
  for (Triangle& t : out.triangles)
    for (std::uint32_t& v : t)
      if (v == base) v = base - 1;
  return out;
}

/// Three half planes that meet along an edge of many vertices.
Mesh three_pages() {
  Mesh out;
  for (const Vec3f page : {Vec3f{1, 0, 0}, Vec3f{-0.5f, 0.9f, 0}, Vec3f{-0.5f, -0.9f, 0}})
    append(out, test::grid({}, {0, 0, 1}, page, 20, 12));
  return kit::weld(out);
}

std::vector<Named> odd_meshes() {
  const Mesh whole = patch();
  const std::vector<Triangle>& t = whole.triangles;
  Mesh doubled = whole, flipped_double = whole, soup;
  append(doubled, whole), append(flipped_double, whole);
  for (std::size_t i = 0; i < t.size(); ++i) {
    doubled.triangles[t.size() + i] = t[i];
    flipped_double.triangles[t.size() + i] = {t[i][2], t[i][1], t[i][0]};
  }
  std::mt19937 random(3);
  soup.positions = whole.positions;
  const auto any = [&] { return static_cast<std::uint32_t>(random() % whole.positions.size()); };
  for (int i = 0; i < 2000; ++i) soup.triangles.push_back({any(), any(), any()});
  Mesh one_place = whole, one_line = whole, tiny = whole, wide = whole;
  for (Vec3f& p : one_place.positions) p = {1, 2, 3};
  for (Vec3f& p : one_line.positions) p = {p.x + p.y, 0, 0};
  for (Vec3f& p : tiny.positions) p = p * 1e-25f;
  for (Vec3f& p : wide.positions) p = p * 9e5f;
  return {
      {"nothing", {}},
      {"vertices alone", {{{0, 0, 0}, {1, 0, 0}}, {}, {}}},
      {"one triangle", {{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}}, {}}},
      {"two triangles", {{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}}, {{0, 1, 2}, {1, 3, 2}}, {}}},
      {"a tetrahedron",
       {{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}},
        {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {0, 3, 2}},
        {}}},
      {"a third triangle at an edge", with_triangles({{30, 31, 200}, {100, 101, 250}})},
      {"pages of a book", three_pages()},
      {"a bow tie", bow_tie()},
      {"a triangle twice", with_triangles({t[100], {t[200][1], t[200][2], t[200][0]}})},
      {"a triangle and its back", with_triangles({{t[100][2], t[100][1], t[100][0]}})},
      {"all twice", doubled},
      {"all with their backs", flipped_double},
      {"corners named twice", with_triangles({{5, 5, 6}, {7, 8, 8}, {9, 9, 9}})},
      {"no area", with({{3, 0, 0}, {4, 0, 0}, {5, 0, 0}, {5, 0, 0}}, {{0, 1, 2}, {1, 2, 3}})},
      {"all at one place", one_place},
      {"all on one line", one_line},
      {"tiny", tiny},
      {"wide", wide},
      {"a fan", fan(1000, true)},
      {"an open fan", fan(1000, false)},
      {"a Moebius strip", moebius_strip()},
      {"wound at odds", wound_at_odds()},
      {"soup", soup},
  };
}

std::size_t corners_that_differ(const Mesh& mesh) {
  return static_cast<std::size_t>(std::count_if(
      mesh.triangles.begin(), mesh.triangles.end(),
      [](const Triangle& t) { return t[0] != t[1] && t[1] != t[2] && t[2] != t[0]; }));
}

void expect_valid(const Simplified& out, const Mesh& in) {
  EXPECT_TRUE(test::is_sound(out.mesh));
  EXPECT_TRUE(test::are_runs_good(out.mesh));
  EXPECT_TRUE(std::isfinite(out.error_m));
  EXPECT_GE(out.error_m, 0);
  EXPECT_LE(out.mesh.triangles.size(), corners_that_differ(in));
  EXPECT_LE(out.mesh.positions.size(), in.positions.size());
  EXPECT_LE(kit::count_nonmanifold_edges(out.mesh), kit::count_nonmanifold_edges(in));
}

TEST(SimplifyBadInput, OddMeshesGiveMeshes) {
  for (const Named& odd : odd_meshes()) {
    SCOPED_TRACE(odd.name);
    const Mesh& mesh = odd.mesh;
    for (const std::size_t target :
         {mesh.triangles.size() / 2, mesh.triangles.size() / 10, std::size_t{0}}) {
      const auto out = simplify::simplify(mesh, {.triangles = target});
      ASSERT_TRUE(out.ok());
      if (mesh.triangles.size() > target) expect_valid(*out, mesh);
    }
    const auto by_error = simplify::simplify(mesh, {.error_m = 0.01f});
    ASSERT_TRUE(by_error.ok());
    if (!mesh.empty()) expect_valid(*by_error, mesh);
  }
}

TEST(SimplifyBadInput, OddMeshesWithViewsChunksAndWeights) {
  for (const Named& odd : odd_meshes()) {
    SCOPED_TRACE(odd.name);
    Mesh mesh = odd.mesh;
    std::vector<SensorId> views;
    std::vector<std::uint32_t> chunks;
    for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
      views.push_back(t / 37 % 3 == 2 ? kNoSensor : SensorId{t / 37 % 3});
      chunks.push_back(t / 150 % 3 == 2 ? 0xFFFFFFFFu : t / 150);
    }
    set_triangle_sensors(mesh, views);
    std::vector<float> weights;
    for (std::size_t v = 0; v < mesh.positions.size(); ++v)
      weights.push_back(v % 5 == 0 ? 1e6f : 1e-20f);
    const std::size_t counts[] = {mesh.triangles.size(), mesh.triangles.size() / 3, 0};
    const auto levels = Simplifier().run(mesh, counts, {.weights = weights, .chunks = chunks});
    ASSERT_TRUE(levels.ok());
    for (const Simplified& level : *levels) {
      expect_valid(level, mesh);
      EXPECT_EQ(level.chunks.size(), level.mesh.triangles.size());
      for (const std::uint32_t chunk : level.chunks)
        EXPECT_NE(std::find(chunks.begin(), chunks.end(), chunk), chunks.end());
    }
  }
}

TEST(SimplifyBadInput, TargetsThatAreMetReturnTheInput) {
  for (const Named& odd : odd_meshes()) {
    SCOPED_TRACE(odd.name);
    for (const std::size_t more : {0, 1, 1000000}) {
      const auto out =
          simplify::simplify(odd.mesh, {.triangles = odd.mesh.triangles.size() + more});
      ASSERT_TRUE(out.ok());
      EXPECT_TRUE(out->mesh == odd.mesh);
      EXPECT_EQ(out->error_m, 0);
    }
  }
}

void expect_invalid(const Result<Simplified>& out) {
  ASSERT_FALSE(out.ok());
  EXPECT_EQ(out.error().cause, Error::Cause::invalid);
  EXPECT_EQ(out.error().message.rfind("simplify: ", 0), 0u);
  EXPECT_EQ(out.error().message.find('\n'), std::string::npos);
  EXPECT_LT(out.error().message.size(), 120u);
}

TEST(SimplifyBadInput, PositionsThatAreNoPlaces) {
  for (const float bad : {kNan, kInfinite, -kInfinite, 1e30f, -1e30f, 1.1e6f})
    for (int axis = 0; axis < 3; ++axis)
      for (const std::size_t target : {0u, 1000000u}) {
        Mesh mesh = patch();
        mesh.positions[77][axis] = bad;
        expect_invalid(simplify::simplify(mesh, {.triangles = target}));
      }
}

TEST(SimplifyBadInput, IndicesOutOfRange) {
  for (const std::size_t target : {0u, 1000000u})
    for (std::size_t corner = 0; corner < 3; ++corner)
      for (const std::uint32_t beyond : {0u, 1u, 0x7FFFFFFFu}) {
        Mesh mesh = patch();
        const auto vertices = static_cast<std::uint32_t>(mesh.positions.size());
        mesh.triangles[50][corner] = vertices + beyond;
        expect_invalid(simplify::simplify(mesh, {.triangles = target}));
      }
  expect_invalid(simplify::simplify({{}, {{0, 0, 0}}, {}, {}}, {}));
  Mesh last = patch();
  last.triangles[50] = {0xFFFFFFFFu, 0xFFFFFFFFu, 0xFFFFFFFFu};
  expect_invalid(simplify::simplify(last, {}));
}

TEST(SimplifyBadInput, RunsThatDoNotCover) {
  const auto count = static_cast<std::uint32_t>(patch().triangles.size());
  for (const std::vector<SensorRun>& runs : std::vector<std::vector<SensorRun>>{
           {{0, count - 1, SensorId{0}}},
           {{0, count + 1, SensorId{0}}},
           {{1, count - 1, SensorId{0}}},
           {{0, 10, SensorId{0}}, {11, count - 11, SensorId{1}}},
           {{0, 10, SensorId{0}}, {5, count - 5, SensorId{1}}},
           {{0, 0xFFFFFFFFu, SensorId{0}}, {0xFFFFFFFFu, count + 1, SensorId{1}}},
           {{0, count, SensorId{0}},
            {count, 0x80000000u, SensorId{1}},
            {count + 0x80000000u, 0x80000000u, SensorId{2}}}}) {
    Mesh mesh = patch();
    mesh.sensors = runs;
    expect_invalid(simplify::simplify(mesh, {}));
  }
}

TEST(SimplifyBadInput, OptionsThatDoNotFit) {
  const Mesh mesh = patch();
  const std::vector<float> few_weights(mesh.positions.size() - 1, 1.0f),
      many_weights(mesh.positions.size() + 1, 1.0f);
  const std::vector<std::uint32_t> few_chunks(mesh.triangles.size() - 1),
      many_chunks(mesh.triangles.size() + 1);
  expect_invalid(simplify::simplify(mesh, {.weights = few_weights}));
  expect_invalid(simplify::simplify(mesh, {.weights = many_weights}));
  expect_invalid(simplify::simplify(mesh, {.chunks = few_chunks}));
  expect_invalid(simplify::simplify(mesh, {.chunks = many_chunks}));
  for (const float bad : {kNan, -1.0f, 0.0f, kInfinite, -kInfinite}) {
    std::vector<float> weights(mesh.positions.size(), 1.0f);
    weights[33] = bad;
    expect_invalid(simplify::simplify(mesh, {.weights = weights}));
  }
  for (const float bad : {kNan, -0.001f, -kInfinite}) {
    expect_invalid(simplify::simplify(mesh, {.error_m = bad}));
    expect_invalid(simplify::simplify(mesh, {.border_error_m = bad}));
  }
  const std::size_t rising[] = {100, 200};
  const auto levels = Simplifier().run(mesh, rising, {});
  ASSERT_FALSE(levels.ok());
  EXPECT_EQ(levels.error().cause, Error::Cause::invalid);
}

TEST(SimplifyBadInput, ASimplifierGoesOnAfterAnError) {
  Simplifier simplifier;
  const auto before = simplifier.run(patch(), {.triangles = 100});
  Mesh bad = patch();
  bad.positions[5].x = kNan;
  expect_invalid(simplifier.run(bad, {.triangles = 100}));
  for (const Named& odd : odd_meshes())
    ASSERT_TRUE(simplifier.run(odd.mesh, {.triangles = 3}).ok());
  const auto after = simplifier.run(patch(), {.triangles = 100});
  EXPECT_TRUE(after->mesh == before->mesh);
}

TEST(SimplifyBadInput, NoErrorAllowedOrAnyErrorAllowed) {
  const Mesh mesh = patch();
  const auto none = simplify::simplify(mesh, {.error_m = 0});
  ASSERT_TRUE(none.ok());
  EXPECT_LE(test::two_sided_rms_m(none->mesh, mesh), 1e-6);
  const auto any = simplify::simplify(mesh, {.triangles = 0});
  ASSERT_TRUE(any.ok());
  expect_valid(*any, mesh);
  EXPECT_GE(any->mesh.triangles.size(), 1u);
  EXPECT_LT(any->mesh.triangles.size(), 20u);
}

}  // namespace
}  // namespace mr
