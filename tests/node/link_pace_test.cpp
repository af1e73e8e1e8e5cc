#include "mr/node/link_pace.h"

#include <gtest/gtest.h>

namespace mr::node {
namespace {

TEST(LinkPace, GivesWhatOthersLeaveAndATenthAtLeast) {
  LinkPace pace(2.4, 30);  // 10 kB a capture
  pace.sent(4000, 0);
  EXPECT_NEAR(pace.next(true).bytes, 5000, 1e-6);
  pace.sent(25'000, 5000);
  EXPECT_NEAR(pace.next(true).bytes, 1000, 1e-6);
}

TEST(LinkPace, KeepsForALargePieceWhileItWaits) {
  LinkPace pace(2.4, 30);
  for (int i = 0; i < 10; ++i) pace.next(true);
  EXPECT_NEAR(pace.next(true).bytes, 99'000, 1e-6);
  for (int i = 0; i < 10; ++i) pace.next(true);
  const Allowance most = pace.next(true);
  EXPECT_NEAR(most.bytes, 150'000, 1e-6) << "half a second";
  EXPECT_TRUE(most.one_anyway);
  pace.sent(170'000, 170'000);
  EXPECT_EQ(pace.next(false).bytes, 0) << "the debt stays";
  for (int i = 0; i < 10; ++i) pace.next(true);
  EXPECT_NEAR(pace.next(false).bytes, 9000, 1e-6) << "what the link did not carry is gone";
}

}  // namespace
}  // namespace mr::node
