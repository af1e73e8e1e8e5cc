#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <mutex>

#include "certificates.h"

#include "mr/net/frames.h"
#include "mr/net/pending_requests.h"
#include "mr/net/transport.h"
#include "net_support.h"

namespace mr::net {
namespace {

using namespace std::chrono_literals;
using test::eventually;
using test::publish_until;
using test::Receiver;
using test::text_message;
using testing::HasSubstr;
using testing::Not;

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
  const auto served = producer->serve("n", [](std::span<const std::byte> request) {
    return request.empty() ? nullptr : text_message(test::text_of(request) + "!");
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
  const auto huge = encode_frame_header(FrameKind::request, 1, 0xFFFFFFFF);
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
  std::this_thread::sleep_for(PendingRequests::kPatience + 1s);
  EXPECT_TRUE(consumer->drops().empty());
}

const std::string kSecret = "0123456789abcdefghij", kOtherSecret = "another-secret-of-some-length";

/// A program with the lines that it logs.
struct Program {
  test::Lines lines;
  std::unique_ptr<Transport> transport;

  explicit Program(const std::map<std::string, std::string>& addresses,
                   const std::string& secret = {}, TransportLimits limits = {}) {
    limits.log = [this](const std::string& line) { lines.add(line); };
    auto made = make_tcp_transport(addresses, test::newest, limits, secret);
    EXPECT_TRUE(made) << (made ? "" : made.error().message);
    transport = std::move(*made);
  }
};

TEST(TcpSecret, JoinsThoseWhoKnowIt) {
  const std::map<std::string, std::string> addresses = {{"n", here(test::free_port())}};
  Program producer(addresses, kSecret), consumer(addresses, kSecret);
  Receiver receiver(*consumer.transport, "n");
  const auto served = producer.transport->serve(
      "n", [](std::span<const std::byte> request) { return test::message(request.size() * 1000); });
  ASSERT_TRUE(publish_until(*producer.transport, "n", [&] { return receiver.count > 0; }));
  producer.transport->publish("n", test::message(30 << 20));
  EXPECT_TRUE(eventually([&] { return receiver.last_bytes == 30 << 20; }));
  std::atomic<std::size_t> got = 0;
  consumer.transport->request("n", test::message(3000), [&](const Message& m) { got = m->size(); });
  EXPECT_TRUE(eventually([&] { return got == 3000000; }));
  EXPECT_TRUE(producer.lines.all().empty()) << testing::PrintToString(producer.lines.all());
  EXPECT_LE(consumer.lines.all().size(), 2u) << "at most away at first, and back";
}

// Peers without the right secret get the reason in one line, and the node logs it; peers with the
// secret are not affected.
TEST(TcpSecret, OthersAreRefusedWithTheReasonOnBothSides) {
  const struct {
    std::string listens, connects, reason;
  } cases[] = {
      {kSecret, kOtherSecret, "the two sides have different secrets; tcp.secret must be the same"},
      {kSecret, "", "only the side that listens has a secret (tcp.secret)"},
      {"", kSecret, "only the side that connects has a secret (tcp.secret)"}};
  for (const auto& [listens, connects, reason] : cases) {
    const std::map<std::string, std::string> addresses = {{"n", here(test::free_port())}};
    Program node(addresses, listens), friendly(addresses, listens);
    Receiver known(*friendly.transport, "n");
    ASSERT_TRUE(publish_until(*node.transport, "n", [&] { return known.count > 0; }));
    Program stranger(addresses, connects);
    Receiver unknown(*stranger.transport, "n");
    EXPECT_TRUE(eventually([&, r = reason] {
      node.transport->publish("n", text_message("x"));
      return stranger.lines.count(r) > 0 && test::dropped(*node.transport, r) > 2;
    })) << reason
        << testing::PrintToString(stranger.lines.all()) << testing::PrintToString(node.lines.all());
    EXPECT_EQ(stranger.lines.all().size(), 1u) << testing::PrintToString(stranger.lines.all());
    EXPECT_EQ(node.lines.all().size(), 1u) << testing::PrintToString(node.lines.all());
    EXPECT_EQ(node.lines.count("peer 127.0.0.1: " + reason), 1);
    EXPECT_EQ(stranger.lines.count(kSecret) + stranger.lines.count(kOtherSecret), 0);
    EXPECT_EQ(unknown.count, 0);
    const int before = known.count;
    EXPECT_TRUE(publish_until(*node.transport, "n", [&] { return known.count > before; }));
  }
}

TEST(TcpSecret, ACertificateIsNoSecret) {
  test::Certificates certificates;
  certificates.sign("server", "IP:127.0.0.1");
  const int port = test::free_port();
  const std::string command = "exec openssl s_server -quiet -accept " + here(port) + " -cert " +
                              (certificates / "server.pem").string() + " -key " +
                              (certificates / "server.key").string() + " 2>/dev/null";
  const test::Child server({"/bin/sh", "-c", command});
  ASSERT_TRUE(eventually([&] { return test::RawSocket(port).connected(); }));
  Program consumer({{"n", here(port)}}, kSecret);
  Receiver receiver(*consumer.transport, "n");
  EXPECT_TRUE(eventually([&] { return test::dropped(*consumer.transport, "certificate") > 0; }))
      << testing::PrintToString(consumer.lines.all());
  EXPECT_EQ(receiver.count, 0);
}

TEST(TcpSecret, BrokenHandshakesAreCutOffAndOthersGoOn) {
  const int port = test::free_port();
  const std::map<std::string, std::string> addresses = {{"n", here(port)}};
  Program node(addresses, kSecret), friendly(addresses, kSecret);
  Receiver known(*friendly.transport, "n");
  ASSERT_TRUE(publish_until(*node.transport, "n", [&] { return known.count > 0; }));
  const std::string record = std::string("\x16\x03\x01\x00\x10", 5);
  for (const std::string& bytes :
       {record + std::string(16, '\xFF'), record + std::string(16, '\0'),
        std::string("\x16\x03\xFF\xFF\xFF", 5) + std::string(70000, 'x')}) {
    test::RawSocket peer(port);
    peer.send(bytes);
    EXPECT_TRUE(peer.closed_by_peer());
  }
  test::RawSocket silent(port);
  ASSERT_TRUE(silent.send(record));
  EXPECT_TRUE(silent.closed_by_peer());
  EXPECT_TRUE(
      eventually([&] { return test::dropped(*node.transport, "no greeting in time") == 1; }));
  const int before = known.count;
  EXPECT_TRUE(publish_until(*node.transport, "n", [&] { return known.count > before; }));
}

TEST(TcpSecret, AShortOneIsRefused) {
  const auto made = make_tcp_transport({}, test::newest, {}, "fifteen letters");
  ASSERT_FALSE(made);
  EXPECT_THAT(made.error().message, HasSubstr("tcp.secret must have 16 characters or more"));
  EXPECT_THAT(made.error().message, Not(HasSubstr("fifteen")));
}

TEST(Tcp, RefusalsAreToldOnBothSides) {
  const int port = test::free_port();
  Program node({{"n", here(port)}});
  node.transport->publish("n", text_message("x"));
  Program lost({{"m", here(port)}});
  Receiver receiver(*lost.transport, "m");
  EXPECT_TRUE(eventually([&] {
    return lost.lines.count("refused: asks for a node that is not here; trying on") == 1 &&
           node.lines.count("peer 127.0.0.1: asks for a node that is not here") == 1;
  })) << testing::PrintToString(lost.lines.all());
  EXPECT_TRUE(eventually([&] { return test::dropped(*node.transport, "is not here") > 2; }));
  EXPECT_EQ(node.lines.all().size(), 1u);
  EXPECT_LE(lost.lines.all().size(), 2u);  // it may have been there before the node
}

TEST(Tcp, TooManyConnectionsAreToldOnBothSides) {
  for (const std::string& secret : {std::string(), kSecret})
    for (const TransportLimits& limits :
         {TransportLimits{.connections = 2}, TransportLimits{.connections_per_address = 2}}) {
      const std::map<std::string, std::string> addresses = {{"n", here(test::free_port())}};
      Program node(addresses, secret, limits);
      Program a(addresses, secret), b(addresses, secret);
      Receiver at_a(*a.transport, "n"), at_b(*b.transport, "n");
      ASSERT_TRUE(
          publish_until(*node.transport, "n", [&] { return at_a.count > 0 && at_b.count > 0; }));
      Program c(addresses, secret);
      Receiver at_c(*c.transport, "n");
      EXPECT_TRUE(eventually([&] {
        return c.lines.count("refused: too many connections; trying on") == 1 &&
               node.lines.count("peer 127.0.0.1: too many connections") == 1;
      })) << testing::PrintToString(c.lines.all());
      const int before = at_a.count;
      EXPECT_TRUE(publish_until(*node.transport, "n", [&] { return at_a.count > before; }));
      EXPECT_EQ(at_c.count, 0);
    }
}

// Silent connections do not keep others out.
TEST(Tcp, ANewcomerReplacesWhoHasNotGreeted) {
  const int port = test::free_port();
  const std::map<std::string, std::string> addresses = {{"n", here(port)}};
  Program node(addresses, "", {.connections = 3});
  Program consumer(addresses);
  Receiver receiver(*consumer.transport, "n");
  ASSERT_TRUE(publish_until(*node.transport, "n", [&] { return receiver.count > 0; }));
  std::vector<test::RawSocket> silent;
  for (int i = 0; i < 3; ++i) silent.emplace_back(port);
  EXPECT_TRUE(silent[0].closed_by_peer(4000ms));
  Program late(addresses);
  Receiver at_late(*late.transport, "n");
  EXPECT_TRUE(publish_until(*node.transport, "n", [&] { return at_late.count > 0; }));
  const int before = receiver.count;
  EXPECT_TRUE(publish_until(*node.transport, "n", [&] { return receiver.count > before; }));
}

TEST(Tcp, TwoProgramsOfOneNameNoticeEachOther) {
  for (const std::string& secret : {std::string(), kSecret}) {
    const std::map<std::string, std::string> addresses = {{"n", here(test::free_port())}};
    Program first(addresses, secret), consumer(addresses, secret);
    Receiver receiver(*consumer.transport, "n");
    ASSERT_TRUE(publish_until(*first.transport, "n", [&] { return receiver.count > 0; }));
    Program second({{"n", addresses.at("n")}, {"other", here(test::free_port())}}, secret);
    second.transport->publish("other", text_message("x"));
    second.transport->publish("n", text_message("x"));
    EXPECT_TRUE(eventually([&] {
      return first.lines.count("node 'n': another program runs under this name, too; stop") == 1 &&
             second.lines.count("the node may be running already") == 1;
    }));
    EXPECT_EQ(test::dropped(*first.transport, "node n: another program of this name"), 1u);
    EXPECT_EQ(first.lines.all().size(), 1u) << testing::PrintToString(first.lines.all());
    EXPECT_EQ(second.lines.all().size(), 1u) << testing::PrintToString(second.lines.all());
    const int before = receiver.count;
    EXPECT_TRUE(publish_until(*first.transport, "n", [&] { return receiver.count > before; }));
  }
}

TEST(Tcp, OneThatReadsNoAnswersGetsFewAndIsStillHeard) {
  const int port = test::free_port();
  const std::map<std::string, std::string> addresses = {{"n", here(port)}};
  Program node(addresses), friendly(addresses);
  std::atomic<int> made = 0, words = 0;
  const auto served = node.transport->serve("n", [&](std::span<const std::byte> request) {
    ++(request.empty() ? words : made);
    return test::message(1 << 20);
  });
  ASSERT_TRUE(eventually([&] { return test::RawSocket(port).connected(); }));
  test::RawSocket greedy(port, 65536);
  std::string bytes = frame(FrameKind::hello, "MRT1n");
  for (int i = 0; i < 1000; ++i) bytes += frame(FrameKind::request, "q");
  ASSERT_TRUE(greedy.send(bytes));
  const std::string cause = "asks again before it reads the answers";
  EXPECT_TRUE(
      eventually([&] { return test::dropped(*node.transport, cause) + made.load() == 1000u; }));
  EXPECT_LT(made, 40);  // 8 MB that wait, and what the kernel took
  const auto word = encode_frame_header(FrameKind::request, 0, 0);
  ASSERT_TRUE(greedy.send(test::text_of(word)));
  EXPECT_TRUE(eventually([&] { return words == 1; }));
  std::atomic<int> answers = 0;
  friendly.transport->request("n", text_message("q"), [&](const Message&) { ++answers; });
  EXPECT_TRUE(eventually([&] { return answers == 1; }));
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
