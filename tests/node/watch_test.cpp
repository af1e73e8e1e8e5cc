#include <gtest/gtest.h>

#include "mr/node/clock_offset.h"
#include "mr/node/presence.h"
#include "mr/node/request_limits.h"
#include "mr/node/stamp_check.h"

namespace mr::node {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr TimePoint kStart{seconds(1'000'000)};

TEST(Presence, WhoBringsNothingNewIsMissing) {
  Presence presence(3);
  TimePoint now = kStart;
  EXPECT_TRUE(presence.missing(now).empty()) << "nothing came yet";
  for (int i = 0; i < 90; ++i, now += milliseconds(33)) {
    presence.seen(0, now, now);
    presence.seen(1, i < 30 ? now : kStart, now);  // then the same capture again and again
    if (i < 60) continue;
    EXPECT_EQ(presence.missing(now),
              (i < 67 ? std::vector<std::size_t>{2} : std::vector<std::size_t>{1, 2}));
  }
  const auto gone = presence.changes(now);
  ASSERT_EQ(gone.size(), 2u);
  EXPECT_TRUE(gone[0].is_missing && gone[0].source == 1);
  EXPECT_TRUE(presence.changes(now).empty());
  presence.seen(1, now, now);
  const auto back = presence.changes(now);
  ASSERT_EQ(back.size(), 1u);
  EXPECT_FALSE(back[0].is_missing);
}

TEST(Presence, IsToldOnceAndWithinTwoSeconds) {
  Presence presence(2);
  std::vector<Duration> told;
  for (Duration after{}; after < seconds(8); after += milliseconds(100)) {
    const TimePoint now = kStart + after;
    presence.seen(0, now, now);
    if (after < seconds(3)) presence.seen(1, now, now);
    for (const auto& change : presence.changes(now)) {
      EXPECT_EQ(change.source, 1u);
      told.push_back(after - seconds(3));
    }
  }
  ASSERT_EQ(told.size(), 1u);
  EXPECT_LT(told[0], milliseconds(1500));
}

TEST(Presence, OneHiccupMakesNobodySlow) {
  Presence presence(1);
  TimePoint now = kStart;
  for (int i = 0; i < 20; ++i) presence.seen(0, now, now), now += milliseconds(33);
  presence.seen(0, now += milliseconds(2900), now);
  EXPECT_TRUE(presence.is_missing(0, now + milliseconds(1300)));
}

TEST(Presence, WhoWaitsForABusyMergerIsNotMissing) {
  Presence presence(1);
  TimePoint now = kStart;
  for (int i = 0; i < 20; ++i) presence.seen(0, now, now), now += milliseconds(33);
  presence.set_pace(seconds(1));
  EXPECT_FALSE(presence.is_missing(0, now + seconds(2)));
  EXPECT_TRUE(presence.is_missing(0, now + seconds(3)));
}

TEST(Presence, WhoNeverCameIsMissingFromTheStart) {
  Presence presence(2);
  presence.begin(kStart);
  EXPECT_TRUE(presence.missing(kStart + seconds(1)).empty());
  EXPECT_EQ(presence.missing(kStart + seconds(2)).size(), 2u);
}

TEST(Presence, ASlowOneIsNotMissingBetweenItsCaptures) {
  Presence presence(1);
  TimePoint now = kStart;
  for (int i = 0; i < 10; ++i) {
    presence.seen(0, now, now);
    for (int k = 0; k < 14; ++k, now += milliseconds(100))
      EXPECT_TRUE(i == 0 || !presence.is_missing(0, now)) << i << " " << k;
  }
  EXPECT_TRUE(presence.is_missing(0, now + seconds(4)));
}

/// A node whose clock is off by `ahead`, asked over a network that takes its time.
void ask(ClockOffset& clock, TimePoint& now, Duration ahead, Duration there, Duration back) {
  clock.add(now, now + there + ahead, now + there + back);
  now += seconds(1);
}

TEST(ClockOffset, IsFoundDespiteDelays) {
  for (const Duration ahead : {Duration(milliseconds(-1000)), Duration(milliseconds(400))}) {
    ClockOffset clock;
    TimePoint now = kStart;
    ask(clock, now, ahead, milliseconds(2), milliseconds(3));
    EXPECT_NEAR(static_cast<double>((clock.offset() - ahead).count()), 0, 1e6)
        << "after one answer";
    for (int i = 0; i < 30; ++i)
      ask(clock, now, ahead, milliseconds(i % 3 == 0 ? 2 : 60), milliseconds(i % 4 == 0 ? 3 : 9));
    EXPECT_NEAR(static_cast<double>((clock.offset() - ahead).count()), 0, 3e6);
  }
}

TEST(ClockOffset, ARightClockIsLeftAlone) {
  ClockOffset clock;
  TimePoint now = kStart;
  for (int i = 0; i < 30; ++i) {
    ask(clock, now, milliseconds(10), milliseconds(1 + 7 * (i % 5)), milliseconds(1));
    EXPECT_EQ(clock.offset(), Duration{});
  }
}

TEST(ClockOffset, OneSlowAnswerTellsNothing) {
  ClockOffset clock;
  TimePoint now = kStart;
  ask(clock, now, {}, milliseconds(1), milliseconds(300));
  EXPECT_EQ(clock.offset(), Duration{});
}

TEST(ClockOffset, FollowsAClockThatIsSet) {
  ClockOffset clock;
  TimePoint now = kStart;
  for (int i = 0; i < 20; ++i) ask(clock, now, seconds(-1), milliseconds(1), milliseconds(1));
  ask(clock, now, {}, milliseconds(1), milliseconds(1));
  EXPECT_EQ(clock.offset(), Duration{});
  EXPECT_EQ(clock_offset_text(milliseconds(-1004)), "1.00 s behind");
  EXPECT_EQ(clock_offset_text(milliseconds(250)), "0.25 s ahead of");
}

TEST(StampCheck, CapturesOfAWrongClockAreMoved) {
  for (const Duration off : {Duration(seconds(-1)), Duration(milliseconds(300))}) {
    StampCheck stamps;
    Duration shift{};
    for (int i = 0; i < 60; ++i) {
      const TimePoint made = kStart + milliseconds(33) * i;
      shift = stamps.shift(made + off, made + milliseconds(i % 5 == 0 ? 5 : 40));
    }
    EXPECT_NEAR(static_cast<double>((shift + off).count()), 0, 10e6);
  }
}

TEST(StampCheck, RightStampsAreLeftAlone) {
  StampCheck stamps;
  for (int i = 0; i < 60; ++i) {
    const TimePoint made = kStart + milliseconds(33) * i;
    EXPECT_EQ(stamps.shift(made, made + milliseconds(i == 0 ? 900 : 20 + i)), Duration{});
  }
}

TEST(RequestLimits, KeyFramesAndHeadsAreNotGivenFaster) {
  RequestLimits limits;
  int keys = 0, heads = 0;
  for (int i = 0; i < 1000; ++i) {  // in ten seconds
    const auto request = limits.admit({{StreamId{4}}, {}, {}, true}, kStart + milliseconds(10) * i);
    keys += !request.key_frames.empty(), heads += request.whole_head;
  }
  EXPECT_LE(keys, 41);
  EXPECT_GE(keys, 39);
  EXPECT_LE(heads, 41);
  EXPECT_TRUE(
      limits.admit({{StreamId{5}}, {}, {}}, kStart + seconds(10)).wants_key_frame(StreamId{5}))
      << "another stream";
  EXPECT_GT(limits.refused(), 1900u);
}

TEST(RequestLimits, ManyStreamsMakeNoRoomForOne) {
  RequestLimits limits;
  codec::Control all;
  for (std::uint32_t stream = 0; stream < codec::Control::kMaxStreams; ++stream)
    all.key_frames.push_back(StreamId{stream});
  EXPECT_EQ(limits.admit(all, kStart).key_frames.size(), all.key_frames.size());
  for (StreamId& stream : all.key_frames) stream = StreamId{number_of(stream) + 5000};
  EXPECT_TRUE(limits.admit(all, kStart + milliseconds(1)).key_frames.empty());
  EXPECT_FALSE(
      limits.admit({{StreamId{4}}, {}, {}}, kStart + milliseconds(2)).wants_key_frame(StreamId{4}));
}

TEST(RequestLimits, AnswersHaveABudget) {
  RequestLimits limits;
  std::size_t given = 0;
  const codec::Control all{{}, {{{{0, 0, 0}}, 0, 1}}, {}};
  for (int i = 0; i < 1000; ++i) {  // in a second, each for 5 MB
    if (limits.admit(all, kStart + milliseconds(i)).chunks.empty()) continue;
    limits.answered(5'000'000);
    given += 5'000'000;
  }
  EXPECT_LT(given, 110'000'000u);
  EXPECT_GT(given, 60'000'000u);
  EXPECT_FALSE(limits.admit(all, kStart + seconds(10)).chunks.empty()) << "later again";
}

}  // namespace
}  // namespace mr::node
