#include "mr/core/lattice.h"

#include <gtest/gtest.h>

#include <random>

namespace mr {
namespace {

class LatticeSteps : public testing::TestWithParam<int> {
 protected:
  Lattice lattice() const { return {{4, -8, 0.5}, GetParam()}; }
};
INSTANTIATE_TEST_SUITE_P(All, LatticeSteps, testing::Values(-9, -10, -11));

TEST_P(LatticeSteps, SnapMovesByHalfAStepAtMostAndOnlyOnce) {
  std::mt19937 random(1);
  std::uniform_real_distribution<float> metres(-20, 20);
  for (int i = 0; i < 10'000; ++i) {
    const Vec3f p{metres(random), metres(random), metres(random)};
    const Vec3f snapped = lattice().snap(p);
    for (int axis = 0; axis < 3; ++axis)
      ASSERT_LE(std::abs(snapped[axis] - p[axis]), 0.5 * lattice().step_m() * 1.0001);
    ASSERT_EQ(lattice().snap(snapped), snapped);
    ASSERT_EQ(lattice().position(lattice().quantize(snapped)), snapped);
  }
}

TEST_P(LatticeSteps, EveryIntegerSurvivesTheWayThroughFloat) {
  std::mt19937 random(2);
  std::uniform_int_distribution<std::int32_t> cell(0, Lattice::kCells - 1);
  for (int i = 0; i < 10'000; ++i) {
    const Vec3i q{cell(random), cell(random), cell(random)};
    ASSERT_EQ(lattice().quantize(lattice().position(q)), q);
  }
}

TEST_P(LatticeSteps, CoversTheCubeAroundItsOrigin) {
  const Lattice l = lattice();
  const float half = static_cast<float>(l.step_m() * (Lattice::kCells / 2));
  const Vec3f origin = vec_cast<float>(l.origin);
  EXPECT_TRUE(Lattice::contains(l.quantize(origin)));
  EXPECT_TRUE(Lattice::contains(l.quantize(origin - Vec3f{half, half, half})));
  EXPECT_FALSE(Lattice::contains(l.quantize(origin + Vec3f{half, 0, 0})));
  EXPECT_FALSE(Lattice::contains(l.quantize(origin - Vec3f{0, half + 1, 0})));
}

TEST(Lattice, FarAndInfinitePointsDoNotOverflow) {
  const Lattice lattice;
  EXPECT_FALSE(Lattice::contains(lattice.quantize({1e30f, -1e30f, 0})));
}

TEST(Lattice, StepIsAPowerOfTwo) {
  EXPECT_EQ((Lattice{{}, -10}.step_m()), 1.0 / 1024);
  EXPECT_EQ((Lattice{{}, -10}.low_corner()), (Vec3d{-512, -512, -512}));
}

}  // namespace
}  // namespace mr
