#include "mr/net/emulated_transport.h"

#include <gtest/gtest.h>

#include <vector>

#include "net/net_support.h"

namespace mr::net {
namespace {

using std::chrono::milliseconds;

constexpr TimePoint at(int ms) { return TimePoint{milliseconds(ms)}; }

/// Packets of one node as they reach one subscriber.
struct Arrived {
  explicit Arrived(EmulatedTransport& transport)
      : subscription(transport.subscribe("cam", [this, &transport](const Message& packet) {
          times.push_back(transport.now());
          sizes.push_back(packet->size());
        })) {}
  std::vector<TimePoint> times;
  std::vector<std::size_t> sizes;
  std::unique_ptr<Subscription> subscription;
};

TEST(EmulatedTransport, PacketsTakeTheDelay) {
  EmulatedTransport transport({.delay = milliseconds(20)});
  Arrived arrived(transport);
  transport.publish("cam", test::message(10));
  transport.advance(at(19));
  EXPECT_TRUE(arrived.times.empty());
  transport.publish("cam", test::message(11));
  transport.advance(at(100));
  EXPECT_EQ(arrived.times, (std::vector<TimePoint>{at(20), at(39)}));
  EXPECT_EQ(arrived.sizes, (std::vector<std::size_t>{10, 11}));
}

TEST(EmulatedTransport, ARateMakesThemWaitForEachOtherAndAFullQueueLosesThem) {
  EmulatedTransport transport({.bytes_per_s = 1000, .queue_bytes = 250});
  Arrived arrived(transport);
  for (int i = 0; i < 3; ++i) transport.publish("cam", test::message(100));
  transport.advance(at(100));
  transport.publish("cam", test::message(100));
  transport.advance(at(1000));
  EXPECT_EQ(arrived.times, (std::vector<TimePoint>{at(100), at(200), at(300)}));
  EXPECT_EQ(transport.drops(),
            (std::map<std::string, std::uint64_t>{{"cam: no room in the queue of its link", 1}}));
}

TEST(EmulatedTransport, LossesAreThoseOfTheSeed) {
  const auto run = [](std::uint64_t seed) {
    EmulatedTransport transport({.loss = 0.2, .seed = seed});
    Arrived arrived(transport);
    for (std::size_t i = 1; i <= 1000; ++i) transport.publish("cam", test::message(i));
    transport.advance(at(0));
    EXPECT_EQ(arrived.sizes.size() + transport.drops().at("cam: lost on its link"), 1000u);
    return arrived.sizes;
  };
  const auto first = run(1);
  EXPECT_NEAR(static_cast<double>(first.size()), 800, 40);
  EXPECT_EQ(run(1), first);
  EXPECT_NE(run(2), first);
}

TEST(EmulatedTransport, AnAnswerComesAfterBothWaysOrNotAtAll) {
  EmulatedTransport transport({.delay = milliseconds(30)});
  std::vector<TimePoint> asked, answered;
  const auto service = transport.serve("cam", [&](std::span<const std::byte>) {
    asked.push_back(transport.now());
    return test::message(5);
  });
  transport.request("cam", test::message(1),
                    [&](const Message&) { answered.push_back(transport.now()); });
  transport.request("nobody", test::message(1), [&](const Message&) { ADD_FAILURE(); });
  transport.request("cam", test::message(1), {});
  transport.advance(at(1000));
  EXPECT_EQ(asked, (std::vector<TimePoint>{at(30), at(30)}));
  EXPECT_EQ(answered, std::vector<TimePoint>{at(60)});

  transport.set_link("cam", {.delay = milliseconds(1500)});
  transport.request("cam", test::message(1), [&](const Message&) { ADD_FAILURE() << "after 3 s"; });
  transport.advance(at(10'000));
  EXPECT_EQ(asked.size(), 3u);
}

TEST(EmulatedTransport, WhoLeftGetsNothingThatWasUnderWay) {
  EmulatedTransport transport({.delay = milliseconds(20)});
  Arrived arrived(transport);
  transport.publish("cam", test::message(1));
  arrived.subscription.reset();
  transport.advance(at(100));
  EXPECT_TRUE(arrived.times.empty());
}

}  // namespace
}  // namespace mr::net
