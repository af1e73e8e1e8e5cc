#include "mr/still/background.h"

#include <gtest/gtest.h>

#include <limits>

#include "mr/core/parallel.h"
#include "still/room.h"

namespace mr {
namespace {

using still::Background;
using still::BackgroundUpdate;
using test::kAll;
using test::Room;
using test::share;
using test::share_at;

constexpr Rect kPerson{60, 30, 40, 80};

/// Lets captures go by; the last update. `changes`: how often the still picture changed.
BackgroundUpdate watch(Background& background, Room& room, int captures, int* changes = nullptr) {
  BackgroundUpdate out;
  for (int i = 0; i < captures; ++i) {
    out = background.update(room.capture());
    if (changes) *changes += out.still_changed;
    EXPECT_FALSE(out.was_reset) << "capture " << background.captures();
  }
  return out;
}

TEST(Background, StillRoomIsLearntAndThenNeverChanges) {
  Room room;
  Background background = Room::background();
  EXPECT_EQ(share(background.update(room.capture()).moving, kAll), 1);  // as quick as ever
  EXPECT_EQ(share(watch(background, room, 30).moving, kAll), 0);
  EXPECT_GT(share_at(background.still(), kAll, 3, 0.01f), 0.999);
  watch(background, room, 69);
  int changes = 0;
  double moving = 0;
  for (int i = 0; i < 200; ++i) {
    const BackgroundUpdate update = watch(background, room, 1, &changes);
    moving += share(update.moving, kAll);
    EXPECT_GT(share(update.confirmed, kAll), 0.99);
  }
  EXPECT_EQ(changes, 0);
  EXPECT_EQ(moving, 0);
}

TEST(Background, StillPictureIsMoreExactThanOneCapture) {
  Room room;
  Background background = Room::background();
  watch(background, room, 100);
  double sum2 = 0, one2 = 0;
  const ImageDepth one = room.capture();
  for (std::size_t i = 0; i < one.data.size(); ++i) {
    sum2 += std::pow(background.still().data[i] - 3, 2);
    one2 += std::pow(one.data[i] - 3, 2);
  }
  EXPECT_LT(sum2, one2 / 16);  // a quarter of the noise
}

TEST(Background, CapturesThatAreNotSentTeachButDoNotHandOver) {
  Room room;
  Background background = Room::background();
  EXPECT_TRUE(background.is_new());
  for (int i = 0; i < 40; ++i) background.update(room.capture(), false);
  EXPECT_GT(share_at(background.still(), kAll, 3, 0.01f), 0.999);
  EXPECT_EQ(share(watch(background, room, 1).moving, kAll), 1);  // not learnt yet
  EXPECT_EQ(share(watch(background, room, 30).moving, kAll), 0);
  EXPECT_FALSE(background.is_new());
}

TEST(Background, WhoWalksByMovesAndLeavesNothing) {
  Room room;
  Background background = Room::background();
  watch(background, room, 60);
  const ImageDepth before = background.still();
  for (int i = 0; i < 60; ++i) {
    room.boxes = {{{i * 2, 30, 40, 80}, 2}};
    const BackgroundUpdate update = background.update(room.capture());
    const Rect inside{i * 2 + 1, 31, std::min(38, Room::kWidth - i * 2 - 2), 78};
    EXPECT_GT(share(update.moving, inside), 0.99) << i;
    EXPECT_NEAR(share(update.moving, kAll),
                share(update.moving, {i * 2, 30, std::min(40, Room::kWidth - i * 2), 80}) *
                    std::min(40, Room::kWidth - i * 2) * 80 / (160.0 * 120),
                0.01);
  }
  room.boxes.clear();
  EXPECT_EQ(share(watch(background, room, 1).moving, kAll), 0);  // the wall is known
  EXPECT_GT(share_at(background.still(), kAll, 3, 0.01f), 0.999);
  watch(background, room, 20);
  for (std::size_t i = 0; i < before.data.size(); ++i)
    EXPECT_NEAR(background.still().data[i], before.data[i], 0.01);
}

TEST(Background, FeetOnTheFloorBelongToWhoWalks) {
  Room room;
  Background background = Room::background();
  watch(background, room, 60);
  const float foot_m = 3 - 2.0f * static_cast<float>(room.precision.sigma_m(3));
  room.boxes = {{{60, 30, 40, 50}, 2}, {{60, 80, 40, 4}, foot_m}};
  double foot = 0;
  for (int i = 0; i < 20; ++i)
    foot += share(background.update(room.capture()).moving, {60, 80, 40, 4}) / 20;
  EXPECT_GT(foot, 0.55);  // grown from what is clearly nearer
  room.boxes.erase(room.boxes.begin());
  EXPECT_EQ(share(watch(background, room, 1).moving, kAll), 0);
}

/// Where nothing was ever measured either: holes that are to be closed are theirs.
TEST(Background, HairThatDropsOutBelongsToWhoWalks) {
  constexpr Rect kHair{100, 34, 20, 10};
  Room room;
  Background background = Room::background();
  const auto capture = [&] {
    ImageDepth out = room.capture();
    for (int y = 0; y < out.height; ++y)
      for (int x = Room::kWidth / 2; x < out.width; ++x)
        if (*out.at(x, y) > 2.5f) *out.at(x, y) = 0;
    for (int y = kHair.y; y < kHair.y + kHair.height; ++y)
      for (int x = kHair.x + y % 3; x < kHair.x + kHair.width; x += 3) *out.at(x, y) = 0;
    return out;
  };
  for (int i = 0; i < 60; ++i) background.update(capture());
  room.boxes = {{{90, 30, 40, 80}, 2}};
  const BackgroundUpdate update = background.update(capture());
  EXPECT_GT(share(update.moving, kHair), 0.99);
  EXPECT_EQ(share(update.moving, {0, 0, 80, 120}), 0);
}

TEST(Background, WhoWasThereAtTheStartIsForgottenWhenTheyLeave) {
  Room room;
  room.boxes = {{kPerson, 2}};
  Background background = Room::background();
  watch(background, room, 60);
  EXPECT_GT(share_at(background.still(), kPerson, 2), 0.99);
  room.boxes.clear();
  watch(background, room, 28);
  EXPECT_GT(share_at(background.still(), kPerson, 3), 0.98);
  EXPECT_EQ(share(watch(background, room, 10).moving, kAll), 0);
}

/// A person stands in front of an unmeasurable background, which begins at a column, and leaves for
/// `captures`: no farther depth shows that the person left.
void expect_no_shell(int column, int captures) {
  Room room;
  room.too_far = {column, 0, Room::kWidth - column, Room::kHeight};
  room.boxes = {{kPerson, 2}};
  Background background = Room::background();
  watch(background, room, 60);
  EXPECT_GT(share_at(background.still(), kPerson, 2), 0.98);
  room.boxes.clear();
  watch(background, room, captures);
  EXPECT_EQ(share_at(background.still(), kPerson, 2), 0);
  EXPECT_GT(share_at(background.still(), {0, 0, column, Room::kHeight}, 3), 0.99);
}

TEST(Background, WhoStoodBeforeWhatCannotBeMeasuredLeavesNoShell) { expect_no_shell(40, 130); }

/// Hardly anything but people is measured: that they left is no dropout of the sensor.
TEST(Background, WhoFilledMostOfWhatIsMeasuredLeavesNoShell) { expect_no_shell(10, 400); }

/// A bag that gives no depth, for longer than a wall is believed in.
TEST(Background, AWallBehindWhatWasBlackIsSoonKnownAgain) {
  Room room;
  Background background = Room::background();
  watch(background, room, 100);
  room.too_far = kPerson;
  watch(background, room, 200);
  EXPECT_LT(share_at(background.still(), kPerson, 3), 0.2);
  room.too_far = {};
  watch(background, room, 45);  // the next look that takes what is new, and the hand-over
  EXPECT_EQ(share(watch(background, room, 1).moving, kAll), 0);
  EXPECT_GT(share_at(background.still(), kPerson, 3), 0.98);
}

TEST(Background, WhoWalksBeforeWhatCannotBeMeasuredIsNeverLearnt) {
  Room room;
  room.too_far = {40, 0, 120, 120};
  Background background = Room::background();
  watch(background, room, 20);
  for (int pass = 0; pass < 4; ++pass) {
    for (int i = 0; i < 60; ++i) {  // an arm, then the body behind it
      room.boxes = {{{i * 3 - 20, 30, 40, 80}, 2}, {{i * 3 + 15, 50, 20, 8}, 1.8f}};
      const BackgroundUpdate update = watch(background, room, 1);
      if (i == 30) {
        EXPECT_GT(share(update.moving, {72, 32, 36, 70}), 0.99);
      }
    }
    room.boxes.clear();
    watch(background, room, 30);
    EXPECT_EQ(share_at(background.still(), room.too_far, 2, 0.3f), 0) << pass;
  }
}

TEST(Background, WhoSitsBeforeWhatCannotBeMeasuredIsAbsorbedAndLeavesNoShell) {
  Room room;
  room.too_far = {40, 0, 120, 120};
  Background background = Room::background();
  watch(background, room, 60);
  room.boxes = {{kPerson, 2}};
  EXPECT_GT(share(watch(background, room, 100).moving, kPerson), 0.99);
  watch(background, room, 100);
  EXPECT_GT(share_at(background.still(), kPerson, 2), 0.98);
  EXPECT_LT(share(watch(background, room, 12).moving, kPerson), 0.02);
  room.boxes.clear();  // gets up
  watch(background, room, 22);
  EXPECT_EQ(share_at(background.still(), kPerson, 2), 0);
}

TEST(Background, ASensorThatReadsNothingAtFirstLearnsAsQuickly) {
  Room room;
  Background background = Room::background();
  for (int i = 0; i < 30; ++i) background.update(ImageDepth(Room::kWidth, Room::kHeight));
  watch(background, room, 24);
  EXPECT_GT(share_at(background.still(), kAll, 3), 0.99);
}

/// Dark, and bright enough for a while only later: absorbed, and not given back for its dropouts.
TEST(Background, WhatIsReadAtTimesOnlyAfterAWhileStaysToo) {
  Room room;
  room.too_far = {40, 0, 120, 120};
  Background background = Room::background(1);
  watch(background, room, 60);
  room.far_rate = 0.5;
  watch(background, room, 300);
  EXPECT_GT(share_at(background.still(), room.too_far, 3), 0.9);
  int changes = 0;
  watch(background, room, 300, &changes);
  EXPECT_GT(share_at(background.still(), room.too_far, 3), 0.9);
  EXPECT_LT(changes, 4);
}

TEST(Background, WhatIsReadAtTimesOnlyStays) {
  Room room;
  room.too_far = {40, 0, 120, 120}, room.far_rate = 0.35;
  Background background = Room::background();
  watch(background, room, 100);
  const double learnt = share_at(background.still(), room.too_far, 3);
  EXPECT_GT(learnt, 0.95);
  watch(background, room, 500);
  EXPECT_GE(share_at(background.still(), room.too_far, 3), learnt);
}

TEST(Background, RemovalIsNoticedWithinHalfASecond) {
  Room room;
  room.boxes = {{{20, 20, 20, 20}, 2.5f}};
  Background background = Room::background();
  watch(background, room, 100);
  room.boxes.clear();  // a box is carried away
  watch(background, room, 15);
  EXPECT_EQ(share_at(background.still(), {20, 20, 20, 20}, 2.5f), 0);
}

/// Alone it would wait for long: its cube is sent again anyhow.
TEST(Background, WhatIsSmallComesAlongWhereItsCubeChanges) {
  constexpr Rect kSmall{90, 70, 3, 3}, kLarge{100, 75, 20, 20};  // in one cube
  for (const bool with_large : {false, true}) {
    Room room;
    room.boxes = {{kSmall, 2.5f}, {kLarge, 2.5f}};
    Background background = Room::background();
    watch(background, room, 100);
    ASSERT_EQ(share_at(background.still(), kSmall, 2.5f), 1);
    room.boxes = {{kLarge, with_large ? 3 : 2.5f}};
    watch(background, room, 40);
    EXPECT_EQ(share_at(background.still(), kSmall, 2.5f), with_large ? 0 : 1);
  }
}

TEST(Background, WhoSitsForAMinuteIsAbsorbedAndLeavesNoShell) {
  Room room;
  Background background = Room::background();
  watch(background, room, 60);
  room.boxes = {{kPerson, 2}};
  EXPECT_GT(share(watch(background, room, 100).moving, kPerson), 0.99);
  watch(background, room, 100);  // over five seconds
  EXPECT_GT(share_at(background.still(), kPerson, 2), 0.98);
  EXPECT_LT(share(watch(background, room, 12).moving, kPerson), 0.02);
  room.boxes[0].at.x += 30;  // gets up
  watch(background, room, 2);
  int left = 0;
  for (int i = 0; i < 16; ++i) {
    watch(background, room, 1);
    left = share_at(background.still(), {60, 30, 30, 80}, 2) > 0 ? i : left;
  }
  EXPECT_LT(left, 10);
  EXPECT_GT(share_at(background.still(), {60, 30, 30, 80}, 3), 0.98);
}

TEST(Background, WhatSitsForLongerIsForgottenToo) {
  Room room;
  Background background = Room::background(1);
  watch(background, room, 60);
  room.boxes = {{kPerson, 2}};
  watch(background, room, 70 * 30);
  EXPECT_GT(share_at(background.still(), kPerson, 2), 0.98);
  room.boxes.clear();
  watch(background, room, 24);
  EXPECT_GT(share_at(background.still(), kPerson, 3), 0.98);
}

TEST(Background, ChairThatIsMovedStandsWhereItIsNow) {
  Room room;
  room.boxes = {{{30, 60, 30, 40}, 2.5f}};
  Background background = Room::background(2);
  watch(background, room, 90);
  room.boxes[0].at.x = 90;
  const BackgroundUpdate update = watch(background, room, 20);
  EXPECT_GT(share(update.moving, {91, 61, 28, 38}), 0.99);
  EXPECT_GT(share_at(background.still(), {30, 60, 30, 40}, 3), 0.98);
  watch(background, room, 60);
  EXPECT_GT(share_at(background.still(), {90, 60, 30, 40}, 2.5f), 0.98);
}

TEST(Background, DepthThatDropsOutChangesNothing) {
  Room room;
  Background background = Room::background();
  watch(background, room, 60);
  const ImageDepth before = background.still();
  for (int i = 0; i < 90; ++i) {
    const BackgroundUpdate update = background.update(ImageDepth(Room::kWidth, Room::kHeight));
    EXPECT_EQ(share(update.moving, kAll), 0);
    EXPECT_EQ(share(update.confirmed, kAll), 0);
    EXPECT_FALSE(update.was_reset);
  }
  EXPECT_EQ(share(watch(background, room, 1).moving, kAll), 0);
  EXPECT_EQ(background.still(), before);
}

TEST(Background, PushedCameraBeginsAnewAndSaysSo) {
  Room room;
  for (int x = 0; x < 8; ++x) room.boxes.push_back({{x * 20, 0, 20, 120}, 2 + 0.1f * float(x)});
  Background background = Room::background();
  watch(background, room, 60);
  for (auto& box : room.boxes) box.at.x += 10, box.depth_m += box.at.x % 40 < 20 ? 0.1f : -0.1f;
  int told = 0;
  for (int i = 0; i < 40; ++i) told += background.update(room.capture()).was_reset;
  EXPECT_EQ(told, 1);
  EXPECT_EQ(share(watch(background, room, 1).moving, kAll), 0);
  EXPECT_GT(share_at(background.still(), {30, 0, 20, 120}, room.boxes[1].depth_m), 0.9);
}

TEST(Background, SomebodyBeforeTheCameraIsNoPush) {
  Room room;
  Background background = Room::background();
  watch(background, room, 60);
  room.boxes = {{{10, 0, 140, 120}, 0.6f}};
  const BackgroundUpdate update = watch(background, room, 60);
  EXPECT_GT(share(update.moving, {11, 1, 138, 118}), 0.99);
}

TEST(Background, NoiseTwiceWhatIsSaidIsMeasured) {
  Room room;
  room.noise = 2;
  Background background = Room::background();
  watch(background, room, 100);
  EXPECT_NEAR(background.noise(), 2, 0.3);
  int changes = 0;
  double moving = 0;
  for (int i = 0; i < 100; ++i) moving += share(watch(background, room, 1, &changes).moving, kAll);
  EXPECT_LE(changes, 5);  // of some 13 chances: the picture was not as exact yet as it can be
  EXPECT_LT(moving / 100, 0.002);
  EXPECT_GT(share_at(background.still(), kAll, 3), 0.995);
}

TEST(Background, WhereAllMovesNothingIsKept) {
  Room room;
  Background background = Room::background();
  for (int i = 0; i < 100; ++i) {
    room.wall_m = 3 + 0.5f * std::sin(0.5f * static_cast<float>(i));
    EXPECT_GT(share(background.update(room.capture()).moving, kAll), 0.9) << i;
  }
}

TEST(Background, SingleFlipsAtDepthEdgesDoNothing) {
  Room room;
  room.boxes = {{{0, 0, 80, 120}, 2}};
  Background background = Room::background();
  int changes = 0;
  std::mt19937 random(3);
  for (int i = 0; i < 300; ++i) {
    ImageDepth depth = room.capture();
    for (int y = 0; y < Room::kHeight; ++y) {  // either of the two surfaces
      if (random() % 3 == 0) *depth.at(79, y) = *depth.at(82, y);
      if (random() % 3 == 0) *depth.at(80, y) = *depth.at(70, y);
    }
    const BackgroundUpdate update = background.update(depth);
    if (i < 100) continue;
    changes += update.still_changed;
    EXPECT_LT(share(update.moving, kAll), 0.001);
  }
  EXPECT_LE(changes, 4);  // of 25 chances; regions are smallest in a picture as small as this
}

/// A capture in which the pixels of some columns see what is left of them, what is right of them,
/// or something between: two of them mostly, or all alike.
ImageDepth with_mixed_columns(Room& room, int first, int last, double between,
                              std::mt19937& random) {
  ImageDepth depth = room.capture();
  std::uniform_real_distribution<double> uniform;
  for (int y = 0; y < Room::kHeight; ++y)
    for (int x = first; x <= last; ++x) {
      const float left = *depth.at(first - 2, y), right = *depth.at(last + 2, y);
      const double draw = uniform(random);
      *depth.at(x, y) = draw < between ? left + float(uniform(random)) * (right - left)
                        : draw < 0.35 + 0.65 * between ? left
                                                       : right;
    }
  return depth;
}

/// A box before the wall, and columns of mixed pixels beside it; once learnt, nothing moves.
void expect_mixed_columns_rest(Background& background, Room& room, double between) {
  room.boxes = {{{0, 0, 80, 120}, 2}};
  std::mt19937 random(3);
  for (int i = 0; i < 200; ++i) {
    const BackgroundUpdate update =
        background.update(with_mixed_columns(room, 79, 81, between, random));
    if (i < 100) continue;
    EXPECT_LT(share(update.moving, kAll), 0.002) << i;
  }
}

TEST(Background, AtADepthEdgeTheSurfaceThatComesBackMostOftenIsLearnt) {
  Room room;
  Background background = Room::background();
  expect_mixed_columns_rest(background, room, 0);
  EXPECT_GT(share_at(background.still(), {79, 0, 3, 120}, 3), 0.8);
}

TEST(Background, WhatJumpsForEverAtADepthEdgeDoesNotMove) {
  Room room;
  Background background = Room::background();
  expect_mixed_columns_rest(background, room, 1);
  room.boxes.push_back({{70, 30, 40, 80}, 1});  // who stands before it does, wholly
  const BackgroundUpdate update = background.update(room.capture());
  EXPECT_GT(share(update.moving, {71, 31, 38, 78}), 0.99);
}

TEST(Background, DepthThatIsNoDistanceSaysNothing) {
  Room room;
  Background background = Room::background();
  const float impossible[] = {std::numeric_limits<float>::infinity(),
                              std::numeric_limits<float>::quiet_NaN(), -1, 1e30f};
  for (int i = 0; i < 60; ++i) {
    ImageDepth depth = room.capture();
    for (int x = 0; x < Room::kWidth; ++x) *depth.at(x, x % 60) = impossible[x % 4];
    background.update(depth);
  }
  for (int x = 0; x < Room::kWidth; ++x) EXPECT_EQ(*background.still().at(x, x % 60), 0);
  EXPECT_GT(share_at(background.still(), {0, 60, Room::kWidth, 60}, 3), 0.99);
}

TEST(Background, WhatStopsAgainAndAgainIsAbsorbedEachTime) {
  Room room;
  Background background = Room::background(1);
  watch(background, room, 60);
  for (int time = 0; time < 5; ++time) {
    room.boxes = {{kPerson, 2}};
    watch(background, room, 120);
    EXPECT_GT(share_at(background.still(), kPerson, 2), 0.98) << time;
    room.boxes.clear();
    watch(background, room, 40);
    EXPECT_GT(share_at(background.still(), kPerson, 3), 0.98) << time;
  }
}

TEST(Background, SameCapturesGiveTheSameOnAnyNumberOfThreads) {
  const auto run = [](int threads) {
    Room room;
    room.too_far = {60, 0, 100, 120}, room.far_rate = 0.1;
    Background background = Room::background(1);
    std::vector<ImageDepth> out;
    Arena(threads).run([&] {
      for (int i = 0; i < 140; ++i) {
        room.boxes = {{{std::clamp(i - 30, 0, 60), 30, 40, 80}, 2}};
        if (i > 100) room.boxes.clear();
        background.update(room.capture());
        if (i % 10 == 9) out.push_back(background.still());
      }
    });
    return out;
  };
  EXPECT_EQ(run(1), run(8));
}

}  // namespace
}  // namespace mr
