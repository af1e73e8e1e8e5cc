#include "mr/eval/geometry_error.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <numbers>
#include <random>

#include "core/temp_dir.h"
#include "mr/core/parallel.h"
#include "mr/eval/read_mesh.h"
#include "mr/kit/raycast.h"
#include "mr/kit/topology.h"
#include "mr/synth/truth.h"
#include "support/meshes.h"

namespace mr::eval {
namespace {

const GeometryConfig kConfig{.voxel_m = 0.01, .samples = 40'000, .seed = 1};

/// A wall of 2 x 2 m in the plane z, facing up.
Mesh wall(float z = 0, int cells = 40) {
  return test::grid({-1, -1, z}, {2, 0, 0}, {0, 2, 0}, cells, cells);
}

Mesh both(Mesh a, const Mesh& b) {
  append(a, b);
  return a;
}

Mesh flipped(Mesh mesh) {
  for (Triangle& t : mesh.triangles) std::swap(t[1], t[2]);
  return mesh;
}

/// The triangles whose centre is outside the square |x|, |y| < half.
Mesh with_hole(const Mesh& mesh, float half) {
  std::vector<std::uint8_t> keep(mesh.triangles.size());
  for (std::size_t t = 0; t < keep.size(); ++t) {
    const Vec3f c = mesh.centroid(t);
    keep[t] = std::max(std::abs(c.x), std::abs(c.y)) > half;
  }
  return select_triangles(mesh, keep);
}

/// A camera straight above, which sees the square |x|, |y| < 1 of the plane z = 0 from 2 m.
SensorFrustum frustum_above() {
  SensorFrustum frustum;
  frustum.depth_camera.width = frustum.depth_camera.height = 200;
  frustum.depth_camera.fx = frustum.depth_camera.fy = 200;
  frustum.depth_camera.cx = frustum.depth_camera.cy = 99.5;
  frustum.T_world_depth = look_at({0, 0, 2}, {0, 0, 0}, {0, 1, 0});
  return frustum;
}

GeometryError errors_of(const Mesh& mesh, const Mesh& reference,
                        std::span<const SensorFrustum> frustums = {},
                        const GeometryConfig& config = kConfig) {
  const auto error = geometry_error(mesh, reference, frustums, config);
  EXPECT_TRUE(error) << (error ? "" : error.error().message);
  return error ? *error : GeometryError{};
}

TEST(SampleSurface, SpreadsByAreaOverTrianglesOfAnySize) {
  // One half of the wall in two triangles, the other in 3200.
  Mesh mesh = test::grid({-1, -1, 0}, {1, 0, 0}, {0, 2, 0}, 1, 1);
  append(mesh, test::grid({0, -1, 0}, {1, 0, 0}, {0, 2, 0}, 40, 40));
  const auto samples = sample_surface(mesh, 40'000, 1);
  ASSERT_EQ(samples.size(), 40'000u);
  int quarter[4][4] = {};
  for (const SurfaceSample& s : samples) {
    EXPECT_EQ(s.normal, (Vec3f{0, 0, 1}));
    ASSERT_LE(std::max(std::abs(s.position.x), std::abs(s.position.y)), 1);
    ++quarter[std::min(3, int((s.position.x + 1) * 2))][std::min(3, int((s.position.y + 1) * 2))];
  }
  for (const auto& row : quarter)
    for (const int count : row) EXPECT_NEAR(count, 2500, 60);
}

TEST(SampleSurface, IsTheSameForTheSameSeedAndSkipsWhatHasNoArea) {
  Mesh mesh = test::sphere({0, 0, 1}, 0.5f, 10);
  mesh.triangles.insert(mesh.triangles.begin() + 5, {3, 3, 4});
  mesh.triangles.push_back({7, 7, 7});
  const auto a = sample_surface(mesh, 1000, 1), b = sample_surface(mesh, 1000, 1);
  const auto c = sample_surface(mesh, 1000, 2);
  int differ = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    EXPECT_EQ(a[i].position, b[i].position);
    EXPECT_NEAR(length(a[i].normal), 1, 1e-6);
    differ += a[i].position != c[i].position;
  }
  EXPECT_GT(differ, 990);
  EXPECT_TRUE(sample_surface({}, 1000, 1).empty());
  EXPECT_TRUE(sample_surface({{{0, 0, 0}}, {{0, 0, 0}}, {}, {}}, 1000, 1).empty());
}

TEST(SurfaceDistance, OfASheetThatIsOffIsTheOffset) {
  const SurfaceDistance d = surface_distance(wall(0.007f), wall(), 20'000, 1);
  EXPECT_NEAR(d.mean_mm, 7, 1e-4);
  EXPECT_NEAR(d.rms_mm, 7, 1e-4);
  EXPECT_NEAR(d.p95_mm, 7, 1e-4);
  EXPECT_NEAR(d.max_mm, 7, 1e-4);
}

TEST(SurfaceDistance, OfATiltedSheetFollowsFromTheSlope) {
  // Height x / 100 over 0 <= x <= 1: mean 1/2, RMS 1/sqrt 3, 95 in 100 and most of the rise.
  const Mesh tilted = test::grid({0, -1, 0}, {1, 0, 0.01f}, {0, 2, 0}, 30, 30);
  const double slope = std::atan(0.01), rise_mm = 10 * std::cos(slope);
  const SurfaceDistance d =
      surface_distance(tilted, test::grid({-2, -2, 0}, {4, 0, 0}, {0, 4, 0}, 7, 7), 20'000, 1);
  EXPECT_NEAR(d.mean_mm, 5, 0.02);
  EXPECT_NEAR(d.rms_mm, 10 / std::numbers::sqrt3, 0.02);
  EXPECT_NEAR(d.p95_mm, 9.5, 0.03);
  EXPECT_NEAR(d.max_mm, 10, 0.01);
  // The other way the foot lies on the tilted sheet: the rise times the cosine.
  const SurfaceDistance back = surface_distance(
      test::grid({0.2f, -0.5f, 0}, {0.6f, 0, 0}, {0, 1, 0}, 9, 9), tilted, 20'000, 1);
  EXPECT_NEAR(back.mean_mm, 0.5 * rise_mm, 0.02);
}

TEST(SurfaceDistance, OfTwoSpheresFollowsFromTheirCentres) {
  // Every point of one lies | |p - c| - r | from the other: over the sphere that is offset * cos.
  constexpr double kOffset_mm = 8;
  const Mesh a = test::sphere({0, 0, 0}, 0.5f, 120), b = test::sphere({0, 0, 0.008f}, 0.5f, 120);
  const SurfaceDistance d = surface_distance(a, b, 50'000, 1);
  EXPECT_NEAR(d.mean_mm, kOffset_mm / 2, 0.05);
  EXPECT_NEAR(d.rms_mm, kOffset_mm / std::numbers::sqrt3, 0.05);
  EXPECT_NEAR(d.max_mm, kOffset_mm, 0.1);
}

TEST(SurfaceDistance, AgreesWithLookingAtEveryTriangle) {
  const Mesh rough = test::grid({-1, -1, 0}, {2, 0, 0.2f}, {0, 2, 0}, 20, 20, 0.05f, 3);
  const Mesh ball = test::sphere({0.1f, 0, 0.2f}, 0.6f, 9);
  double sum = 0, squares = 0, most = 0;
  const auto samples = sample_surface(ball, 300, 4);
  for (const SurfaceSample& s : samples) {
    double best = 1e30;
    const Vec3d p = vec_cast<double>(s.position);
    for (std::size_t t = 0; t < rough.triangles.size(); ++t) {
      const Vec3d a = vec_cast<double>(rough.corner(t, 0)),
                  b = vec_cast<double>(rough.corner(t, 1)),
                  c = vec_cast<double>(rough.corner(t, 2));
      const Vec3d u = b - a, v = c - a, w = p - a;
      const double uu = dot(u, u), uv = dot(u, v), vv = dot(v, v), det = uu * vv - uv * uv;
      const double x = (vv * dot(w, u) - uv * dot(w, v)) / det;
      const double y = (uu * dot(w, v) - uv * dot(w, u)) / det;
      if (x >= 0 && y >= 0 && x + y <= 1) best = std::min(best, length(w - u * x - v * y));
      for (const auto& [from, side] : {std::pair(a, u), std::pair(a, v), std::pair(b, c - b)}) {
        const double at = std::clamp(dot(p - from, side) / dot(side, side), 0.0, 1.0);
        best = std::min(best, length(p - from - side * at));
      }
    }
    sum += best, squares += best * best, most = std::max(most, best);
  }
  const SurfaceDistance d = surface_distance(ball, rough, 300, 4);
  EXPECT_NEAR(d.mean_mm, sum / 300 * 1000, 1e-9);
  EXPECT_NEAR(d.rms_mm, std::sqrt(squares / 300) * 1000, 1e-9);
  EXPECT_NEAR(d.max_mm, most * 1000, 1e-9);
}

TEST(DuplicateRatio, CountsSheetsThatLieCloseAndFaceAlike) {
  EXPECT_EQ(duplicate_ratio(wall(), kConfig), 0);
  EXPECT_EQ(duplicate_ratio(both(wall(), wall(0.015f)), kConfig), 1);
  EXPECT_EQ(duplicate_ratio(both(wall(), wall(0.05f)), kConfig), 0);
  EXPECT_EQ(duplicate_ratio(both(wall(0.01f), flipped(wall())), kConfig), 0);  // a thin board
  EXPECT_EQ(duplicate_ratio(test::box({0, 0, 0}, {1, 1, 0.01f}), kConfig), 0);
  EXPECT_EQ(duplicate_ratio(test::sphere({0, 0, 0}, 0.02f, 40), kConfig), 0);
  EXPECT_EQ(
      duplicate_ratio(test::grid({-1, -1, 0}, {2, 0, 0}, {0, 2, 0}, 200, 200, 0.003f), kConfig), 0);
}

TEST(DuplicateRatio, IsTheShareOfTheAreaThatIsDoubled) {
  // A quarter of the wall lies twice: of 5 m² of surface 2 m² have a second sheet.
  const Mesh patch = test::grid({-1, -1, 0.02f}, {1, 0, 0}, {0, 1, 0}, 3, 3);
  EXPECT_NEAR(duplicate_ratio(both(wall(), patch), kConfig), 0.4, 0.005);
}

TEST(MissingRatio, IsTheShareOfTheReferenceThatLiesInAHole) {
  // 0.4 x 0.4 m of 4 m²; a voxel along its rim counts as found.
  const GeometryError e = errors_of(with_hole(wall(), 0.2f), wall());
  EXPECT_NEAR(e.missing_ratio, 0.38 * 0.38 / 4, 0.01 * 0.04);
  EXPECT_NEAR(e.from_reference.max_mm, 200, 3);
  EXPECT_LT(e.to_reference.max_mm, 1e-3);
  EXPECT_EQ(e.duplicate_ratio, 0);
}

TEST(MissingRatio, CountsOnlyWhatAnEyeSees) {
  const SensorFrustum frustum = frustum_above();
  // The sensor sees a quarter of a wall twice as wide; a hole outside that quarter does not count.
  const Mesh wide = test::grid({-2, -2, 0}, {4, 0, 0}, {0, 4, 0}, 80, 80);
  std::vector<std::uint8_t> keep(wide.triangles.size());
  for (std::size_t t = 0; t < keep.size(); ++t) keep[t] = wide.centroid(t).x < 1.2f;
  EXPECT_EQ(errors_of(select_triangles(wide, keep), wide, {&frustum, 1}).missing_ratio, 0);
  EXPECT_NEAR(errors_of(select_triangles(wide, keep), wide).missing_ratio, 0.79 / 4, 0.002);
  EXPECT_NEAR(errors_of(with_hole(wide, 0.5f), wide, {&frustum, 1}).missing_ratio, 0.98 * 0.98 / 4,
              0.004);
}

TEST(MissingRatio, LeavesOutWhatTheSceneDoesNotCapture) {
  GeometryConfig config = kConfig;
  config.captured = {{{1, 0, 0}, -0.5}, {{-1, 0, 0}, -0.5}};  // |x| <= 0.5
  const GeometryError e = errors_of(with_hole(wall(), 0.2f), wall(), {}, config);
  EXPECT_NEAR(e.seen_ratio, 0.5, 0.005);
  EXPECT_NEAR(e.missing_ratio, 0.38 * 0.38 / 2, 0.01 * 0.08);
  config.captured.push_back({{0, 0, 1}, 0.03});  // above the floor, where nothing is
  EXPECT_FALSE(geometry_error(wall(), wall(), {}, config));
}

TEST(SeenSamples, AreInThePictureWithinReachInFrontAndNotHidden) {
  const SensorFrustum frustum = frustum_above();
  const auto share = [&](const Mesh& mesh, std::span<const SensorFrustum> frustums, auto&& of) {
    const auto samples = sample_surface(mesh, 20'000, 1);
    const auto seen = seen_samples(mesh, samples, frustums, 0.01);
    int all = 0, good = 0;
    for (std::size_t i = 0; i < samples.size(); ++i)
      if (of(samples[i])) ++all, good += seen[i];
    return static_cast<double>(good) / all;
  };
  const auto every = [](const SurfaceSample&) { return true; };
  EXPECT_EQ(share(wall(), {&frustum, 1}, every), 1);
  EXPECT_EQ(share(flipped(wall()), {&frustum, 1}, every), 0);
  EXPECT_NEAR(share(test::grid({-2, -1, 0}, {4, 0, 0}, {0, 2, 0}, 9, 9), {&frustum, 1}, every), 0.5,
              0.01);
  SensorFrustum short_sighted = frustum;
  short_sighted.far_m = 1.9;
  EXPECT_EQ(share(wall(), {&short_sighted, 1}, every), 0);
  short_sighted.far_m = 5, short_sighted.near_m = 2.1;
  EXPECT_EQ(share(wall(), {&short_sighted, 1}, every), 0);
  // A shelf half way up hides what is twice as wide on the floor below, but not itself.
  const Mesh shelf =
      both(wall(), test::grid({-0.25f, -0.25f, 1}, {0.5f, 0, 0}, {0, 0.5f, 0}, 2, 2));
  const auto above = [](const SurfaceSample& s) { return s.position.z > 0.5f; };
  const auto below = [](const SurfaceSample& s) { return s.position.z < 0.5f; };
  EXPECT_EQ(share(shelf, {&frustum, 1}, above), 1);
  EXPECT_NEAR(share(shelf, {&frustum, 1}, below), 0.75, 0.01);
  SensorFrustum aside = frustum;
  aside.T_world_depth = look_at({0.9, 0, 2}, {0.9, 0, 0}, {0, 1, 0});
  const SensorFrustum two[] = {frustum, aside};
  EXPECT_GT(share(shelf, two, below), 0.85);
}

TEST(SeamGap, IsTheWidthBetweenBordersThatFaceEachOther) {
  const Mesh left = test::grid({0, 0, 0}, {1, 0, 0}, {0, 1, 0}, 33, 33);
  const auto right = [](float x, float z = 0) {
    return test::grid({x, 0, z}, {1, 0, 0}, {0, 1, 0}, 29, 31);
  };
  EXPECT_NEAR(seam_gap_p95_mm(both(left, right(1.012f)), 0.01), 12, 0.01);
  EXPECT_NEAR(seam_gap_p95_mm(both(left, right(1.03f)), 0.01), 30, 0.01);
  EXPECT_EQ(seam_gap_p95_mm(both(left, right(1.07f)), 0.01), 0);     // too wide
  EXPECT_EQ(seam_gap_p95_mm(left, 0.01), 0);                         // nothing faces it
  EXPECT_EQ(seam_gap_p95_mm(both(left, right(0.98f)), 0.01), 0);     // they overlap
  EXPECT_EQ(seam_gap_p95_mm(both(left, right(0, 0.02f)), 0.01), 0);  // one lies above the other
  EXPECT_EQ(seam_gap_p95_mm(both(left, flipped(right(1.012f))), 0.01), 0);  // turned over
  EXPECT_EQ(seam_gap_p95_mm({}, 0.01), 0);
}

TEST(SeamGap, IsFoundAlongASlitOfOneSurfaceButNotAroundAJaggedBorder) {
  // A slit 10 mm wide and 1 m long inside a wall of 10 mm cells.
  const Mesh fine = test::grid({-1, -0.5f, 0}, {2, 0, 0}, {0, 1, 0}, 200, 100);
  std::vector<std::uint8_t> keep(fine.triangles.size()), jagged(fine.triangles.size());
  for (std::size_t t = 0; t < keep.size(); ++t) {
    const Vec3f c = fine.centroid(t);
    keep[t] = c.y < 0 || c.y > 0.01f || std::abs(c.x) > 0.5f;
    jagged[t] = c.y < (std::fmod(c.x + 10, 0.02f) < 0.01f ? 0.0f : 0.01f);  // teeth of a cell each
  }
  EXPECT_NEAR(seam_gap_p95_mm(kit::weld(select_triangles(fine, keep)), 0.01), 10, 0.01);
  EXPECT_EQ(seam_gap_p95_mm(kit::weld(select_triangles(fine, jagged)), 0.01), 0);
}

TEST(Edges, AreMeasuredOnTheWeldedMesh) {
  const Mesh rectangle = test::grid({0, 0, 1}, {3, 0, 0}, {0, 2, 0}, 12, 7);
  EXPECT_NEAR(boundary_length_m(rectangle), 10, 1e-5);
  EXPECT_EQ(boundary_length_m(test::box({0, 0, 0}, {1, 2, 3})), 0);
  // Two halves with vertices of their own, joined where they meet; a fin stands on the joint.
  Mesh mesh = test::grid({0, 0, 0}, {1, 0, 0}, {0, 1, 0}, 1, 4);
  append(mesh, test::grid({1, 0, 0}, {1, 0, 0}, {0, 1, 0}, 1, 4));
  const GeometryError flat = errors_of(mesh, mesh);
  EXPECT_EQ(flat.components, 1u);
  EXPECT_EQ(flat.nonmanifold_edges, 0u);
  EXPECT_NEAR(flat.boundary_m, 6, 1e-5);
  append(mesh, test::grid({1, 0, 0}, {0, 0, 1}, {0, 1, 0}, 1, 4));
  append(mesh, test::sphere({5, 5, 5}, 0.1f, 4));
  const GeometryError finned = errors_of(mesh, mesh);
  EXPECT_EQ(finned.nonmanifold_edges, 4u);
  EXPECT_NEAR(finned.boundary_m, 6 + 3, 1e-5);
  EXPECT_EQ(finned.components, kit::components(kit::weld(mesh)).area_m2.size());
  EXPECT_EQ(errors_of(both(wall(), wall(1)), wall()).components, 2u);
}

TEST(GeometryErrors, EachMistakeMovesItsOwnFigure) {
  const Mesh truth = wall(0, 100);
  const GeometryError good = errors_of(truth, truth);
  EXPECT_LT(good.to_reference.max_mm, 1e-3);
  EXPECT_LT(good.from_reference.max_mm, 1e-3);
  EXPECT_EQ(good.duplicate_ratio, 0);
  EXPECT_EQ(good.missing_ratio, 0);
  EXPECT_EQ(good.components, 1u);
  EXPECT_NEAR(good.boundary_m, 8, 1e-4);

  const GeometryError hole = errors_of(with_hole(truth, 0.3f), truth);
  EXPECT_GT(hole.missing_ratio, 0.08);
  EXPECT_GT(hole.boundary_m, 10);
  EXPECT_LT(hole.to_reference.max_mm, 1e-3);
  EXPECT_EQ(hole.duplicate_ratio, 0);

  const GeometryError doubled = errors_of(both(truth, wall(0.008f)), truth);
  EXPECT_EQ(doubled.duplicate_ratio, 1);
  EXPECT_EQ(doubled.missing_ratio, 0);
  EXPECT_LT(doubled.from_reference.max_mm, 1e-3);
  EXPECT_NEAR(doubled.to_reference.mean_mm, 4, 0.1);

  const GeometryError off = errors_of(wall(0.007f, 100), truth);
  EXPECT_NEAR(off.to_reference.rms_mm, 7, 1e-3);
  EXPECT_NEAR(off.from_reference.rms_mm, 7, 1e-3);
  EXPECT_EQ(off.duplicate_ratio, 0);
  EXPECT_EQ(off.missing_ratio, 0);
  EXPECT_EQ(off.boundary_m, good.boundary_m);
}

TEST(GeometryErrors, WhatCannotBeMeasuredIsRefused) {
  const Mesh good = wall();
  Mesh lost = good, wrong = good;
  lost.positions[7].y = NAN;
  wrong.triangles[3][1] = 1'000'000;
  const auto cause = [&](const Mesh& mesh, const Mesh& reference,
                         std::span<const SensorFrustum> frustums = {}) {
    const auto error = geometry_error(mesh, reference, frustums, kConfig);
    EXPECT_FALSE(error);
    return error ? "" : cause_name(error.error().cause);
  };
  EXPECT_STREQ(cause({}, good), "empty");
  EXPECT_STREQ(cause(good, {}), "empty");
  EXPECT_STREQ(cause({good.positions, {{0, 0, 0}}, {}, {}}, good), "empty");
  EXPECT_STREQ(cause(lost, good), "invalid");
  EXPECT_STREQ(cause(good, lost), "invalid");
  EXPECT_STREQ(cause(wrong, good), "invalid");
  const SensorFrustum frustum = frustum_above();
  EXPECT_STREQ(cause(good, wall(3), {&frustum, 1}), "empty");  // behind the sensor
}

TEST(GeometryErrors, AreTheSameOnAnyNumberOfThreads) {
  const Mesh truth = test::grid({-1, -1, 0}, {2, 0, 0}, {0, 2, 0}, 60, 60, 0.004f, 1);
  Mesh mesh = with_hole(test::grid({-1, -1, 0}, {2, 0, 0}, {0, 2, 0}, 70, 70, 0.01f, 2), 0.3f);
  append(mesh, test::grid({0, -1, 0.01f}, {0.5f, 0, 0}, {0, 2, 0}, 20, 70, 0.01f, 3));
  const SensorFrustum frustum = frustum_above();
  GeometryError errors[2];
  double residuals[2];
  for (const int i : {0, 1})
    Arena(i == 0 ? 1 : 8).run([&] {
      errors[i] = errors_of(mesh, truth, {&frustum, 1});
      residuals[i] = residual_mm(mesh, truth, kConfig);
    });
  EXPECT_EQ(std::memcmp(&errors[0], &errors[1], sizeof errors[0]), 0);
  EXPECT_EQ(residuals[0], residuals[1]);
  EXPECT_GT(errors[0].duplicate_ratio, 0.1);
}

TEST(Residual, IsTheDistanceWhereBothSensorsSee) {
  EXPECT_NEAR(residual_mm(wall(), wall(0.007f), kConfig), 7, 1e-3);
  // They share a stripe of a quarter; beside it each goes on alone, which does not count.
  const Mesh shifted = test::grid({0.5f, -1, 0.004f}, {2, 0, 0}, {0, 2, 0}, 40, 40);
  EXPECT_NEAR(residual_mm(wall(), shifted, kConfig), 4, 1e-3);
  EXPECT_EQ(residual_mm(wall(), wall(0.06f), kConfig), -1);            // too far apart
  EXPECT_EQ(residual_mm(wall(), flipped(wall(0.007f)), kConfig), -1);  // front and back
  EXPECT_EQ(residual_mm(wall(), test::grid({0.995f, -1, 0}, {2, 0, 0}, {0, 2, 0}, 4, 4), kConfig),
            -1);
  EXPECT_EQ(residual_mm(wall(), {}, kConfig), -1);
  // A small piece of a large wall shares all of itself.
  EXPECT_NEAR(residual_mm(test::grid({0, 0, 0.003f}, {0.1f, 0, 0}, {0, 0.1f, 0}, 4, 4), wall(),
                          {.voxel_m = 0.01, .samples = 200'000, .seed = 1}),
              3, 0.1);
}

std::string header(const std::string& vertices, const std::string& faces,
                   const std::string& format = "binary_little_endian 1.0") {
  return "ply\nformat " + format + "\ncomment made by hand\n" + vertices + faces + "end_header\n";
}

template <typename... Values>
std::string bytes_of(Values... values) {
  std::string out;
  (out.append(reinterpret_cast<const char*>(&values), sizeof values), ...);
  return out;
}

const std::string kXyz = "property float x\nproperty float y\nproperty float z\n";
const std::string kCorners = "property list uchar int vertex_indices\n";

std::string three_vertices() {
  return bytes_of(0.0f, 0.0f, 0.0f, 1.0f, 0.0f, 0.0f, 0.0f, 1.0f, 0.0f);
}

TEST(ReadPly, ReadsWhatIsWrittenForTheTruth) {
  const test::TempDir folder;
  const synth::ColoredMesh written{wall(0.5f, 3), std::vector<std::array<std::uint8_t, 3>>(16)};
  ASSERT_TRUE(synth::write_ply(folder / "wall.ply", written));
  const auto read = read_ply(folder / "wall.ply");
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(*read, written.mesh);
}

TEST(ReadPly, SkipsOtherPropertiesAndElementsAndCutsFacesIntoTriangles) {
  const test::TempDir folder;
  std::string file = header(
      "element scan 2\nproperty list ushort double times\nproperty char c\n"
      "element vertex 4\nproperty double quality\nproperty float y\nproperty uchar red\n"
      "property float32 x\nproperty float z\n",
      "element face 2\nproperty uchar flags\nproperty list int32 uint16 vertex_index\n"
      "property list uchar float texcoord\n");
  file += bytes_of(std::uint16_t{1}, 5.0, 'c', std::uint16_t{0}, 'd');
  for (const float v : {0.0f, 1.0f, 2.0f, 3.0f})
    file += bytes_of(9.0, 10 + v, std::uint8_t{7}, v, 20 + v);
  const auto corner = [](int v) { return static_cast<std::uint16_t>(v); };
  file += bytes_of('f', 4, corner(0), corner(1), corner(2), corner(3), std::uint8_t{1}, 0.5f);
  file += bytes_of('f', 3, corner(3), corner(1), corner(0), std::uint8_t{0});
  const auto mesh = read_ply(folder.write("odd.ply", file));
  ASSERT_TRUE(mesh) << mesh.error().message;
  ASSERT_EQ(mesh->positions.size(), 4u);
  EXPECT_EQ(mesh->positions[3], (Vec3f{3, 13, 23}));
  const std::vector<Triangle> expected = {{0, 1, 2}, {0, 2, 3}, {3, 1, 0}};
  EXPECT_EQ(mesh->triangles, expected);
}

TEST(ReadPly, WhatWasTurnedForOtherToolsIsTurnedBack) {
  const test::TempDir folder;
  const std::string rest = header("element vertex 3\n" + kXyz, "element face 1\n" + kCorners) +
                           three_vertices() + bytes_of('\3', 0, 1, 2);
  const auto with = [&](const std::string& numbers) {
    std::string file = rest;
    return folder.write(
        "turned.ply", file.insert(rest.find("element"), "comment T_file_world " + numbers + "\n"));
  };
  const auto mesh = read_ply(with("1 0 0 0 0 0 1 0 0 -1 0 0 0 0 0 1"));  // z up to y up
  ASSERT_TRUE(mesh) << mesh.error().message;
  const std::vector<Vec3f> expected{{0, 0, 0}, {1, 0, 0}, {0, 0, 1}};
  EXPECT_EQ(mesh->positions, expected);
  for (const char* numbers :
       {"", "1 0 0", "1 0 0 0 0 x 1 0 0 -1 0 0 0 0 0 1", "1 0 0 0 0 0 nan 0 0 -1 0 0 0 0 0 1",
        "0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 1"}) {
    const auto wrong = read_ply(with(numbers));
    ASSERT_FALSE(wrong) << numbers;
    EXPECT_EQ(wrong.error().cause, Error::Cause::corrupt);
  }
}

TEST(ReadPly, EveryCutIsToldInOneLine) {
  const test::TempDir folder;
  const std::string whole = header("element vertex 3\n" + kXyz, "element face 2\n" + kCorners) +
                            three_vertices() + bytes_of('\3', 0, 1, 2, '\3', 0, 2, 1);
  ASSERT_TRUE(read_ply(folder.write("whole.ply", whole)));
  for (std::size_t size = 0; size < whole.size(); ++size) {
    const auto mesh = read_ply(folder.write("cut.ply", whole.substr(0, size)));
    ASSERT_FALSE(mesh) << size;
    EXPECT_EQ(mesh.error().message.find('\n'), std::string::npos);
    EXPECT_NE(mesh.error().message.find("cut.ply"), std::string::npos);
  }
}

TEST(ReadPly, WhatIsDamagedIsToldByItsCause) {
  const test::TempDir folder;
  const auto cause = [&](const std::string& text, const char* message) {
    const auto mesh = read_ply(folder.write("bad.ply", text));
    EXPECT_FALSE(mesh) << message;
    if (mesh) return "";
    EXPECT_NE(mesh.error().message.find(message), std::string::npos) << mesh.error().message;
    return cause_name(mesh.error().cause);
  };
  const std::string vertices = "element vertex 3\n" + kXyz, faces = "element face 1\n" + kCorners;
  const std::string good = header(vertices, faces) + three_vertices();
  EXPECT_STREQ(cause(good + bytes_of('\3', 0, 1, 3), "vertex 3 of 3"), "corrupt");
  EXPECT_STREQ(cause(good + bytes_of('\3', 0, 1, -1), "vertex -1 of 3"), "corrupt");
  EXPECT_STREQ(cause(good + bytes_of('\2', 0, 1), "2 corners"), "corrupt");
  EXPECT_STREQ(cause(good + bytes_of('\xff', 0, 1, 2), "cut off at 'face' 0 of 1"), "corrupt");
  std::string lost = good;
  const float infinite = INFINITY;
  std::memcpy(&lost[lost.size() - 4], &infinite, 4);
  EXPECT_STREQ(cause(lost + bytes_of('\3', 0, 1, 2), "vertex 2"), "corrupt");
  EXPECT_STREQ(cause("solid wall\n", "'ply'"), "corrupt");
  EXPECT_STREQ(cause(header(vertices, faces, "ascii 1.0"), "ascii"), "unsupported");
  EXPECT_STREQ(cause(header(vertices, faces, "binary_big_endian 1.0"), "big"), "unsupported");
  EXPECT_STREQ(cause("ply\n" + vertices + faces + "end_header\n", "format"), "corrupt");
  EXPECT_STREQ(cause(header("element vertex 3\nproperty double x\n", faces), "float"),
               "unsupported");
  EXPECT_STREQ(cause(header("element vertex 3\nproperty float x\n", faces), "x, y and z"),
               "corrupt");
  EXPECT_STREQ(cause(header(vertices, "") + three_vertices(), "faces"), "corrupt");
  EXPECT_STREQ(cause(header(faces, vertices), "before"), "unsupported");
  EXPECT_STREQ(cause(header(vertices + vertices, faces) + three_vertices(), "two elements"),
               "corrupt");
  EXPECT_STREQ(cause(header("element vertex 99999999999999\n" + kXyz, faces), "cut off"),
               "corrupt");
  EXPECT_STREQ(cause(header("element vertex many\n" + kXyz, faces), "many"), "corrupt");
  EXPECT_STREQ(cause(header("element vertex 3\nproperty vec3 x\n", faces), "known type"),
               "corrupt");
  EXPECT_STREQ(cause(header("property float x\n", ""), "property"), "corrupt");
  EXPECT_STREQ(
      cause(header(vertices, "element face 4294967295\n" + kCorners) + three_vertices(), "cut off"),
      "corrupt");
  const auto missing = read_ply(folder / "missing.ply");
  ASSERT_FALSE(missing);
  EXPECT_EQ(missing.error().cause, Error::Cause::not_found);
  EXPECT_FALSE(read_ply(folder.path()));
}

TEST(ReadPly, NoByteThatIsWrongCrashesIt) {
  const test::TempDir folder;
  const std::string whole = header("element vertex 3\n" + kXyz, "element face 2\n" + kCorners) +
                            three_vertices() + bytes_of('\3', 0, 1, 2, '\3', 0, 2, 1);
  std::mt19937 random(1);
  for (int round = 0; round < 300; ++round) {
    std::string damaged = whole;
    for (unsigned n = 1 + random() % 3; n > 0; --n)
      damaged[random() % damaged.size()] = static_cast<char>(random());
    const auto mesh = read_ply(folder.write("damaged.ply", damaged));
    if (!mesh) continue;
    for (const Vec3f p : mesh->positions) EXPECT_TRUE(is_finite(p));
    for (const Triangle& t : mesh->triangles)
      for (const std::uint32_t v : t) EXPECT_LT(v, mesh->positions.size());
  }
}

TEST(SeenSamples, ALidarSeesBetweenItsBeamsOnly) {
  Mesh wall = test::grid({-0.5f, 2, 2}, {1, 0, 0}, {0, -4, 0}, 4, 40);  // y is down
  SensorFrustum frustum;
  frustum.depth_camera.model = CameraModel::lidar;
  frustum.depth_camera.width = 512, frustum.depth_camera.height = 46;
  for (int row = 0; row < 46; ++row)
    frustum.depth_camera.beam_altitude_rad.push_back(-row * 0.0174533);
  frustum.depth_camera.beam_azimuth_rad.assign(46, 0);
  const auto samples = sample_surface(wall, 4000, 1);
  const auto seen = seen_samples(wall, samples, std::span(&frustum, 1), 0.01);
  int above = 0, below = 0;
  for (std::size_t i = 0; i < samples.size(); ++i)
    (samples[i].position.y < -0.03f ? above : below) += seen[i];
  EXPECT_EQ(above, 0);
  EXPECT_GT(below, 1800);
}

}  // namespace
}  // namespace mr::eval
