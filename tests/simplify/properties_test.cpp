#include <gtest/gtest.h>

#include <chrono>
#include <random>

#include "mr/core/parallel.h"
#include "mr/simplify/simplify.h"
#include "mr/simplify/working_mesh.h"
#include "support/decimation.h"

namespace mr {
namespace {

using simplify::Simplified;
using simplify::Simplifier;
using simplify::SimplifyOptions;

constexpr float kLeastQuality = 0.05f;  // as collapser.cpp promises

Simplified made(const Mesh& mesh, const SimplifyOptions& options) {
  auto out = simplify::simplify(mesh, options);
  EXPECT_TRUE(out.ok());
  return *std::move(out);
}
Simplified by_ratio(const Mesh& mesh, double ratio) {
  return made(mesh, {.triangles = simplify::triangles_at(mesh, ratio)});
}

void expect_within_1_percent(std::size_t count, std::size_t target) {
  EXPECT_NEAR(static_cast<double>(count), static_cast<double>(target),
              std::max(1.0, 0.01 * static_cast<double>(target)));
}

void expect_same(const std::vector<Simplified>& a, const std::vector<Simplified>& b) {
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    EXPECT_TRUE(a[i].mesh == b[i].mesh) << i;
    EXPECT_TRUE(a[i].chunks == b[i].chunks) << i;
    EXPECT_EQ(a[i].error_m, b[i].error_m) << i;
    EXPECT_EQ(a[i].errors_m, b[i].errors_m) << i;
  }
}

// A wide scene of many ranges: bands of rows.
constexpr int kColumns = 300, kRows = 240;
constexpr float kCell_m = 0.01f;

/// [rows + 1] 1 where triangles reach from range to range, and two rows around.
std::vector<std::uint8_t> seam_rows(const Mesh& mesh) {
  const auto range = [](std::uint32_t v) { return v / simplify::WorkingMesh::kRange; };
  std::vector<std::uint8_t> out(kRows + 1, 0);
  for (const auto& [a, b, c] : mesh.triangles)
    if (range(a) != range(b) || range(b) != range(c))
      for (const std::uint32_t v : {a, b, c}) {
        const int row = static_cast<int>(v) / (kColumns + 1);
        for (int r = std::max(0, row - 2); r <= std::min(kRows, row + 2); ++r)
          out[static_cast<std::size_t>(r)] = 1;
      }
  return out;
}

struct SeamError {
  double seam_m = 0, inside_m = 0;
};
/// Heights of the surface over the vertices of the input, and of its own, against the hills.
struct HillErrors {
  SeamError over_input, at_vertices;
};
HillErrors hill_errors(const Mesh& small, const Mesh& input,
                       const std::vector<std::uint8_t>& rows) {
  const Mesh* meshes[] = {&small};
  const kit::RayScene rays(meshes);
  std::vector<double> over[2], at[2];
  const auto is_seam = [&](Vec3f p) {
    return rows[static_cast<std::size_t>(std::clamp(std::lround(p.y / kCell_m), 0l, long{kRows}))];
  };
  for (const Vec3f p : input.positions)
    if (const auto hit = rays.first_hit({p.x, p.y, 5}, {0, 0, -1}, 0, 10))
      over[is_seam(p)].push_back(5 - hit->distance - test::hills_m(p.x, p.y));
  for (const Vec3f p : small.positions) at[is_seam(p)].push_back(p.z - test::hills_m(p.x, p.y));
  EXPECT_GT(over[0].size() + over[1].size(), input.positions.size() * 97 / 100);
  return {{test::rms(over[1]), test::rms(over[0])}, {test::rms(at[1]), test::rms(at[0])}};
}

TEST(SimplifySeams, ErrNoMoreThanTheInside) {
  const Mesh mesh = test::hills(kColumns, kRows, kCell_m, 0.003f);
  const std::vector<std::uint8_t> rows = seam_rows(mesh);
  ASSERT_GT(std::count(rows.begin(), rows.end(), 1), 8 * 5);
  const HillErrors errors = hill_errors(by_ratio(mesh, 0.1).mesh, mesh, rows);
  EXPECT_LT(errors.over_input.seam_m, 1.1 * errors.over_input.inside_m);
  EXPECT_LT(errors.at_vertices.seam_m, 1.1 * errors.at_vertices.inside_m);
}

TEST(SimplifySeams, KeepAsManyVerticesAsTheInside) {
  const Mesh mesh = test::hills(kColumns, kRows, kCell_m, 0.003f);
  const std::vector<std::uint8_t> rows = seam_rows(mesh);
  const Simplified small = by_ratio(mesh, 0.1);
  double seam = 0;
  for (const Vec3f p : small.mesh.positions)
    seam += rows[static_cast<std::size_t>(std::clamp(std::lround(p.y / kCell_m), 0l, long{kRows}))];
  const double share = seam / static_cast<double>(small.mesh.positions.size());
  const double expected =
      static_cast<double>(std::count(rows.begin(), rows.end(), 1)) / (kRows + 1);
  EXPECT_NEAR(share, expected, 0.1 * expected);
}

TEST(SimplifySeams, VerticesInAnyOrderGiveTheSameQuality) {
  const Mesh mesh = test::hills(kColumns, kRows, kCell_m, 0.003f);
  const std::vector<std::uint8_t> rows(kRows + 1, 0);
  const Simplified ordered = by_ratio(mesh, 0.1);
  const Simplified shuffled = by_ratio(test::with_shuffled_vertices(mesh, 5), 0.1);
  expect_within_1_percent(shuffled.mesh.triangles.size(), ordered.mesh.triangles.size());
  const HillErrors a = hill_errors(ordered.mesh, mesh, rows);
  const HillErrors b = hill_errors(shuffled.mesh, mesh, rows);
  EXPECT_NEAR(b.over_input.inside_m, a.over_input.inside_m, 0.05 * a.over_input.inside_m);
  EXPECT_NEAR(b.at_vertices.inside_m, a.at_vertices.inside_m, 0.05 * a.at_vertices.inside_m);
}

/// Three views in straight stripes along y; lines at x = 1/3 and 2/3 of `nx` cells.
Mesh striped_hills(int nx, int ny, float cell_m, float noise_m) {
  Mesh mesh = test::hills(nx, ny, cell_m, noise_m);
  const float stripe_m = cell_m * static_cast<float>(nx) / 3;
  std::vector<SensorId> views;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    views.push_back(static_cast<SensorId>(mesh.centroid(t).x / stripe_m));
  set_triangle_sensors(mesh, views);
  return mesh;
}

/// One result for each kind of option.
std::vector<Simplified> results_of_all_kinds(Simplifier& simplifier) {
  const Mesh plain = test::hills(240, 180, 0.0125f, 0.003f);
  const Mesh striped = striped_hills(240, 180, 0.0125f, 0.003f);
  const Mesh shuffled = test::with_shuffled_vertices(plain, 2);
  const std::vector<std::uint32_t> chunks = test::chunks_by_cube(striped, 0.5f);
  std::vector<float> weights;
  std::mt19937 random(4);
  for (std::size_t v = 0; v < plain.positions.size(); ++v)
    weights.push_back(0.5f + static_cast<float>(random() % 16));
  const std::size_t tenth = simplify::triangles_at(plain, 0.1);
  std::vector<Simplified> out;
  const auto add = [&](const Mesh& mesh, const SimplifyOptions& options) {
    auto result = simplifier.run(mesh, options);
    ASSERT_TRUE(result.ok());
    out.push_back(*std::move(result));
  };
  add(plain, {.triangles = tenth});
  add(striped, {.triangles = tenth});
  add(striped, {.triangles = tenth, .chunks = chunks});
  add(plain, {.triangles = tenth, .weights = weights});
  add(shuffled, {.triangles = tenth, .weights = weights});
  add(plain, {.error_m = 0.004f});
  const std::size_t levels[] = {plain.triangles.size(), tenth * 5, tenth, tenth / 2};
  auto several = simplifier.run(striped, levels, {.chunks = chunks});
  EXPECT_TRUE(several.ok());
  for (Simplified& level : *several) out.push_back(std::move(level));
  return out;
}

TEST(SimplifyDeterminism, SameBytesOnAnyNumberOfThreads) {
  std::vector<std::vector<Simplified>> all;
  for (const int threads : {1, 2, 3, 8})
    Arena(threads).run([&] {
      Simplifier simplifier;
      all.push_back(results_of_all_kinds(simplifier));
    });
  for (const auto& results : all) expect_same(results, all[0]);
}

TEST(SimplifyDeterminism, WhatWasDoneBeforeLeavesNoTrace) {
  Simplifier fresh, used;
  const Mesh before = test::sphere({1, 2, 3}, 0.7f, 90);
  const std::vector<std::uint32_t> chunks = test::chunks_by_cube(before, 0.4f);
  ASSERT_TRUE(used.run(before, {.triangles = 500, .chunks = chunks}).ok());
  const auto first = results_of_all_kinds(fresh);
  expect_same(results_of_all_kinds(used), first);
  expect_same(results_of_all_kinds(fresh), first);
}

TEST(SimplifyTargets, CountsAreMetWithin1Percent) {
  for (const Mesh& mesh : {test::hills(200, 150, 0.02f, 0.004f), test::hills(200, 150, 0.02f, 0),
                           test::grid({}, {2, 0, 0}, {0, 1.5f, 0}, 200, 150),
                           test::sphere({}, 1, 100), striped_hills(150, 100, 0.02f, 0.002f)})
    for (const double ratio : {0.5, 0.25, 0.1, 0.05, 0.02}) {
      SCOPED_TRACE(testing::Message() << mesh.triangles.size() << " x " << ratio);
      const std::size_t target = simplify::triangles_at(mesh, ratio);
      const Simplified small = made(mesh, {.triangles = target});
      EXPECT_LE(small.mesh.triangles.size(), target);
      expect_within_1_percent(small.mesh.triangles.size(), target);
    }
}

TEST(SimplifyTargets, ErrorIsRespected) {
  const Mesh mesh = test::hills(120, 90, 0.025f, 0.002f);
  std::size_t before = mesh.triangles.size();
  for (const float error_m : {0.0005f, 0.001f, 0.002f, 0.005f}) {
    SCOPED_TRACE(error_m);
    const Simplified small = made(mesh, {.error_m = error_m});
    EXPECT_LE(small.error_m, 1.001f * error_m);
    ASSERT_EQ(small.errors_m.size(), small.mesh.positions.size());
    EXPECT_EQ(small.error_m, std::ranges::max(small.errors_m));
    EXPECT_LT(small.mesh.triangles.size(), before * 9 / 10);
    before = small.mesh.triangles.size();
    const std::vector<double> away_m = test::distances_m(mesh.positions, small.mesh);
    EXPECT_LT(*std::max_element(away_m.begin(), away_m.end()), 6 * error_m);
    EXPECT_LT(test::rms(away_m), error_m);
  }
}

TEST(SimplifyTargets, CountAndErrorStopAtTheFirst) {
  const Mesh mesh = test::hills(120, 90, 0.025f, 0.002f);
  const Simplified by_error = made(mesh, {.error_m = 0.002f});
  const std::size_t count = by_error.mesh.triangles.size();
  const Simplified sooner = made(mesh, {.triangles = 2 * count, .error_m = 0.002f});
  expect_within_1_percent(sooner.mesh.triangles.size(), 2 * count);
  const Simplified later = made(mesh, {.triangles = count / 2, .error_m = 0.002f});
  EXPECT_GT(later.mesh.triangles.size(), count / 2 * 3 / 2);
  EXPECT_LE(later.error_m, 1.001f * 0.002f);
}

TEST(SimplifyTargets, WhatIsFlatErrsNothing) {
  const Mesh mesh = test::grid({0, 0, 1}, {2, 0, 0}, {0, 1, 0}, 60, 30);
  const Simplified small = made(mesh, {.error_m = 0});
  EXPECT_LT(small.mesh.triangles.size(), mesh.triangles.size() / 100);
  EXPECT_EQ(small.error_m, 0);
  for (const Vec3f p : small.mesh.positions) EXPECT_EQ(p.z, 1);
  EXPECT_NEAR(surface_area_m2(small.mesh), 2, 1e-5);
}

TEST(SimplifyTargets, NoTimeStillGivesASurface) {
  const Mesh mesh = striped_hills(240, 180, 0.0125f, 0.003f);
  for (const auto time : {std::chrono::nanoseconds(0), std::chrono::nanoseconds(-1),
                          std::chrono::nanoseconds(3'000'000)}) {
    const Simplified small = made(mesh, {.triangles = 1000, .time = time});
    EXPECT_TRUE(test::is_sound(small.mesh));
    EXPECT_TRUE(test::are_runs_good(small.mesh));
    EXPECT_LE(small.mesh.triangles.size(), mesh.triangles.size());
    EXPECT_EQ(test::euler_characteristic(small.mesh), 1);
    EXPECT_NEAR(surface_area_m2(small.mesh), surface_area_m2(mesh), 0.1 * surface_area_m2(mesh));
  }
}

TEST(SimplifyTargets, TimeEnoughChangesNothing) {
  const Mesh mesh = test::hills(200, 150, 0.02f, 0.004f);
  const SimplifyOptions options{.triangles = 6000, .error_m = 0.01f};
  const Simplified untimed = made(mesh, options);
  for (const std::chrono::nanoseconds time :
       {std::chrono::nanoseconds(std::chrono::hours(1)), std::chrono::nanoseconds::max()}) {
    SimplifyOptions timed = options;
    timed.time = time;
    expect_same({made(mesh, timed)}, {untimed});
  }
}

double area_from_above_m2(const Mesh& mesh, SensorId view) {
  const std::vector<SensorId> views = triangle_sensors(mesh);
  double out = 0;
  for (std::size_t t = 0; t < views.size(); ++t)
    if (views[t] == view) out += mesh.area_normal(t).z / 2;
  return out;
}

TEST(SimplifyRuns, StripesKeepTheirPlaces) {
  const Mesh mesh = striped_hills(150, 100, 0.02f, 0.002f);
  for (const double ratio : {0.5, 0.1, 0.03}) {
    SCOPED_TRACE(ratio);
    const Mesh small = by_ratio(mesh, ratio).mesh;
    EXPECT_TRUE(test::are_runs_good(small));
    ASSERT_EQ(small.sensors.size(), 3u);
    const std::vector<SensorId> views = triangle_sensors(small);
    std::map<test::Edge, std::set<SensorId>> views_at;
    for (std::size_t t = 0; t < views.size(); ++t) {
      EXPECT_EQ(views[t], static_cast<SensorId>(small.centroid(t).x));
      const Triangle& c = small.triangles[t];
      for (std::size_t i = 0; i < 3; ++i)
        views_at[std::minmax(c[i], c[(i + 1) % 3])].insert(views[t]);
    }
    double line_m = 0;
    for (const auto& [edge, sides] : views_at) {
      if (sides.size() == 1) continue;
      const Vec3f a = small.positions[edge.first], b = small.positions[edge.second];
      EXPECT_NEAR(a.x, std::round(a.x), 1e-5);
      EXPECT_NEAR(b.x, a.x, 1e-5);
      line_m += std::abs(b.y - a.y);
    }
    EXPECT_NEAR(line_m, 2 * 2.0, 1e-4);
    for (const SensorId view : {SensorId{0}, SensorId{1}, SensorId{2}})
      EXPECT_NEAR(area_from_above_m2(small, view), area_from_above_m2(mesh, view), 0.002);
  }
}

TEST(SimplifyWeights, WhatMattersErrsLess) {
  const Mesh mesh = test::hills(200, 120, 0.015f, 0);
  std::vector<float> weights;
  for (const Vec3f p : mesh.positions) weights.push_back(p.x < 1.5f ? 16.0f : 1.0f);
  const auto half = [](Vec3f p) { return p.x < 1.5f ? 0 : 1; };
  const auto errors_m = [&](const Mesh& small) {
    const std::vector<double> away_m = test::distances_m(mesh.positions, small);
    std::vector<double> out[2];
    for (std::size_t v = 0; v < away_m.size(); ++v)
      out[half(mesh.positions[v])].push_back(away_m[v]);
    return std::array{test::rms(out[0]), test::rms(out[1])};
  };
  const std::size_t target = simplify::triangles_at(mesh, 0.15);
  const Mesh weighted = made(mesh, {.triangles = target, .weights = weights}).mesh;
  const Mesh plain = made(mesh, {.triangles = target}).mesh;
  expect_within_1_percent(weighted.triangles.size(), target);
  const auto with = errors_m(weighted), without = errors_m(plain);
  EXPECT_NEAR(without[0], without[1], 0.15 * without[1]);
  EXPECT_LT(with[0], 0.5 * with[1]);
  EXPECT_LT(with[0], 0.8 * without[0]);
  std::array<std::size_t, 2> triangles{};
  for (std::size_t t = 0; t < weighted.triangles.size(); ++t)
    ++triangles[half(weighted.centroid(t))];
  EXPECT_GT(triangles[0], 2 * triangles[1]);
}

TEST(SimplifyWeights, TightenTheErrorThatIsAllowed) {
  const Mesh mesh = test::hills(100, 80, 0.02f, 0.003f);
  const std::vector<float> fours(mesh.positions.size(), 4.0f);
  const auto half = made(mesh, {.error_m = 0.002f}).mesh.triangles.size();
  const auto fine = made(mesh, {.error_m = 0.004f, .weights = fours}).mesh.triangles.size();
  EXPECT_NEAR(static_cast<double>(fine), static_cast<double>(half),
              0.03 * static_cast<double>(half));
}

TEST(SimplifyWeights, OneWeightForAllChangesNothing) {
  const Mesh mesh = test::hills(100, 80, 0.02f, 0.003f);
  const std::vector<float> ones(mesh.positions.size(), 1.0f), fours(mesh.positions.size(), 4.0f);
  const Simplified plain = by_ratio(mesh, 0.1);
  const std::size_t target = simplify::triangles_at(mesh, 0.1);
  expect_same({made(mesh, {.triangles = target, .weights = ones})}, {plain});
  expect_within_1_percent(made(mesh, {.triangles = target, .weights = fours}).mesh.triangles.size(),
                          target);
}

/// Hills with three holes, and beside them a ball and a flat patch.
Mesh several_parts() {
  Mesh hills = test::hills(150, 100, 0.02f, 0.001f);
  std::vector<std::uint8_t> keep;
  for (std::size_t t = 0; t < hills.triangles.size(); ++t) {
    const Vec3f c = hills.centroid(t);
    bool hole = false;
    for (const Vec2f at : {Vec2f{0.6f, 0.7f}, Vec2f{1.5f, 1.2f}, Vec2f{2.4f, 0.5f}})
      hole |= std::hypot(c.x - at.x, c.y - at.y) < 0.2f;
    keep.push_back(!hole);
  }
  Mesh mesh = select_triangles(hills, keep);
  append(mesh, test::sphere({5, 0, 0}, 0.5f, 30));
  append(mesh, test::grid({0, 4, 0}, {1, 0, 0}, {0, 0.8f, 0}, 40, 30));
  return mesh;
}

TEST(SimplifyShape, PartsAndHolesStay) {
  const Mesh mesh = several_parts();
  ASSERT_EQ(test::euler_characteristic(mesh), 1 - 3 + 2 + 1);
  ASSERT_EQ(test::count_border_loops(mesh), 5u);
  for (const double ratio : {0.5, 0.1, 0.02, 0.001}) {
    SCOPED_TRACE(ratio);
    const Mesh small = by_ratio(mesh, ratio).mesh;
    EXPECT_EQ(test::euler_characteristic(small), test::euler_characteristic(mesh));
    EXPECT_EQ(test::count_border_loops(small), 5u);
    EXPECT_EQ(kit::components(small).area_m2.size(), 3u);
    EXPECT_EQ(kit::count_nonmanifold_edges(small), 0u);
    EXPECT_EQ(kit::count_boundary_edges(kit::weld(small)), kit::count_boundary_edges(small));
  }
}

TEST(SimplifyShape, NothingFlips) {
  const Mesh mesh = test::hills(150, 100, 0.02f, 0.002f);
  for (const double ratio : {0.5, 0.2, 0.1, 0.05, 0.02}) {
    const Mesh small = by_ratio(mesh, ratio).mesh;
    for (std::size_t t = 0; t < small.triangles.size(); ++t)
      EXPECT_GT(small.area_normal(t).z, 0) << ratio << ' ' << t;
  }
}

TEST(SimplifyShape, NoSlivers) {
  for (const Mesh& mesh :
       {test::hills(200, 150, 0.02f, 0.002f, 3), test::hills(200, 150, 0.02f, 0),
        test::grid({}, {4, 0, 0}, {0, 3, 0}, 200, 150), test::hills(200, 150, 0.02f, 0.006f, 4)}) {
    ASSERT_GT(test::worst_quality(mesh), 0.5f);
    for (const double ratio : {0.5, 0.25, 0.1, 0.05, 0.02, 0.005})
      EXPECT_GE(test::worst_quality(by_ratio(mesh, ratio).mesh), 0.99f * kLeastQuality) << ratio;
  }
}

TEST(SimplifyShape, BordersStayWithinTheError) {
  const Mesh mesh = several_parts();
  for (const double ratio : {0.3, 0.1, 0.03}) {
    SCOPED_TRACE(ratio);
    const Simplified small = by_ratio(mesh, ratio);
    std::vector<std::pair<Vec3d, Vec3d>> lines;
    for (const auto& [edge, uses] : test::edges_of(small.mesh))
      if (uses == 1)
        lines.push_back({vec_cast<double>(small.mesh.positions[edge.first]),
                         vec_cast<double>(small.mesh.positions[edge.second])});
    double worst_m = 0;
    for (const auto& [edge, uses] : test::edges_of(mesh)) {
      if (uses != 1) continue;
      const Vec3d p = vec_cast<double>(mesh.positions[edge.first]);
      double least_m = 1;
      for (const auto& [a, b] : lines)
        least_m = std::min(least_m, length(p - kit::nearest_on_segment(p, a, b)));
      worst_m = std::max(worst_m, least_m);
    }
    EXPECT_LT(worst_m, 3 * small.error_m + 1e-5);
  }
}

}  // namespace
}  // namespace mr
