#include "mr/codec/packet_order.h"

#include <gtest/gtest.h>

namespace mr::codec {
namespace {

using std::chrono::milliseconds;
using Verdict = PacketOrder::Verdict;

/// Thirty packets a second, some of them wrong.
class Order : public testing::Test {
 protected:
  bool take(std::uint64_t sequence, std::uint32_t epoch = 7) {
    now_ += milliseconds(33);
    const auto verdict = order_.take(epoch, sequence, now_);
    afresh_ = verdict && *verdict == Verdict::afresh;
    return verdict.ok();
  }
  /// How many packets that go on from `sequence` are refused until one is taken.
  int refused_from(std::uint64_t sequence, std::uint32_t epoch = 7) {
    int n = 0;
    while (n < 1000 && !take(sequence + static_cast<std::uint64_t>(n), epoch)) ++n;
    return n;
  }

  PacketOrder order_;
  TimePoint now_{std::chrono::hours(1)};
  bool afresh_ = false;
};

TEST_F(Order, PacketsGoOn) {
  EXPECT_TRUE(take(5));
  EXPECT_TRUE(afresh_) << "the first";
  EXPECT_TRUE(take(6));
  EXPECT_FALSE(afresh_);
  EXPECT_TRUE(take(90)) << "some were lost";
  EXPECT_FALSE(take(90)) << "sent again";
  EXPECT_FALSE(take(6));
  EXPECT_TRUE(take(91));
}

TEST_F(Order, ASequenceFarAheadSilencesNobody) {
  ASSERT_TRUE(take(5));
  EXPECT_FALSE(take(UINT64_MAX));
  EXPECT_TRUE(take(6));
  EXPECT_FALSE(afresh_);
}

TEST_F(Order, AForgedPacketThatWasTakenIsOvercomeWithinASecond) {
  ASSERT_TRUE(take(5));
  ASSERT_TRUE(take(5 + PacketOrder::kMostAhead));
  const int refused = refused_from(6);
  EXPECT_LT(refused * milliseconds(33), milliseconds(1100));
  EXPECT_TRUE(afresh_) << "what the forged packet brought does not hold";
}

TEST_F(Order, TheFirstPacketMayBeForged) {
  ASSERT_TRUE(take(UINT64_MAX));
  EXPECT_LT(refused_from(6) * milliseconds(33), milliseconds(1100));
}

TEST_F(Order, ReplayedPacketsAreRefusedForAsLongAsOthersCome) {
  ASSERT_TRUE(take(1000));
  for (std::uint64_t i = 1; i < 300; ++i) {
    for (int again = 0; again < 5; ++again) EXPECT_FALSE(take(i));
    EXPECT_TRUE(take(1000 + i));
    EXPECT_FALSE(afresh_);
  }
}

TEST_F(Order, AnotherStartOfTheNodeIsTaken) {
  ASSERT_TRUE(take(1000, 7));
  EXPECT_TRUE(take(0, 8));
  EXPECT_TRUE(afresh_);
  EXPECT_FALSE(take(1001, 7)) << "the one before is over, or runs beside it";
  EXPECT_TRUE(take(1, 8));
  EXPECT_TRUE(take(0, 0x80000007)) << "half a turn later";
  EXPECT_TRUE(take(0, 3)) << "after the wrap";
}

TEST_F(Order, AClockThatWasSetBackIsNoReasonToStop) {
  ASSERT_TRUE(take(1000, 700));
  EXPECT_LT(refused_from(0, 20) * milliseconds(33), milliseconds(1100));
  ASSERT_TRUE(take(5000, 700));
  now_ -= std::chrono::hours(1);  // and that of the receiver
  EXPECT_LE(refused_from(0, 20), PacketOrder::kRefusals);
}

TEST_F(Order, OneOldPacketAfterAPauseIsRefused) {
  ASSERT_TRUE(take(1000));
  now_ += std::chrono::seconds(5);
  EXPECT_FALSE(take(3));
  EXPECT_TRUE(take(1001));
  EXPECT_FALSE(afresh_);
}

}  // namespace
}  // namespace mr::codec
