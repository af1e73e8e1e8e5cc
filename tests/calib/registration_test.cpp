#include "mr/calib/pose_refiner.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "mr/calib/outliers.h"
#include "mr/calib/residuals.h"
#include "mr/core/parallel.h"
#include "support/meshes.h"
#include "support/rays.h"

namespace mr {
namespace {

using calib::PairResidual;
using calib::PoseRefiner;
using kit::Part;
using testing::ElementsAre;
using testing::IsEmpty;

constexpr double kDegree = std::numbers::pi / 180;

/// A turn about an axis through `about`, then a shift.
Pose small_motion(Vec3d shift, double degrees, Vec3d axis, Vec3d about) {
  const double c = std::cos(degrees * kDegree), s = std::sin(degrees * kDegree);
  const Vec3d n = normalized(axis);
  Pose out;
  for (int i = 0; i < 3; ++i) {
    Vec3d unit;
    unit[i] = 1;
    const Vec3d turned = unit * c + cross(n, unit) * s + n * (dot(n, unit) * (1 - c));
    for (int row = 0; row < 3; ++row) out.rotation(row, i) = turned[row];
  }
  out.translation = about + shift - out.rotation * about;
  return out;
}

double turn_rad(const Mat3& r) {
  const Vec3d twice{r(2, 1) - r(1, 2), r(0, 2) - r(2, 0), r(1, 0) - r(0, 1)};
  return std::asin(std::min(1.0, length(twice) / 2));
}

Part moved(Part part, const Pose& T) {
  calib::move_part(T, part);
  return part;
}

/// The floor and two walls that meet in the origin, 3 m long and 2 m high.
Mesh corner(int cells, float noise = 0, unsigned seed = 1) {
  Mesh out = test::grid({0, 0, 0}, {3, 0, 0}, {0, 3, 0}, cells, cells, noise, seed);
  append(out, test::grid({0, 0, 0}, {0, 3, 0}, {0, 0, 2}, cells, cells, noise, seed + 1));
  append(out, test::grid({0, 0, 0}, {0, 0, 2}, {3, 0, 0}, cells, cells, noise, seed + 2));
  return out;
}

Part seen_from(Mesh mesh, std::uint32_t sensor, Vec3d eye, Vec3d target = {0.5, 0.5, 0.5}) {
  return {std::move(mesh), 0.001f, {test::source(sensor, look_at(eye, target, {0, 0, 1}))}};
}

/// The corner, seen by up to four sensors.
std::vector<Part> corner_parts(int count, float noise = 0) {
  const Vec3d eyes[] = {{2.8, 1.2, 1.6}, {1.2, 2.8, 1.6}, {2.4, 2.4, 1.2}, {2, 2, 1.9}};
  std::vector<Part> out;
  for (int i = 0; i < count; ++i)
    out.push_back(seen_from(corner(30 + 7 * i, noise, 10 * i + 1), i, eyes[i]));
  return out;
}

/// A wall in the plane y = offset, seen from its +y side.
std::vector<Part> wall_parts(float offset, float noise = 0, unsigned seed = 1) {
  const auto wall = [&](float x0, float y, unsigned s) {
    return test::grid({x0, y, 0}, {0, 0, 2}, {3, 0, 0}, 40, 60, noise, s);
  };
  return {seen_from(wall(0, 0, seed), 0, {1, 2.5, 1}, {1.5, 0, 1}),
          seen_from(wall(0.03f, offset, seed + 1), 1, {2, 2.5, 1}, {1.5, 0, 1})};
}

std::vector<std::uint64_t> ids_of(std::span<const Part> parts) {
  std::vector<std::uint64_t> out;
  for (std::size_t i = 0; i < parts.size(); ++i) out.push_back(100 + i);
  return out;
}

std::vector<Pose> after_updates(PoseRefiner& refiner, std::span<const Part> parts, int updates) {
  std::vector<Pose> out;
  for (int i = 0; i < updates; ++i) out = refiner.update(parts, ids_of(parts));
  return out;
}

Vec3d eye_of(const Part& part) { return part.sources[0].T_world_depth.translation; }

double moved_m(const Pose& T, Vec3d p) { return length(T * p - p); }

TEST(Registration, ResidualOfShiftedCornerIsItsShift) {
  for (const double shift_m : {0.0, 0.004, -0.01, 0.03}) {
    std::vector<Part> parts = corner_parts(2);
    parts[1] = moved(parts[1], {{}, {shift_m, shift_m, shift_m}});
    const auto residuals = calib::pair_residuals(parts, {});
    ASSERT_EQ(residuals.size(), 1u);
    EXPECT_EQ(residuals[0].a, 0u);
    EXPECT_EQ(residuals[0].b, 1u);
    EXPECT_NEAR(residuals[0].residual_mm, std::abs(shift_m) * 1000, 0.1 + std::abs(shift_m) * 20);
    EXPECT_GT(residuals[0].shared_m2, 2);
    EXPECT_GT(residuals[0].shared_m2, 0.98 * residuals[0].expected_m2);
  }
}

TEST(Registration, NoiseIsMeasuredAsItIs) {
  // Uniform within ±3 mm at the vertices of either sheet: 1.73 mm RMS there, less in between.
  const auto residuals = calib::pair_residuals(wall_parts(0, 0.003f), {});
  ASSERT_EQ(residuals.size(), 1u);
  EXPECT_GT(residuals[0].residual_mm, 1.0);
  EXPECT_LT(residuals[0].residual_mm, 2.5);
}

TEST(Registration, SurfaceBehindIsNotTakenForTheSame) {
  // Sensor 1 sees a small board 6 cm before the wall, sensor 0 the bare wall.
  std::vector<Part> parts = wall_parts(0.002f);
  append(parts[1].mesh, test::grid({1.3f, 0.062f, 0.8f}, {0, 0, 0.4f}, {0.4f, 0, 0}, 8, 8));
  const auto residuals = calib::pair_residuals(parts, {});
  ASSERT_EQ(residuals.size(), 1u);
  EXPECT_NEAR(residuals[0].residual_mm, 2, 0.05);
}

TEST(Registration, BackOfABoardIsAnotherSurface) {
  std::vector<Part> parts = wall_parts(0);
  parts[1] = seen_from(parts[1].mesh, 1, {2, -2.5, 1}, {1.5, 0, 1});
  for (Triangle& t : parts[1].mesh.triangles) std::swap(t[1], t[2]);
  EXPECT_THAT(calib::pair_residuals(parts, {}), IsEmpty());
}

TEST(Registration, AllAroundSensorsAreCompared) {
  std::vector<Part> parts = corner_parts(2);
  Camera& camera = parts[1].sources[0].depth_camera;
  camera = {};
  camera.model = CameraModel::equirectangular;
  camera.width = 1024, camera.height = 512;
  parts[1] = moved(parts[1], {{}, {0.005, 0.005, 0.005}});
  const auto residuals = calib::pair_residuals(parts, {});
  ASSERT_EQ(residuals.size(), 1u);
  EXPECT_NEAR(residuals[0].residual_mm, 5, 0.1);
}

TEST(Registration, NothingToCompare) {
  EXPECT_THAT(calib::pair_residuals({}, {}), IsEmpty());
  std::vector<Part> parts = corner_parts(3);
  parts[0].mesh = {};
  parts[1] = moved(parts[1], {{}, {20, 0, 0}});
  EXPECT_THAT(calib::pair_residuals(parts, {}), IsEmpty());
  // Neither a sensor that does not see its own surface nor a mesh without area gives residuals.
  parts = corner_parts(3);
  parts[0].sources[0].T_world_depth = look_at({-1, -1, -1}, {-3, -3, -3}, {0, 0, 1});
  for (Vec3f& p : parts[1].mesh.positions) p = {1, 1, 1};
  EXPECT_THAT(calib::pair_residuals(parts, {}), IsEmpty());
  PoseRefiner refiner({});
  for (const Pose& T : after_updates(refiner, parts, 3)) EXPECT_EQ(T, Pose{});
  EXPECT_THAT(refiner.update({}, {}), IsEmpty());
}

TEST(Registration, OddPartIsNamed) {
  for (const Pose& wrong :
       {Pose{{}, {0.5, 0, 0}}, Pose{{}, {0, -0.3, 0.4}}, Pose{{}, {-0.4, -0.4, -0.4}},
        small_motion({}, 20, {0, 1, 1}, {2.4, 2.4, 1.2}),
        small_motion({0.1, 0.1, 0}, -20, {1, 0, 0}, {2.4, 2.4, 1.2})}) {
    std::vector<Part> parts = corner_parts(4, 0.002f);
    parts[2] = moved(parts[2], wrong);
    EXPECT_THAT(calib::outliers(calib::pair_residuals(parts, {}), 4, 20), ElementsAre(2u));
    PoseRefiner refiner({});
    const std::vector<Pose> T = after_updates(refiner, parts, 20);
    EXPECT_EQ(T[2], Pose{});
    for (const int i : {0, 1, 3}) EXPECT_LT(moved_m(T[i], eye_of(parts[i])), 0.001);
  }
}

TEST(Registration, OutliersAreThoseAgainstTheLargestGroup) {
  const auto pair = [](std::uint32_t a, std::uint32_t b, double mm, double shared = 2) {
    return PairResidual{a, b, mm, shared, 2};
  };
  const std::vector<PairResidual> one_odd = {pair(0, 1, 4), pair(0, 2, 40), pair(1, 2, 35)};
  EXPECT_THAT(calib::outliers(one_odd, 3, 20), ElementsAre(2u));
  EXPECT_THAT(calib::outliers(one_odd, 3, 50), IsEmpty());
  EXPECT_THAT(calib::outliers(one_odd, 3, 3), IsEmpty());  // none agree: undecidable
  EXPECT_THAT(calib::outliers(std::vector{pair(0, 1, 90)}, 2, 20), IsEmpty());
  // Fits where it meets the others, but they see through most of it.
  EXPECT_THAT(
      calib::outliers(std::vector{pair(0, 1, 4), pair(0, 2, 5, 0.4), pair(1, 2, 5, 0)}, 3, 20),
      ElementsAre(2u));
  // Two rooms, one odd part in each; part 6 meets no one.
  EXPECT_THAT(calib::outliers(std::vector{pair(0, 1, 90), pair(1, 2, 2), pair(0, 2, 80),
                                          pair(3, 4, 2), pair(3, 5, 70), pair(4, 5, 70)},
                              7, 20),
              ElementsAre(0u, 5u));
  // By chance it agrees with one of three.
  EXPECT_THAT(calib::outliers(std::vector{pair(0, 1, 2), pair(0, 2, 2), pair(1, 2, 2),
                                          pair(0, 3, 10), pair(1, 3, 90), pair(2, 3, 90)},
                              4, 20),
              ElementsAre(3u));
}

TEST(PoseRefiner, RecoversThePose) {
  std::vector<Part> parts = corner_parts(2, 0.002f);
  const Pose wrong = small_motion({0.012, -0.015, 0.01}, 0.6, {1, 2, -1}, eye_of(parts[1]));
  parts[1] = moved(parts[1], wrong);
  const double before_mm = calib::pair_residuals(parts, {})[0].residual_mm;
  PoseRefiner refiner({});
  const std::vector<Pose> T = after_updates(refiner, parts, 60);
  EXPECT_GT(before_mm, 8);
  ASSERT_EQ(refiner.residuals().size(), 1u);
  EXPECT_LT(refiner.residuals()[0].residual_mm, 2);
  for (const Vec3d p : {Vec3d{0, 0, 0}, {2, 0, 0}, {0, 2, 0}, {0, 0, 1.5}})
    EXPECT_LT(length(T[0] * p - T[1] * (wrong * p)), 0.0012);
  // Each goes half of the way.
  EXPECT_NEAR(moved_m(T[0], eye_of(parts[0])), moved_m(T[1], eye_of(parts[1])), 0.004);
}

TEST(PoseRefiner, BringsFourTogether) {
  std::vector<Part> parts = corner_parts(4, 0.002f);
  const Pose wrong[] = {small_motion({0.008, 0.002, 0}, 0.4, {0, 0, 1}, eye_of(parts[0])),
                        small_motion({0, -0.009, 0.004}, 0.5, {0, 1, 0}, eye_of(parts[1])),
                        small_motion({-0.004, 0.006, 0}, 0.3, {1, 0, 0}, eye_of(parts[2])),
                        small_motion({0, 0, -0.01}, 0.4, {1, -1, 0}, eye_of(parts[3]))};
  for (int i = 0; i < 4; ++i) parts[i] = moved(parts[i], wrong[i]);
  PoseRefiner refiner({});
  const std::vector<Pose> T = after_updates(refiner, parts, 60);
  for (int i = 1; i < 4; ++i)
    for (const Vec3d p : {Vec3d{0, 0, 0}, {2, 0, 0}, {0, 2, 0}, {0, 0, 1.5}})
      EXPECT_LT(length(T[0] * (wrong[0] * p) - T[i] * (wrong[i] * p)), 0.0015);
}

TEST(PoseRefiner, DoesNotSlideAlongAPlainWall) {
  PoseRefiner refiner({});
  std::vector<Pose> T;
  for (unsigned i = 0; i < 60; ++i) {  // fresh noise every time
    const std::vector<Part> parts = wall_parts(0.008f, 0.002f, 2 * i + 1);
    T = refiner.update(parts, ids_of(parts));
  }
  const Vec3d on_wall{1.5, 0, 1};
  EXPECT_NEAR((T[0] * on_wall).y - (T[1] * (on_wall + Vec3d{0, 0.008, 0})).y, 0, 0.0008);
  for (const Pose& pose : T) {
    const Vec3d way = pose * on_wall - on_wall;
    EXPECT_LT(std::hypot(way.x, way.z), 0.002);
  }
}

TEST(PoseRefiner, NeverJumpsAndKeepsWithinItsLimits) {
  const std::vector<Part> good = corner_parts(3, 0.002f);
  PoseRefiner refiner({});
  std::vector<Pose> last(3);
  std::vector<Vec3d> last_shift(3);
  double most_m = 0;
  for (int i = 0; i < 150; ++i) {
    // A calibration that drifts away, comes back at once, and a sensor that is far off for a while.
    std::vector<Part> parts = good;
    const double drift_m = i < 100 ? 0.0013 * i : 0;
    const Pose wrong = small_motion({drift_m, drift_m / 2, -drift_m}, 0.03 * (i % 100), {1, 0, 1},
                                    eye_of(parts[1]));
    parts[1] = moved(parts[1], wrong);
    if (i >= 110 && i < 120) parts[2] = moved(parts[2], {{}, {0.5, 0, 0}});
    const std::vector<Pose> T = refiner.update(parts, ids_of(parts));
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec3d shift = T[k] * eye_of(parts[k]) - eye_of(parts[k]);
      EXPECT_LE(length(shift - last_shift[k]), 0.00101) << i;
      EXPECT_LE(turn_rad((T[k] * last[k].inverse()).rotation), 0.0501 * kDegree) << i;
      EXPECT_LE(length(shift), 0.0501);
      EXPECT_LE(turn_rad(T[k].rotation), 2.01 * kDegree);
      most_m = std::max(most_m, length(shift));
      last_shift[k] = shift;
    }
    last = T;
  }
  EXPECT_GT(most_m, 0.01);
}

TEST(PoseRefiner, PartsThatFitStayWhereTheyAre) {
  std::vector<Part> same = corner_parts(1);
  same.push_back(same[0]), same.push_back(same[0]);
  PoseRefiner refiner({});
  for (const Pose& T : after_updates(refiner, same, 5)) EXPECT_EQ(T, Pose{});
  for (const PairResidual& r : refiner.residuals()) EXPECT_NEAR(r.residual_mm, 0, 0.1);
  EXPECT_EQ(refiner.residuals().size(), 3u);

  const std::vector<Part> noisy = corner_parts(4, 0.003f);
  PoseRefiner another({});
  for (std::size_t i = 0; i < 4; ++i)
    EXPECT_LT(moved_m(after_updates(another, noisy, 5)[i], eye_of(noisy[i])), 0.0015);
}

TEST(PoseRefiner, PartThatWasAwayStartsAnew) {
  std::vector<Part> parts = corner_parts(2);
  parts[1] = moved(parts[1], {{}, {0.02, 0.02, 0.02}});
  PoseRefiner refiner({});
  const auto went = after_updates(refiner, parts, 10);
  EXPECT_GT(moved_m(went[1], eye_of(parts[1])), 0.005);
  refiner.update(std::span(parts).first(1), std::vector<std::uint64_t>{100});
  const auto back = refiner.update(parts, ids_of(parts));
  EXPECT_GT(moved_m(back[0], eye_of(parts[0])), 0.005);  // it was there
  EXPECT_LT(moved_m(back[1], eye_of(parts[1])), 0.0011);
}

TEST(PoseRefiner, OrderOfPartsDoesNotMixThemUp) {
  std::vector<Part> parts = corner_parts(2);
  parts[1] = moved(parts[1], {{}, {0.02, 0.02, 0.02}});
  PoseRefiner refiner({});
  const auto before = refiner.update(parts, std::vector<std::uint64_t>{7, 3});
  std::swap(parts[0], parts[1]);
  const auto after = refiner.update(parts, std::vector<std::uint64_t>{3, 7});
  EXPECT_LT(length(after[0] * eye_of(parts[0]) - before[1] * eye_of(parts[0])), 0.0011);
  EXPECT_LT(length(after[1] * eye_of(parts[1]) - before[0] * eye_of(parts[1])), 0.0011);
}

TEST(PoseRefiner, SameOnAnyNumberOfThreads) {
  std::vector<Part> parts = corner_parts(4, 0.002f);
  parts[1] = moved(parts[1], {{}, {0.01, 0.004, 0.01}});
  parts[3] = moved(parts[3], small_motion({}, 0.5, {1, 1, 0}, eye_of(parts[3])));
  std::vector<std::vector<Pose>> results;
  std::vector<double> residuals;
  for (const int threads : {1, 3, 8}) {
    Arena arena(threads);
    arena.run([&] {
      PoseRefiner refiner({});
      results.push_back(after_updates(refiner, parts, 4));
      residuals.push_back(calib::pair_residuals(parts, {})[2].residual_mm);
    });
  }
  EXPECT_EQ(results[0], results[1]);
  EXPECT_EQ(results[0], results[2]);
  EXPECT_EQ(residuals[0], residuals[1]);
  EXPECT_EQ(residuals[0], residuals[2]);
}

}  // namespace
}  // namespace mr
