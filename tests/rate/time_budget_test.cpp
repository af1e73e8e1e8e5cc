#include "mr/rate/time_budget.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace mr::rate {
namespace {

/// A node whose time has a fixed part and one that falls with the error limit.
struct Node {
  double fixed_ms = 20, of_triangles_ms = 200;

  double ms(double voxels) const {
    return fixed_ms + of_triangles_ms / std::sqrt(std::fmax(voxels, 0.5) / 0.5);
  }
};

double settled_ms(TimeBudget& budget, const Node& node, int captures, double chosen_voxels = 0.5) {
  const auto error = [&] { return std::max(budget.least_error_voxels(), chosen_voxels); };
  for (int i = 0; i < captures; ++i) budget.note(node.ms(error()), error());
  return node.ms(error());
}

TEST(TimeBudget, LeavesWhatIsQuickAlone) {
  TimeBudget budget(6);
  settled_ms(budget, {20, 60}, 3000);
  EXPECT_EQ(budget.least_error_voxels(), 0);
}

TEST(TimeBudget, FewerTrianglesBeforeMoreTime) {
  TimeBudget budget(6);
  EXPECT_LE(settled_ms(budget, {20, 200}, 600), TimeBudget::kMost_ms);
  EXPECT_GT(budget.least_error_voxels(), 0.5);
  EXPECT_LE(budget.least_error_voxels(), 6);
}

TEST(TimeBudget, ButNotFewerThanShowPeople) {
  TimeBudget budget(1);
  EXPECT_GT(settled_ms(budget, {20, 200}, 600), TimeBudget::kMost_ms);
  EXPECT_LE(budget.least_error_voxels(), 1);
  EXPECT_GT(budget.least_error_voxels(), 0.9);
}

TEST(TimeBudget, GoesOnFromTheErrorInForce) {
  TimeBudget budget(6);
  EXPECT_LE(settled_ms(budget, {20, 240}, 600, 2), TimeBudget::kMost_ms);
  EXPECT_GT(budget.least_error_voxels(), 2);
}

TEST(TimeBudget, WhereItDoesNotHelpQualityStays) {
  TimeBudget budget(6);
  int raised = 0;
  for (int i = 0; i < 3000; ++i) {
    budget.note(150, 0.5);
    raised += budget.least_error_voxels() > 0;
  }
  EXPECT_LT(raised, 3000 / 8);
  EXPECT_LE(budget.least_error_voxels(), 0.7);
}

TEST(TimeBudget, IsGivenUpOnceThereIsTime) {
  TimeBudget budget(6);
  settled_ms(budget, {20, 200}, 600);
  settled_ms(budget, {5, 30}, 600);
  EXPECT_EQ(budget.least_error_voxels(), 0);
}

}  // namespace
}  // namespace mr::rate
