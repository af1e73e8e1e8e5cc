#include "mr/core/trajectory.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace mr {
namespace {

using namespace std::chrono_literals;

TimePoint at(Duration d) { return TimePoint(d); }

Pose turned(double angle, Vec3d translation) {
  const double c = std::cos(angle), s = std::sin(angle);
  return {{{c, -s, 0, s, c, 0, 0, 0, 1}}, translation};
}

void expect_near(const Pose& a, const Pose& b) {
  const auto x = a.matrix(), y = b.matrix();
  for (std::size_t i = 0; i < x.size(); ++i) EXPECT_NEAR(x[i], y[i], 1e-12) << "entry " << i;
}

TEST(Trajectory, InterpolatesTranslationAndRotation) {
  const Trajectory way({{at(100ms), turned(1.2, {1, 0, 0})}, {at(0ms), turned(0.2, {0, 2, 0})}});
  expect_near(*way.at(at(25ms)), turned(0.45, {0.25, 1.5, 0}));
  expect_near(*way.at(at(0ms)), turned(0.2, {0, 2, 0}));
  expect_near(*way.at(at(100ms)), turned(1.2, {1, 0, 0}));
}

TEST(Trajectory, TurnsByTheShorterArcAndByHalfATurn) {
  const Trajectory over({{at(0ms), turned(3.0, {})}, {at(10ms), turned(-3.0, {})}});
  expect_near(*over.at(at(5ms)), turned(std::numbers::pi, {}));
  const Trajectory half({{at(0ms), {}}, {at(10ms), turned(std::numbers::pi, {})}});
  const Pose middle = *half.at(at(5ms));
  EXPECT_NEAR(std::abs(middle.rotation(0, 1)), 1, 1e-9);
  EXPECT_NEAR(middle.rotation(2, 2), 1, 1e-9);
}

TEST(Trajectory, HasNoPoseBeyondItsEndsNorInGaps) {
  const Trajectory way({{at(1s), {}}, {at(2s), {}}, {at(2100ms), {}}});
  EXPECT_FALSE(way.at(at(900ms)).ok());
  EXPECT_TRUE(way.at(at(990ms)).ok());
  EXPECT_FALSE(way.at(at(1500ms)).ok());
  EXPECT_TRUE(way.at(at(2050ms)).ok());
  EXPECT_TRUE(way.at(at(2120ms)).ok());
  EXPECT_FALSE(way.at(at(2130ms)).ok());
  EXPECT_EQ(Trajectory().at(at(0s)).error().cause, Error::Cause::not_found);
}

}  // namespace
}  // namespace mr
