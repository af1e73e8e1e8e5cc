#include "mr/node/aligner.h"

#include <gtest/gtest.h>

namespace mr {
namespace {

using std::chrono::milliseconds;

TimePoint at(int ms) { return TimePoint(milliseconds(ms)); }

node::Aligner two_inputs() { return {2, milliseconds(40), milliseconds(50)}; }

TEST(Aligner, ReadyAsSoonAsAllHaveTheTick) {
  auto a = two_inputs();
  EXPECT_FALSE(a.ready(at(0)));
  a.arrived(0, at(83), at(100));
  EXPECT_FALSE(a.ready(at(110)));
  a.arrived(1, at(77), at(112));  // both nearest to 80
  EXPECT_EQ(a.ready(at(112)), at(80));
  EXPECT_EQ(a.live_at(at(80)), (std::vector<std::size_t>{0, 1}));
  a.merged(at(80), at(113));
  EXPECT_FALSE(a.ready(at(500)));
}

TEST(Aligner, ClockThatIsSetBackStallsNothing) {
  auto a = two_inputs();
  for (const int hour : {3'600'000, 0}) {
    for (const int input : {0, 1}) a.arrived(input, at(hour + 40), at(hour + 45));
    EXPECT_EQ(a.ready(at(hour + 45)), at(hour + 40));
    EXPECT_EQ(a.live_at(at(hour + 40)).size(), 2u);
    a.merged(at(hour + 40), at(hour + 46));
  }
}

TEST(Aligner, SlowInputsStayInThePicture) {
  auto a = two_inputs();
  for (int ms = 0; ms < 9000; ms += 900) {
    a.arrived(0, at(ms), at(ms));
    a.arrived(1, at(ms + 350), at(ms + 350));
    if (ms < 900) continue;
    EXPECT_EQ(a.live_at(at(ms)).size(), 2u);
    EXPECT_EQ(a.live_at(at(ms + 360)).size(), 2u);
  }
  EXPECT_TRUE(a.live_at(at(12'000)).empty()) << "gone for long";
}

TEST(Aligner, WhoWasAwayCountsAsQuickAgain) {
  auto a = two_inputs();
  a.arrived(0, at(0), at(0));
  a.arrived(0, at(60'000), at(60'000));
  EXPECT_EQ(a.live_at(at(60'480)).size(), 1u);
  EXPECT_TRUE(a.live_at(at(60'560)).empty());
}

TEST(Aligner, LateInputDoesNotStall) {
  auto a = two_inputs();
  a.arrived(0, at(80), at(100));
  EXPECT_FALSE(a.ready(at(149)));
  EXPECT_EQ(a.ready(at(150)), at(80));
  EXPECT_EQ(a.live_at(at(80)), (std::vector<std::size_t>{0}));
  a.merged(at(80), at(150));
  a.arrived(1, at(80), at(160));  // too late for its tick: not merged again
  EXPECT_FALSE(a.ready(at(400)));
}

TEST(Aligner, InputThatMissedOneFrameIsStillLiveThenDies) {
  auto a = two_inputs();
  a.arrived(0, at(0), at(0));
  a.arrived(1, at(0), at(0));
  a.merged(at(0), at(0));
  a.arrived(0, at(40), at(45));
  EXPECT_EQ(a.ready(at(95)), at(40));
  EXPECT_EQ(a.live_at(at(40)).size(), 2u);
  EXPECT_EQ(a.live_at(at(1000)).size(), 0u);
}

TEST(Aligner, FrameThatCameDuringMergingIsNext) {
  auto a = two_inputs();
  a.arrived(0, at(40), at(41));
  a.arrived(1, at(40), at(42));
  a.arrived(0, at(80), at(81));
  EXPECT_EQ(a.ready(at(200)), at(80));
  a.merged(at(40), at(82));
  EXPECT_FALSE(a.ready(at(90)));
  a.arrived(1, at(80), at(91));
  EXPECT_EQ(a.ready(at(91)), at(80));
}

TEST(Aligner, TimesBeforeTheEpochRoundTheSameWay) {
  auto a = two_inputs();
  a.arrived(0, at(-43), at(0));
  a.arrived(1, at(-38), at(0));
  EXPECT_EQ(a.ready(at(0)), at(-40));
}

}  // namespace
}  // namespace mr
