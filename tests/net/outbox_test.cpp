#include "mr/net/outbox.h"

#include <gtest/gtest.h>

#include <atomic>
#include <thread>

#include "net_support.h"

namespace mr::net {
namespace {

using test::text_message;

Message joined(std::span<const Message> messages) {
  std::string all;
  for (const Message& m : messages) all += test::text_of(*m);
  return text_message(all);
}

std::string pop_text(Outbox& outbox) {
  const Message m = outbox.try_pop();
  return m ? test::text_of(*m) : "nothing";
}

TEST(Outbox, OneMessageComesOutAsItIs) {
  Outbox outbox(joined);
  const Message in = text_message("a");
  EXPECT_TRUE(outbox.push(in));
  EXPECT_FALSE(outbox.empty());
  EXPECT_EQ(outbox.try_pop(), in);
  EXPECT_TRUE(outbox.empty());
  EXPECT_EQ(outbox.try_pop(), nullptr);
  EXPECT_FALSE(outbox.push(nullptr));
}

TEST(Outbox, FoldsOldestFirstAndOnlyWhenTaken) {
  int folds = 0;
  Outbox outbox([&](std::span<const Message> messages) {
    ++folds;
    return joined(messages);
  });
  EXPECT_TRUE(outbox.push(text_message("a")));
  EXPECT_FALSE(outbox.push(text_message("b")));
  outbox.push(text_message("c"));
  EXPECT_EQ(folds, 0);
  EXPECT_EQ(pop_text(outbox), "abc");
  EXPECT_EQ(folds, 1);
  EXPECT_EQ(outbox.counts().folded, 2u);
  EXPECT_EQ(outbox.counts().lost, 0u);
}

TEST(Outbox, FoldsAtOnceWhenTooManyWait) {
  Outbox outbox(joined, {.messages = 3});
  for (const char* text : {"a", "b", "c", "d"}) outbox.push(text_message(text));
  EXPECT_EQ(outbox.counts().folded, 3u);
  outbox.push(text_message("e"));
  EXPECT_EQ(pop_text(outbox), "abcde");
  EXPECT_EQ(outbox.counts().folded, 4u);
}

TEST(Outbox, LosesWhatWaitsAboveTheByteCapAndKeepsTheNewest) {
  Outbox outbox(joined, {.messages = 100, .bytes = 10});
  outbox.push(text_message("12345"));
  outbox.push(text_message("67890"));
  outbox.push(text_message("x"));
  EXPECT_EQ(outbox.counts().lost, 2u);
  EXPECT_EQ(pop_text(outbox), "x");
  EXPECT_FALSE(outbox.push(text_message("much too large")));
  EXPECT_EQ(outbox.counts().lost, 3u);
  EXPECT_TRUE(outbox.empty());
  outbox.push(text_message("1234567890"));  // the room is free again
  EXPECT_EQ(pop_text(outbox), "1234567890");
}

TEST(Outbox, WithoutCoalesceKeepsTheOrderAndLosesAllThatWait) {
  Outbox outbox(nullptr, {.messages = 2});
  outbox.push(text_message("a"));
  outbox.push(text_message("b"));
  EXPECT_EQ(pop_text(outbox), "a");
  EXPECT_EQ(pop_text(outbox), "b");
  for (const char* text : {"c", "d", "e"}) outbox.push(text_message(text));
  EXPECT_EQ(outbox.counts().lost, 2u);
  EXPECT_EQ(pop_text(outbox), "e");
}

TEST(Outbox, WhatCannotBeFoldedIsLost) {
  Outbox outbox([](auto) { return Message(); }, {.messages = 2});
  outbox.push(text_message("a"));
  outbox.push(text_message("b"));
  EXPECT_EQ(pop_text(outbox), "nothing");
  EXPECT_EQ(outbox.counts().lost, 2u);
  for (const char* text : {"c", "d", "e"}) outbox.push(text_message(text));
  EXPECT_EQ(outbox.counts().lost, 5u);
  EXPECT_TRUE(outbox.push(text_message("f")));
  EXPECT_EQ(pop_text(outbox), "f");
}

TEST(Outbox, PopWaitsAndStops) {
  Outbox outbox(joined);
  std::atomic<int> got = 0;
  std::jthread worker([&](const std::stop_token& stop) {
    while (outbox.pop(stop)) ++got;
  });
  outbox.push(text_message("a"));
  EXPECT_TRUE(test::eventually([&] { return got == 1; }));
  outbox.push(text_message("b"));
  EXPECT_TRUE(test::eventually([&] { return got == 2; }));
  worker.request_stop();
  worker.join();
}

TEST(Outbox, EveryMessageIsTakenFoldedOrLost) {
  constexpr int kThreads = 3, kEach = 2000;
  Outbox outbox(test::newest, {.messages = 5, .bytes = 64});
  std::uint64_t taken = 0;
  {
    std::vector<std::jthread> pushers;
    for (int t = 0; t < kThreads; ++t)
      pushers.emplace_back([&] {
        for (int i = 0; i < kEach; ++i)
          outbox.push(test::message(static_cast<std::size_t>(i % 20)));
      });
    for (int i = 0; i < 2000; ++i) taken += outbox.try_pop() ? 1 : 0;
  }
  while (outbox.try_pop()) ++taken;
  EXPECT_EQ(taken + outbox.counts().folded + outbox.counts().lost, std::uint64_t{kThreads * kEach});
}

}  // namespace
}  // namespace mr::net
