#include "mr/rate/sensor_shares.h"

#include <gtest/gtest.h>

namespace mr::rate {
namespace {

constexpr SensorId kNear{0}, kFar{1}, kBehind{2};

void note(SensorShares& shares, int captures, double far_shown, double behind_shown = 0) {
  for (int i = 0; i < captures; ++i)
    shares.note(
        {{kNear, {4000, 3600}}, {kFar, {2000, far_shown}}, {kBehind, {1000, behind_shown}}});
}

TEST(SensorShares, WhoAddsAsMuchAsOthersIsLikeThem) {
  SensorShares shares;
  note(shares, 300, 1500, 700);
  for (const SensorId sensor : {kNear, kFar, kBehind, SensorId{9}})
    EXPECT_EQ(shares.coarser(sensor), 1);
}

TEST(SensorShares, WhoAddsLittleIsCoarser) {
  SensorShares shares;
  note(shares, 29, 500);
  EXPECT_EQ(shares.coarser(kBehind), 1) << "not at once";
  note(shares, 300, 700);
  EXPECT_EQ(shares.coarser(kNear), 1);
  EXPECT_EQ(shares.coarser(kFar), 1.4);
  EXPECT_EQ(shares.coarser(kBehind), 2);
}

TEST(SensorShares, AndFinerAgainOnceItAddsMore) {
  SensorShares shares;
  note(shares, 300, 100);
  EXPECT_EQ(shares.coarser(kFar), 2);
  note(shares, 300, 1800, 900);
  EXPECT_EQ(shares.coarser(kFar), 1);
  EXPECT_EQ(shares.coarser(kBehind), 1);
}

TEST(SensorShares, StaysWhereAShareIsNearALimit) {
  SensorShares shares;
  note(shares, 300, 0.49 * 0.9 * 2000);
  EXPECT_EQ(shares.coarser(kFar), 1.4);
  int changes = 0;
  for (int i = 0; i < 20; ++i) {
    const double before = shares.coarser(kFar);
    note(shares, 60, (i % 2 == 0 ? 0.53 : 0.47) * 0.9 * 2000);
    changes += before != shares.coarser(kFar);
  }
  EXPECT_EQ(changes, 0);
}

TEST(SensorShares, NothingMovesAndNothingIsDivided) {
  SensorShares shares;
  for (int i = 0; i < 100; ++i) shares.note({{kNear, {0, 0}}, {kFar, {3, 0}}});
  EXPECT_EQ(shares.coarser(kNear), 1);
  EXPECT_EQ(shares.coarser(kFar), 1);
}

}  // namespace
}  // namespace mr::rate
