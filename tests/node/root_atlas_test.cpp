#include "mr/node/root_atlas.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

namespace mr::node {
namespace {

constexpr Rect kWhole{0, 0, 1280, 720};

bool holds(const Rect& rect, const Rect& part) {
  return part.x >= rect.x && part.y >= rect.y && part.x + part.width <= rect.x + rect.width &&
         part.y + part.height <= rect.y + rect.height;
}

TEST(Window, StaysWhileItHoldsWhatIsWanted) {
  RootAtlas::Window window;
  Rect settled;
  for (int i = 0; i < 120; ++i) {
    const int way = i % 40 - 20;
    const Rect rect = window.follow({500 + way, 200 + way / 2, 300, 400}, kWhole);
    if (i < 40) settled = rect;
    ASSERT_EQ(rect, settled) << i;
  }
}

TEST(Window, HoldsWhateverIsWantedAndNothingBeyondThePicture) {
  std::mt19937 random(3);
  const auto below = [&](int n) { return static_cast<int>(random() % static_cast<unsigned>(n)); };
  RootAtlas::Window window;
  for (const Rect& whole : {kWhole, Rect{8, 4, 633, 359}})
    for (int i = 0; i < 20'000; ++i) {
      Rect wanted{whole.x + below(whole.width), whole.y + below(whole.height), 0, 0};
      wanted.width = 1 + below(whole.x + whole.width - wanted.x);
      wanted.height = 1 + below(whole.y + whole.height - wanted.y);
      const Rect rect = window.follow(wanted, whole);
      ASSERT_TRUE(holds(rect, wanted)) << i;
      ASSERT_TRUE(holds(whole, rect)) << i;
    }
}

TEST(Window, MovesSeldomWithSomebodyWhoWalks) {
  RootAtlas::Window window;
  Rect last;
  int changes = 0;
  for (int x = 0; x + 260 <= kWhole.width; x += 4) {
    const int sway = x / 4 % 7;
    const Rect now = window.follow({x + sway, 100, 250, 560}, kWhole);
    changes += now != last, last = now;
  }
  EXPECT_LE(changes, 8);
}

TEST(Window, ShrinksOnceLittleIsWantedForLong) {
  RootAtlas::Window window;
  window.follow({0, 0, 1000, 700}, kWhole);
  Rect rect;
  for (int i = 0; i < 100; ++i) rect = window.follow({300, 300, 100, 100}, kWhole);
  EXPECT_LE(rect.width, 256);
  EXPECT_LE(rect.height, 256);
  EXPECT_TRUE(holds(rect, {300, 300, 100, 100}));
}

}  // namespace
}  // namespace mr::node
