#include <gtest/gtest.h>

#include <atomic>
#include <mutex>

#include "mr/net/frames.h"
#include "mr/net/requests.h"
#include "mr/net/transport.h"
#include "net_support.h"

namespace mr::net {
namespace {

using namespace std::chrono_literals;
using test::eventually;
using test::publish_until;
using test::Receiver;
using test::text_message;

std::string here(int port) { return "127.0.0.1:" + std::to_string(port); }

std::unique_ptr<Transport> tcp(const std::map<std::string, std::string>& addresses,
                               const TransportLimits& limits = {}) {
  auto transport = make_tcp_transport(addresses, test::newest, limits);
  EXPECT_TRUE(transport) << (transport ? "" : transport.error().message);
  return std::move(*transport);
}

std::string frame(FrameKind kind, const std::string& payload = {}) {
  const auto header = encode_frame_header(kind, 1, payload.size());
  return test::text_of(header) + payload;
}

TEST(Tcp, DeliversToSeveralAndAnswersRequests) {
  const std::map<std::string, std::string> addresses = {{"n", here(test::free_port())}};
  const auto producer = tcp(addresses);
  const auto a = tcp(addresses), b = tcp(addresses);
  Receiver at_a(*a, "n"), at_b(*b, "n"), at_home(*producer, "n");
  const auto served = producer->serve("n", [](std::span<const std::byte> question) {
    return question.empty() ? nullptr : text_message(test::text_of(question) + "!");
  });
  EXPECT_TRUE(publish_until(*producer, "n",
                            [&] { return at_a.count > 0 && at_b.count > 0 && at_home.count > 0; }));
  producer->publish("n", test::message(3000000));
  EXPECT_TRUE(eventually([&] { return at_a.last_bytes == 3000000 && at_b.last_bytes == 3000000; }));

  std::atomic<int> answers = 0;
  a->request("n", text_message(""), [&](const Message&) { answers += 100; });
  for (int i = 0; i < 20; ++i)
    a->request("n", text_message("q" + std::to_string(i)), [&, i](const Message& m) {
      EXPECT_EQ(test::text_of(*m), "q" + std::to_string(i) + "!");
      ++answers;
    });
  EXPECT_TRUE(eventually([&] { return answers == 20; }));
}

TEST(Tcp, ConsumerFirstAndProducerRestarted) {
  const std::map<std::string, std::string> addresses = {{"n", here(test::free_port())}};
  test::Lines lines;
  const auto consumer = tcp(addresses, {.log = [&](const std::string& line) { lines.add(line); }});
  Receiver receiver(*consumer, "n");
  EXPECT_TRUE(eventually([&] { return lines.count("trying on") == 1; }));
  std::atomic<int> answers = 0;
  consumer->request("n", text_message("q"), [&](const Message&) { ++answers; });
  for (int round = 0; round < 2; ++round) {
    const int before = receiver.count;
    const auto producer = tcp(addresses);
    const auto served = producer->serve("n", [](auto) { return text_message("a"); });
    EXPECT_TRUE(publish_until(*producer, "n", [&] { return receiver.count > before; }));
    EXPECT_TRUE(eventually([&] { return lines.count("is back") == round + 1; }));
  }
  EXPECT_EQ(answers, 1);  // asked before there was anyone to answer
  EXPECT_TRUE(eventually([&] { return lines.count("trying on") == 3; }));
}

TEST(Tcp, SlowReaderHoldsUpNobody) {
  const int port = test::free_port();
  const std::map<std::string, std::string> addresses = {{"n", here(port)}};
  const auto producer = tcp(addresses);
  const auto consumer = tcp(addresses);
  Receiver receiver(*consumer, "n");
  ASSERT_TRUE(publish_until(*producer, "n", [&] { return receiver.count > 0; }));
  test::RawSocket slow(port, 65536);
  ASSERT_TRUE(slow.send(frame(FrameKind::hello, "MRT1n") + frame(FrameKind::subscribe)));
  ASSERT_TRUE(publish_until(*producer, "n", [&] { return slow.readable(); }));
  const auto started = test::Clock::now();
  auto longest = 0ns;
  for (int i = 0; i < 300; ++i) {
    const int before = receiver.count;
    const auto asked = test::Clock::now();
    producer->publish("n", test::message(200000));
    longest = std::max(longest, std::chrono::nanoseconds(test::Clock::now() - asked));
    ASSERT_TRUE(eventually([&] { return receiver.count > before; })) << i;
  }
  EXPECT_LT(longest, 200ms);
  EXPECT_LT(test::Clock::now() - started, 8s);
  EXPECT_GT(test::dropped(*producer, "packets folded"), 30u);
}

TEST(Tcp, BadPeersAreCutOffAndOthersGoOn) {
  const int port = test::free_port();
  const std::map<std::string, std::string> addresses = {{"n", here(port)}, {"m", here(port)}};
  const auto producer = tcp(addresses);
  const auto consumer = tcp(addresses);
  Receiver receiver(*consumer, "n");
  ASSERT_TRUE(publish_until(*producer, "n", [&] { return receiver.count > 0; }));
  const std::string hello = frame(FrameKind::hello, "MRT1n");
  const auto huge = encode_frame_header(FrameKind::ask, 1, 0xFFFFFFFF);
  const std::vector<std::string> bad = {"GET / HTTP/1.1\r\n\r\n",
                                        std::string(100, '\0'),
                                        std::string(100, '\xFF'),
                                        frame(FrameKind::subscribe),
                                        frame(FrameKind::hello, "nope"),
                                        frame(FrameKind::hello, "MRT1m"),
                                        frame(FrameKind::hello, std::string(300, 'x')),
                                        hello + hello,
                                        hello + frame(FrameKind::packet, "x"),
                                        hello + frame(static_cast<FrameKind>(77)),
                                        hello + test::text_of(huge)};
  for (const std::string& bytes : bad) {
    test::RawSocket peer(port);
    ASSERT_TRUE(peer.send(bytes));
    EXPECT_TRUE(peer.closed_by_peer()) << bytes.substr(0, 40);
  }
  test::RawSocket(port).send(hello.substr(0, 7));  // half a frame, then gone
  EXPECT_TRUE(eventually([&] { return test::dropped(*producer, "peer 127.0.0.1") >= bad.size(); }));
  EXPECT_EQ(test::dropped(*producer, "node that is not here"), 1u);
  const int before = receiver.count;
  producer->publish("n", text_message("x"));
  EXPECT_TRUE(eventually([&] { return receiver.count > before; }));
}

TEST(Tcp, SilentPeerIsCutOffInTime) {
  const int port = test::free_port();
  const auto producer = tcp({{"n", here(port)}});
  producer->publish("n", text_message("x"));
  ASSERT_TRUE(eventually([&] { return test::RawSocket(port).connected(); }));
  test::RawSocket silent(port);
  ASSERT_TRUE(silent.send("M"));
  EXPECT_TRUE(silent.closed_by_peer(8s));
  EXPECT_TRUE(eventually([&] { return test::dropped(*producer, "no greeting in time") == 1; }));
}

TEST(Tcp, BadProducerIsLeftAndTriedAgain) {
  const test::HeldPort held;
  const auto consumer = tcp({{"n", here(held.port())}}, {.message_bytes = 1000});
  Receiver receiver(*consumer, "n");
  const std::pair<std::string, std::string> bad[] = {
      {"HTTP/1.1 400 Bad Request\r\n\r\n", "unexpected kind of frame"},
      {frame(FrameKind::packet, std::string(1001, 'x')), "frame too large"}};
  for (const auto& [bytes, cause] : bad) {
    const int peer = ::accept(held.handle(), nullptr, nullptr);
    ASSERT_GE(peer, 0);
    EXPECT_EQ(::send(peer, bytes.data(), bytes.size(), MSG_NOSIGNAL),
              static_cast<::ssize_t>(bytes.size()));
    EXPECT_TRUE(
        eventually([&, name = "node n: " + cause] { return test::dropped(*consumer, name) > 0; }));
    ::close(peer);
  }
  EXPECT_EQ(receiver.count, 0);
}

TEST(Tcp, PortInUseIsToldOnceAndTriedAgain) {
  auto held = std::make_unique<test::HeldPort>();
  const std::map<std::string, std::string> addresses = {{"n", here(held->port())}};
  test::Lines lines;
  const auto producer = tcp(addresses, {.log = [&](const std::string& line) { lines.add(line); }});
  producer->publish("n", text_message("x"));
  ASSERT_TRUE(
      eventually([&] { return lines.count("cannot listen on " + addresses.at("n")) == 1; }));
  held.reset();
  const auto consumer = tcp(addresses);
  Receiver receiver(*consumer, "n");
  EXPECT_TRUE(publish_until(*producer, "n", [&] { return receiver.count > 0; }));
  EXPECT_EQ(lines.count("cannot listen"), 1);
  EXPECT_EQ(lines.count("listening on"), 1);
}

TEST(Tcp, NamesAndIpv6) {
  for (const std::string host : {"localhost", "[::1]"}) {
    const std::map<std::string, std::string> addresses = {
        {"n", host + ":" + std::to_string(test::free_port())}};
    const auto producer = tcp(addresses);
    const auto consumer = tcp(addresses);
    Receiver receiver(*consumer, "n");
    EXPECT_TRUE(publish_until(*producer, "n", [&] { return receiver.count > 0; })) << host;
  }
}

TEST(Tcp, NeverMoreConnectionsThanAllowed) {
  const int port = test::free_port();
  const auto producer = tcp({{"n", here(port)}}, {.connections = 3});
  producer->publish("n", text_message("x"));
  ASSERT_TRUE(eventually([&] { return test::RawSocket(port).connected(); }));
  {
    std::vector<test::RawSocket> peers;
    for (int i = 0; i < 10; ++i) peers.emplace_back(port);
    ASSERT_TRUE(eventually([&] { return test::dropped(*producer, "too many connections") >= 7; }));
  }
  const auto consumer = tcp({{"n", here(port)}});
  Receiver receiver(*consumer, "n");
  EXPECT_TRUE(publish_until(*producer, "n", [&] { return receiver.count > 0; }));
}

TEST(Tcp, AnEndedSubscriptionIsLeftAlone) {
  const std::map<std::string, std::string> addresses = {{"n", here(test::free_port())}};
  const auto producer = tcp(addresses), consumer = tcp(addresses);
  for (int round = 0; round < 20; ++round) {
    auto receiver = std::make_unique<Receiver>(*consumer, "n");
    ASSERT_TRUE(publish_until(*producer, "n", [&] { return receiver->count > 0; }));
    receiver.reset();  // the sanitizers see a late callback
    producer->publish("n", text_message("x"));
  }
}

TEST(Tcp, RequestsWithoutAnAnswerAreForgotten) {
  const auto consumer = tcp({{"n", here(test::free_port())}});
  const auto state = std::make_shared<int>(0);
  consumer->request("n", text_message("q"), [state](const Message&) { ++*state; });
  for (int i = 0; i < 2000; ++i) consumer->request("n", text_message("q"), [](const Message&) {});
  EXPECT_GT(test::dropped(*consumer, "too many requests"), 900u);
  EXPECT_TRUE(eventually([&] { return state.use_count() == 1; }));
  EXPECT_TRUE(
      eventually([&] { return test::dropped(*consumer, "requests without an answer") == 1024; }));
}

TEST(Tcp, WordsThatNeedNoAnswerWaitForNone) {
  const std::map<std::string, std::string> addresses = {{"n", here(test::free_port())}};
  const auto consumer = tcp(addresses), producer = tcp(addresses);
  std::atomic<int> heard = 0;
  const auto served = producer->serve("n", [&](auto) {
    ++heard;
    return nullptr;
  });
  for (int i = 1; i <= 3000; ++i) {
    consumer->request("n", text_message("taken"));
    if (i % 500 != 0) continue;
    ASSERT_TRUE(eventually([&] { return heard == i; }));
  }
  std::this_thread::sleep_for(Requests::kPatience + 1s);
  EXPECT_TRUE(consumer->drops().empty());
}

TEST(Tcp, BadAddressesAreAllTold) {
  const auto transport =
      make_tcp_transport({{"a", "host"}, {"b", "host:1"}, {"c", "host:x"}}, test::newest);
  ASSERT_FALSE(transport);
  EXPECT_EQ(transport.error().cause, Error::Cause::invalid);
  EXPECT_NE(transport.error().message.find("node a:"), std::string::npos);
  EXPECT_NE(transport.error().message.find("node c:"), std::string::npos);
  EXPECT_EQ(transport.error().message.find("node b:"), std::string::npos);
}

TEST(Tcp, NodesWithoutAnAddressAreCounted) {
  const auto transport = tcp({});
  transport->publish("n", text_message("x"));
  const auto subscription = transport->subscribe("n", [](const Message&) {});
  EXPECT_EQ(test::dropped(*transport, "node n: has no address"), 2u);
}

}  // namespace
}  // namespace mr::net
