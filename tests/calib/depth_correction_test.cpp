#include "mr/calib/depth_correction.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "mr/calib/residuals.h"
#include "support/meshes.h"
#include "support/rays.h"

namespace mr {
namespace {

using calib::DepthCorrector;
using kit::Part;

constexpr double kAgree_m = 0.05;

/// A wall of 3 m in the plane y = 0, seen from its +y side from 2.5 m, each vertex moved away from
/// the sensor by `error(x, z)`, metres.
template <typename ErrorAt>
Part wall(std::uint32_t sensor, Vec3d eye, ErrorAt&& error) {
  Mesh mesh = test::grid({0, 0, 0}, {0, 0, 2}, {3, 0, 0}, 40 + sensor, 60, 0.0005f, sensor + 1);
  for (Vec3f& p : mesh.positions) {
    const Vec3d q = vec_cast<double>(p);
    p = vec_cast<float>(q + normalized(q - eye) * error(q.x, q.z));
  }
  return {std::move(mesh), 0.001f, {test::source(sensor, look_at(eye, {1.5, 0, 1}, {0, 0, 1}))}};
}

double nowhere(double, double) { return 0; }
/// Of a bent depth field: 2 cm in the middle, -1 cm beside it.
double bent(double x, double z) { return 0.02 * std::cos(2 * (x - 1.5)) * std::cos(0.5 * (z - 1)); }

std::vector<std::uint64_t> numbers_of(const std::vector<Part>& parts) {
  std::vector<std::uint64_t> out;
  for (std::size_t i = 0; i < parts.size(); ++i) out.push_back(7 + i);
  return out;
}

double most_offset_m(const DepthCorrector& corrector, std::uint64_t id) {
  double most = 0;
  for (const double offset_m : corrector.of(id)->offset_m)
    most = std::max(most, std::abs(offset_m));
  return most;
}

TEST(DepthCorrection, ABentFieldAndAStraightOneMeetInTheMiddle) {
  const std::vector<Part> parts{wall(0, {1, 2.5, 1}, nowhere), wall(1, {2, 2.5, 1}, bent)};
  DepthCorrector corrector({}, kAgree_m);
  EXPECT_TRUE(corrector.update(parts, numbers_of(parts)));
  const auto before = calib::pair_residuals(parts, {});
  ASSERT_EQ(before.size(), 1u);
  ASSERT_EQ(corrector.residuals().size(), 1u);
  EXPECT_GT(before[0].residual_mm, 10);
  EXPECT_LT(corrector.residuals()[0].residual_mm, 0.4 * before[0].residual_mm);
  const Vec3d middle{1.5, 0, 1};
  const double straight_m = corrector.of(7)->offset_at(middle),
               bent_m = corrector.of(8)->offset_at(middle);
  EXPECT_GT(straight_m, 0.004);
  EXPECT_LT(bent_m, -0.004);
  EXPECT_NEAR(straight_m + bent_m, 0, 0.004) << "both go half of the way";
}

TEST(DepthCorrection, RestsOnceItIsDone) {
  const std::vector<Part> parts{wall(0, {1, 2.5, 1}, nowhere), wall(1, {2, 2.5, 1}, bent)};
  DepthCorrector corrector({}, kAgree_m);
  EXPECT_TRUE(corrector.update(parts, numbers_of(parts)));
  const std::vector<double> first = corrector.of(8)->offset_m;
  for (int i = 0; i < 5; ++i) EXPECT_FALSE(corrector.update(parts, numbers_of(parts))) << i;
  EXPECT_EQ(corrector.of(8)->offset_m, first);
}

TEST(DepthCorrection, LaterChangesAreSlow) {
  std::vector<Part> parts{wall(0, {1, 2.5, 1}, nowhere), wall(1, {2, 2.5, 1}, nowhere)};
  DepthCorrector corrector({}, kAgree_m);
  corrector.update(parts, numbers_of(parts));
  parts[1] = wall(1, {2, 2.5, 1}, bent);
  double before_m = most_offset_m(corrector, 8);
  for (int i = 0; i < 3; ++i) {
    EXPECT_TRUE(corrector.update(parts, numbers_of(parts))) << i;
    const double now_m = most_offset_m(corrector, 8);
    EXPECT_LT(now_m, before_m + 0.004) << i;
    before_m = now_m;
  }
}

TEST(DepthCorrection, NoiseAloneBendsNothing) {
  const std::vector<Part> parts{wall(0, {1, 2.5, 1}, nowhere), wall(1, {2, 2.5, 1}, nowhere)};
  DepthCorrector corrector({}, kAgree_m);
  corrector.update(parts, numbers_of(parts));
  for (const std::uint64_t id : {7, 8}) EXPECT_LT(most_offset_m(corrector, id), 0.0005);
}

TEST(DepthCorrection, NobodyIsBentTowardsASensorThatIsFarOff) {
  const auto far_off = [](double, double) { return 0.2; };
  const std::vector<Part> parts{wall(0, {1, 2.5, 1}, nowhere), wall(1, {2, 2.5, 1}, nowhere),
                                wall(2, {1.5, 2.5, 1.5}, far_off)};
  DepthCorrector corrector({}, kAgree_m);
  corrector.update(parts, numbers_of(parts));
  for (const std::uint64_t id : {7, 8, 9}) EXPECT_LT(most_offset_m(corrector, id), 0.001) << id;
}

TEST(DepthCorrection, WhoWasAwayGoesOnWithWhatItHadAndMovesNobody) {
  const std::vector<Part> parts{wall(0, {1, 2.5, 1}, nowhere), wall(1, {2, 2.5, 1}, bent),
                                wall(2, {1.5, 2.5, 1.2}, nowhere)};
  DepthCorrector corrector({}, kAgree_m);
  EXPECT_TRUE(corrector.update(parts, numbers_of(parts)));
  const std::vector<double> first = corrector.of(7)->offset_m, away = corrector.of(9)->offset_m;
  corrector.update(std::span(parts).first(2), std::vector<std::uint64_t>{7, 8});
  ASSERT_TRUE(corrector.of(9));
  EXPECT_EQ(corrector.of(9)->offset_m, away);
  corrector.update(parts, numbers_of(parts));
  for (std::size_t k = 0; k < first.size(); ++k)  // a fifth of a voxel each time
    EXPECT_NEAR(corrector.of(7)->offset_m[k], first[k], 0.005) << k;
}

TEST(DepthCorrection, ZeroTurnsItOff) {
  const std::vector<Part> parts{wall(0, {1, 2.5, 1}, nowhere), wall(1, {2, 2.5, 1}, bent)};
  DepthCorrector corrector({}, 0);
  EXPECT_FALSE(corrector.update(parts, numbers_of(parts)));
  EXPECT_EQ(corrector.of(7), nullptr);
  EXPECT_TRUE(corrector.residuals().empty());
}

TEST(DepthCorrection, EmptyPartsAndPartsOfSeveralSensorsAreTaken) {
  std::vector<Part> parts{wall(0, {1, 2.5, 1}, nowhere), wall(1, {2, 2.5, 1}, bent),
                          wall(2, {2, 2.5, 1.5}, nowhere)};
  parts[0].sources.push_back(parts[1].sources[0]);
  parts[2].mesh = {};
  DepthCorrector corrector({}, kAgree_m);
  EXPECT_TRUE(corrector.update(parts, numbers_of(parts)));
  const auto before = calib::pair_residuals(parts, {});
  ASSERT_EQ(before.size(), 1u);
  ASSERT_EQ(corrector.residuals().size(), 1u);
  EXPECT_LT(corrector.residuals()[0].residual_mm, 0.5 * before[0].residual_mm);
}

TEST(DepthCorrection, DirectionsGoAllAround) {
  Part part = wall(0, {1, 2.5, 1}, nowhere);
  part.sources.push_back(part.sources[0]);
  calib::DepthCorrection correction(part);
  ASSERT_TRUE(correction.goes_around());
  for (std::size_t k = 0; k < correction.offset_m.size(); ++k)
    correction.offset_m[k] = 0.01 * std::sin(0.7 * static_cast<double>(k));
  for (double up = -1; up <= 1; up += 0.1) {  // on both sides of where the angle jumps
    const Vec3d behind = correction.eye() + Vec3d{-2, 0, up};
    const double left_m = correction.offset_at(behind + Vec3d{0, -1e-9, 0}),
                 right_m = correction.offset_at(behind + Vec3d{0, 1e-9, 0});
    EXPECT_NEAR(left_m, right_m, 1e-6);
  }
}

}  // namespace
}  // namespace mr
