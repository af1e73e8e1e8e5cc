#include <gtest/gtest.h>

#include <atomic>
#include <thread>

#include "mr/net/transport.h"
#include "net_support.h"

namespace mr::net {
namespace {

using test::text_message;

TEST(InProcess, DeliversOnThePublishersThread) {
  const auto transport = make_in_process_transport();
  std::thread::id thread;
  Message got;
  const auto a = transport->subscribe("n", [&](Message m) {
    got = std::move(m);
    thread = std::this_thread::get_id();
  });
  int others = 0;
  const auto b = transport->subscribe("n", [&](const Message&) { ++others; });
  const auto c = transport->subscribe("m", [&](const Message&) { others += 100; });
  const Message sent = text_message("x");
  transport->publish("n", sent);
  EXPECT_EQ(got, sent);
  EXPECT_EQ(thread, std::this_thread::get_id());
  EXPECT_EQ(others, 1);
  EXPECT_TRUE(transport->drops().empty());
}

TEST(InProcess, AnswersRequests) {
  const auto transport = make_in_process_transport();
  std::string got;
  const auto ask = [&] {
    got.clear();
    transport->request("n", text_message("q"), [&](const Message& m) { got = test::text_of(*m); });
    return got;
  };
  EXPECT_EQ(ask(), "");
  {
    const auto served = transport->serve("n", [](std::span<const std::byte> request) {
      return text_message(test::text_of(request) + "!");
    });
    EXPECT_EQ(ask(), "q!");
    const auto newer = transport->serve("n", [](auto) { return Message(); });
    EXPECT_EQ(ask(), "");
  }
  EXPECT_EQ(ask(), "");
}

TEST(InProcess, SubscriptionMayEndItselfAndOutliveTheTransport) {
  auto transport = make_in_process_transport();
  int calls = 0;
  std::unique_ptr<Subscription> own;
  own = transport->subscribe("n", [&](const Message&) {
    ++calls;
    own.reset();
  });
  auto other = transport->subscribe("n", [](const Message&) {});
  transport->publish("n", text_message("x"));
  transport->publish("n", text_message("x"));
  EXPECT_EQ(calls, 1);
  transport.reset();
  other.reset();
}

TEST(InProcess, NoCallbackRunsAfterTheEnd) {
  const auto transport = make_in_process_transport();
  std::atomic<bool> stop = false;
  std::jthread publisher([&] {
    while (!stop) transport->publish("n", text_message("x"));
  });
  for (int round = 0; round < 200; ++round) {
    auto alive = std::make_unique<std::atomic<int>>(0);
    auto subscription =
        transport->subscribe("n", [state = alive.get()](const Message&) { ++*state; });
    if (round % 4 == 0) {
      EXPECT_TRUE(test::eventually([&] { return *alive > 0; }));
    }
    subscription.reset();
    alive.reset();  // a late callback would write to freed memory: the sanitizers see it
  }
  stop = true;
}

TEST(InProcess, TheEndWaitsForARunningCallback) {
  const auto transport = make_in_process_transport();
  std::atomic<bool> inside = false, go_on = false, finished = false;
  auto subscription = transport->subscribe("n", [&](const Message&) {
    inside = true;
    while (!go_on) std::this_thread::yield();
    finished = true;
  });
  std::jthread publisher([&] { transport->publish("n", text_message("x")); });
  ASSERT_TRUE(test::eventually([&] { return inside.load(); }));
  std::jthread releaser([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
    go_on = true;
  });
  subscription.reset();
  EXPECT_TRUE(finished);
}

}  // namespace
}  // namespace mr::net
