#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/stat.h>

#include <atomic>
#include <filesystem>

#include "certificates.h"
#include "core/temp_dir.h"
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
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

// The pair of the NATS documentation, and the seed of another.
const std::string kNkey = "UDXU4RCSJNZOIQHZNWXHXORDPRTGNJAHAHFRGZNEEJCPQTT2M7NLCNF4";
const std::string kSeed = "SUACSSL3UAHUDXKFSNVUZRF5UHPMWZ6BFDTJ7M6USDXIEDNPPQYYYCU3VY";
const std::string kOtherSeed = "SUAMK2FG4MI6UE3ACF3FK3OIQBCEIEZV7NSWFFEW63UXMRLFM2XLAXK4GY";

std::string server_program() {
  for (const char* path :
       {"/usr/sbin/nats-server", "/usr/bin/nats-server", "/usr/local/bin/nats-server"})
    if (std::filesystem::exists(path)) return path;
  return {};
}

/// A nats-server process on 127.0.0.1.
class Server {
 public:
  explicit Server(int port, const std::vector<std::string>& more = {}) : child_(words(port, more)) {
    EXPECT_TRUE(eventually([&] { return test::RawSocket(port).connected(); }));
  }
  void signal(int number) const { child_.signal(number); }

 private:
  static std::vector<std::string> words(int port, const std::vector<std::string>& more) {
    std::vector<std::string> words = {server_program(),     "-a", "127.0.0.1", "-p",
                                      std::to_string(port), "-l", "/dev/null"};
    words.insert(words.end(), more.begin(), more.end());
    return words;
  }
  test::Child child_;
};

class Nats : public testing::Test {
 protected:
  void SetUp() override {
    if (server_program().empty()) GTEST_SKIP() << "nats-server is not installed";
  }

  std::string url() const { return "nats://127.0.0.1:" + std::to_string(port_); }

  std::unique_ptr<Transport> transport(TransportLimits limits = {}, const std::string& url = {}) {
    return transport({.url = url.empty() ? this->url() : url}, lines_, limits);
  }
  std::unique_ptr<Transport> transport(const NatsConfig& config, test::Lines& lines,
                                       TransportLimits limits = {}) {
    limits.log = [&lines](const std::string& line) { lines.add(line); };
    auto made = make_nats_transport(config, "scene", limits, test::newest);
    EXPECT_TRUE(made) << (made ? "" : made.error().message);
    return std::move(*made);
  }

  std::string at(const std::string& scheme) const {
    return scheme + "127.0.0.1:" + std::to_string(port_);
  }
  std::string user(const std::string& name) const { return at("nats://" + name + ":pw@"); }
  /// The only line that a connection with this configuration makes while it is refused.
  std::string refusal(const NatsConfig& config) {
    test::Lines lines;
    const auto refused = transport(config, lines);
    EXPECT_TRUE(eventually([&] { return lines.count("NATS server") > 0; }));
    std::this_thread::sleep_for(700ms);  // tried once more
    EXPECT_EQ(lines.all().size(), 1u) << testing::PrintToString(lines.all());
    return lines.all().empty() ? "" : lines.all()[0];
  }
  /// Packets go round with this configuration.
  testing::AssertionResult works(const NatsConfig& config) {
    test::Lines lines;
    const auto both = transport(config, lines);
    Receiver receiver(*both, "n");
    if (publish_until(*both, "n", [&] { return receiver.count > 0; }) && lines.all().empty())
      return testing::AssertionSuccess();
    return testing::AssertionFailure() << testing::PrintToString(lines.all());
  }

  const int port_ = test::free_port();
  test::Lines lines_;
};

TEST_F(Nats, DeliversAndAnswersAnySize) {
  const Server server(port_);  // its max_payload is 1 MB
  const auto producer = transport(), a = transport(), b = transport();
  Receiver at_a(*a, "n"), at_b(*b, "n"), other(*b, "n.m *>");
  ASSERT_TRUE(publish_until(*producer, "n", [&] { return at_a.count > 0 && at_b.count > 0; }));
  producer->publish("n", test::message(5 << 20));
  EXPECT_TRUE(eventually([&] { return at_a.last_bytes == 5 << 20 && at_b.last_bytes == 5 << 20; }));
  EXPECT_EQ(other.count, 0);
  EXPECT_TRUE(publish_until(*producer, "n.m *>", [&] { return other.count > 0; }));

  const auto served = producer->serve("n", [](std::span<const std::byte> request) {
    return request.size() == 3 ? test::message(3 << 20) : test::message(request.size());
  });
  std::atomic<std::size_t> got = 0;
  const auto ask = [&](std::size_t bytes, std::size_t expected) {
    return eventually([&] {  // the service may not be known to the server yet
      a->request("n", test::message(bytes), [&](const Message& m) { got = m->size(); });
      return eventually([&] { return got == expected; }, 1000ms);
    });
  };
  EXPECT_TRUE(ask(10, 10));
  EXPECT_TRUE(ask(3, 3 << 20));
  EXPECT_TRUE(ask(kMaxRequestBytes, kMaxRequestBytes));
  a->request("n", test::message(kMaxRequestBytes + 1), [](const Message&) { ADD_FAILURE(); });
  EXPECT_EQ(test::dropped(*a, "request too large"), 1u);
  EXPECT_EQ(test::dropped(*a, "broken"), 0u);
}

TEST_F(Nats, WordsThatNeedNoAnswerWaitForNone) {
  const Server server(port_);
  const auto producer = transport(), consumer = transport();
  std::atomic<int> heard = 0;
  const auto served = producer->serve("n", [&](auto) {
    ++heard;
    return nullptr;
  });
  EXPECT_TRUE(eventually([&] {  // the service may not be known to the server yet
    consumer->request("n", test::message(1));
    return heard > 0;
  }));
  for (int i = 0; i < 3000; ++i) consumer->request("n", test::message(1));
  EXPECT_TRUE(eventually([&] { return heard > 3000; }));
  std::this_thread::sleep_for(PendingRequests::kPatience + 1s);
  EXPECT_EQ(test::dropped(*consumer, "requests"), 0u);
}

TEST_F(Nats, ServerMayComeLateGoAndComeBack) {
  const auto producer = transport(), consumer = transport();
  Receiver receiver(*consumer, "n");
  EXPECT_EQ(lines_.count("cannot be reached: Connection refused; trying on"), 2);
  for (int i = 0; i < 50; ++i) producer->publish("n", test::message(1000));
  EXPECT_TRUE(eventually([&] { return test::dropped(*producer, "no server") > 0; }));
  for (int round = 0; round < 2; ++round) {
    const int before = receiver.count;
    const Server server(port_);
    EXPECT_TRUE(publish_until(*producer, "n", [&] { return receiver.count > before; })) << round;
    EXPECT_TRUE(eventually([&] { return lines_.count("is back") == 2 * (round + 1); }));
    EXPECT_EQ(lines_.count("cannot be reached"), 2 * (round + 1));
  }
  EXPECT_TRUE(eventually([&] { return lines_.count("cannot be reached") == 6; }));
  // What is published meanwhile is stale once the server is back.
  producer->publish("n", test::message(777));
  std::this_thread::sleep_for(50ms);
  const int before = receiver.count;
  const Server server(port_);
  ASSERT_TRUE(eventually([&] { return lines_.count("is back") == 6; }));
  ASSERT_TRUE(publish_until(*producer, "n", [&] { return receiver.count > before; }));
  EXPECT_NE(receiver.last_bytes, 777u);
}

TEST_F(Nats, ARefusedPasswordIsTriedAgainAndNeverLogged) {
  const std::string with_password = "nats://ann:sesame@127.0.0.1:" + std::to_string(port_);
  std::unique_ptr<Transport> both;
  {
    const Server server(port_, {"--user", "ann", "--pass", "other"});
    both = transport({}, with_password);
    std::this_thread::sleep_for(500ms);  // the library gives up after two refusals
  }
  Receiver receiver(*both, "n");
  const Server server(port_, {"--user", "ann", "--pass", "sesame"});
  EXPECT_TRUE(publish_until(*both, "n", [&] { return receiver.count > 0; }));
  EXPECT_GE(lines_.count("127.0.0.1"), 2);
  EXPECT_EQ(lines_.count("sesame"), 0);
  EXPECT_LT(lines_.all().size(), 6u);
}

TEST_F(Nats, AFrozenServerHoldsUpNobody) {
  const Server server(port_);
  const auto producer = transport(), consumer = transport();
  Receiver receiver(*consumer, "n");
  ASSERT_TRUE(publish_until(*producer, "n", [&] { return receiver.count > 0; }));
  server.signal(SIGSTOP);
  auto longest = 0ns;
  for (int i = 0; i < 200; ++i) {
    const auto asked = test::Clock::now();
    producer->publish("n", test::message(200000));
    longest = std::max(longest, std::chrono::nanoseconds(test::Clock::now() - asked));
  }
  EXPECT_LT(longest, 200ms);
  EXPECT_GT(test::dropped(*producer, "sending n: packets folded"), 0u);
  server.signal(SIGCONT);
  const int before = receiver.count;
  EXPECT_TRUE(publish_until(*producer, "n", [&] { return receiver.count > before; }));
}

TEST_F(Nats, ASlowConsumerIsToldByItsSubject) {
  const Server server(port_);
  const auto producer = transport(), consumer = transport({.queue_bytes = 100000});
  std::atomic<bool> go_on = false;
  std::atomic<int> count = 0;
  const auto slow = consumer->subscribe("n", [&](const Message&) {
    ++count;
    while (!go_on) std::this_thread::sleep_for(1ms);
  });
  EXPECT_TRUE(eventually([&] {
    producer->publish("n", test::message(30000));
    return test::dropped(*consumer, "subject mr.scene.n.packet: slow consumer") > 0;
  }));
  EXPECT_TRUE(eventually([&] { return lines_.count("mr.scene.n.packet") == 1; }));
  go_on = true;
}

TEST_F(Nats, AnEndedSubscriptionIsLeftAlone) {
  const Server server(port_);
  auto producer = transport(), consumer = transport();
  for (int round = 0; round < 20; ++round) {
    auto receiver = std::make_unique<Receiver>(*consumer, "n");
    ASSERT_TRUE(publish_until(*producer, "n", [&] { return receiver->count > 0; }));
    receiver.reset();
    producer->publish("n", text_message("x"));
  }
  std::mutex mutex;
  std::unique_ptr<Subscription> own;
  std::atomic<bool> done = false;
  {
    const std::lock_guard lock(mutex);
    own = consumer->subscribe("m", [&](const Message&) {
      const std::lock_guard inner(mutex);
      own.reset();
      done = true;
    });
  }
  EXPECT_TRUE(publish_until(*producer, "m", [&] { return done.load(); }));
  Receiver last(*consumer, "n");
  consumer.reset();
  producer->publish("n", text_message("x"));
}

TEST_F(Nats, AServerThatCannotBeReachedIsToldWithTheReason) {
  EXPECT_THAT(refusal({.url = url()}),
              HasSubstr(": cannot be reached: Connection refused; trying on"));
  EXPECT_THAT(refusal({.url = "nats://no-such-host.invalid:4222"}), HasSubstr("no such host"));
  const test::HeldPort silent;
  EXPECT_THAT(refusal({.url = "nats://127.0.0.1:" + std::to_string(silent.port())}),
              HasSubstr("no answer"));
}

TEST_F(Nats, TlsIsRefusedWithTheReason) {
  test::Certificates certificates;
  certificates.sign("server", "DNS:localhost,IP:127.0.0.1");
  const auto served = [&](const std::string& name, std::vector<std::string> more = {}) {
    more.insert(more.end(),
                {more.empty() ? "--tls" : "--tlsverify", "--tlscert",
                 certificates / (name + ".pem"), "--tlskey", certificates / (name + ".key")});
    return std::make_unique<Server>(port_, more);
  };
  const NatsConfig good{.url = at("tls://"), .ca = certificates / "ca.pem"};
  {
    const auto server = served("server");
    EXPECT_TRUE(works(good));
    EXPECT_THAT(refusal({.url = good.url, .ca = certificates / "other.pem"}),
                HasSubstr("its certificate is not trusted; nats.ca must name"));
    EXPECT_THAT(refusal({.url = good.url}), HasSubstr("its certificate is not trusted"));
    EXPECT_THAT(refusal({.url = at("nats://")}), HasSubstr("its certificate is not trusted"));
    EXPECT_TRUE(works(good));
  }
  certificates.sign("elsewhere", "DNS:nats.elsewhere");
  {
    const auto server = served("elsewhere");
    EXPECT_THAT(refusal(good), HasSubstr("for another name than the one in nats.url"));
    EXPECT_THAT(refusal({.url = "tls://localhost:" + std::to_string(port_), .ca = good.ca}),
                HasSubstr("for another name than the one in nats.url"));
  }
  certificates.sign("expired", "IP:127.0.0.1", -1);
  {
    const auto server = served("expired");
    EXPECT_THAT(refusal(good), HasSubstr("its certificate has expired"));
  }
  certificates.sign("node", "DNS:node");
  {
    const auto server = served("server", {"--tlscacert", certificates / "ca.pem"});
    EXPECT_THAT(refusal(good), HasSubstr("wants a certificate of this node: nats.cert and"));
    NatsConfig with = good;
    with.certificate = certificates / "node.pem", with.key = certificates / "node.key";
    EXPECT_TRUE(works(with));
    with.certificate = certificates / "other.pem", with.key = certificates / "other.key";
    EXPECT_THAT(refusal(with), HasSubstr("does not trust the certificate of nats.cert"));
  }
  const Server plain(port_);
  EXPECT_THAT(refusal(good), HasSubstr("it speaks no TLS"));
}

TEST_F(Nats, FilesThatCannotBeUsedAreToldAtTheStart) {
  test::Certificates certificates;
  const auto why = [&](const NatsConfig& config) {
    const auto made = make_nats_transport(config, "scene");
    return made ? "made" : made.error().message;
  };
  const std::string tls = at("tls://");
  const auto ca = certificates / "ca.pem", key = certificates / "other.key";
  EXPECT_THAT(why({.url = tls, .ca = "/no.pem"}), HasSubstr("nats.ca: no certificates in /no.pem"));
  EXPECT_THAT(why({.url = tls, .ca = ca, .certificate = ca, .key = key}),
              HasSubstr("nats.cert and nats.key: no pair in"));
  EXPECT_THAT(why({.url = url(), .nkey = kNkey, .nkey_seed = "/no"}),
              HasSubstr("file /no: cannot"));
  EXPECT_THAT(why({.url = url(), .credentials = "/no"}), HasSubstr("file /no: cannot read"));
  const auto open = certificates.folder().write("seed", kSeed);
  ::chmod(open.c_str(), 0644);
  const std::string told = why({.url = url(), .nkey = kNkey, .nkey_seed = open});
  EXPECT_THAT(told, HasSubstr("chmod 600"));
  EXPECT_EQ(told.find(kSeed), std::string::npos);
}

// A refused node gets the reason; other nodes are not affected.
TEST_F(Nats, AWrongPasswordOrKeyIsRefusedWithTheReason) {
  const test::TempDir dir;
  const auto config = dir.write(
      "nats.conf", "authorization {users = [{user: ann, password: pw}, {nkey: " + kNkey + "}]}");
  const auto seed = dir.write("seed", kSeed), other = dir.write("other", kOtherSeed);
  for (const auto& file : {seed, other}) ::chmod(file.c_str(), 0600);
  const Server server(port_, {"-c", config});
  EXPECT_TRUE(works({.url = user("ann")}));
  EXPECT_TRUE(works({.url = url(), .nkey = kNkey, .nkey_seed = seed}));
  EXPECT_THAT(refusal({.url = at("nats://ann:sesame@")}),
              AllOf(HasSubstr("it refuses the user, password or token of nats.url"),
                    Not(HasSubstr("sesame"))));
  EXPECT_THAT(refusal({.url = url()}), HasSubstr("it asks who we are"));
  EXPECT_THAT(refusal({.url = url(), .nkey = kNkey, .nkey_seed = other}),
              AllOf(HasSubstr("it refuses the key of nats.nkey"), Not(HasSubstr(kOtherSeed))));
  EXPECT_TRUE(works({.url = user("ann")}));
}

// The permissions of docs/security.md: a sensor publishes its own packets, hears and answers what
// it is asked, and nothing else; a merger hears and asks sensors.
TEST_F(Nats, ASensorMayDoWhatItDoesAndNoMore) {
  const test::TempDir dir;
  const auto config = dir.write("nats.conf", R"(
authorization {
  users = [
    {user: n, password: pw, permissions: {
      publish: ["mr.scene.n.packet", "mr.scene.n.here"], subscribe: ["mr.scene.n.ask", "mr.scene.n.here"],
      allow_responses: {max: 1000, expires: "10s"}}}
    {user: root, password: pw, permissions: {
      publish: ["mr.scene.root.packet", "mr.scene.root.here", "mr.scene.*.ask"],
      subscribe: ["mr.scene.root.ask", "mr.scene.root.here", "mr.scene.*.packet", "_INBOX.mr.scene.>"],
      allow_responses: {max: 1000, expires: "10s"}}}
  ]
})");
  const Server server(port_, {"-c", config});
  test::Lines of_sensor, of_root;
  const auto sensor = transport({.url = user("n")}, of_sensor);
  const auto root = transport({.url = user("root")}, of_root);
  Receiver packets(*root, "n"), of_other(*root, "m");
  const auto served = sensor->serve("n", [](auto) { return test::message(5 << 20); });
  ASSERT_TRUE(publish_until(*sensor, "n", [&] { return packets.count > 0; }));
  std::atomic<std::size_t> got = 0;
  EXPECT_TRUE(eventually([&] {  // in six parts
    root->request("n", text_message("q"), [&](const Message& m) { got = m->size(); });
    return eventually([&] { return got == 5 << 20; }, 1000ms);
  }));
  EXPECT_TRUE(of_sensor.all().empty()) << testing::PrintToString(of_sensor.all());
  EXPECT_TRUE(of_root.all().empty()) << testing::PrintToString(of_root.all());

  EXPECT_TRUE(publish_until(*sensor, "m", [&] {
    return test::dropped(*sensor, "subject mr.scene.m.packet: may not publish") > 3;
  }));
  EXPECT_EQ(of_sensor.count("subject mr.scene.m.packet: this program may not publish there"), 1);
  const Receiver spy(*sensor, "m");
  EXPECT_TRUE(eventually([&] {
    return of_sensor.count("subject mr.scene.m.packet: this program may not subscribe there") == 1;
  }));
  EXPECT_EQ(of_sensor.all().size(), 2u) << testing::PrintToString(of_sensor.all());
  EXPECT_EQ(of_other.count, 0);
  const int before = packets.count;
  EXPECT_TRUE(publish_until(*sensor, "n", [&] { return packets.count > before; }));
}

TEST_F(Nats, TwoProgramsOfOneNameNoticeEachOther) {
  const Server server(port_);
  const std::string line = "node 'n': another program runs under this name, too; stop one of them";
  test::Lines of_first, of_second, of_other;
  const auto answer = [](auto) { return text_message("a"); };
  const auto first = transport({.url = url()}, of_first);
  const auto served = first->serve("n", answer), again = first->serve("n", answer);
  const auto other = transport({.url = url()}, of_other);
  const auto others = other->serve("m", answer);
  auto second = transport({.url = url()}, of_second);
  auto seconds = second->serve("n", answer);
  EXPECT_TRUE(eventually([&] { return of_first.count(line) == 1 && of_second.count(line) == 1; }));
  EXPECT_TRUE(eventually(
      [&] { return test::dropped(*first, "node n: another program of this name") >= 3; }));
  EXPECT_EQ(of_first.all().size(), 1u);
  EXPECT_EQ(of_second.all().size(), 1u);
  EXPECT_EQ(of_other.all().size(), 0u);
  seconds.reset();
  std::this_thread::sleep_for(100ms);
  const auto heard = test::dropped(*first, "another program");
  std::this_thread::sleep_for(1200ms);
  EXPECT_EQ(test::dropped(*first, "another program"), heard);
}

TEST_F(Nats, OneThatAsksForMoreThanItTakesGetsNoMore) {
  const Server server(port_);
  const auto producer = transport(), greedy = transport();
  std::atomic<int> asked = 0, words = 0;
  const auto served = producer->serve("n", [&](std::span<const std::byte> request) {
    ++(request.size() == 1 ? words : asked);
    return request.size() == 1 ? nullptr : test::message(8 << 20);
  });
  ASSERT_TRUE(eventually([&] {
    greedy->request("n", test::message(1));
    return words > 0;
  }));
  for (int i = 0; i < 1000; ++i) greedy->request("n", test::message(2), [](const Message&) {});
  const auto refused = [&] {
    return test::dropped(*producer, "subject mr.scene.n.ask: asked again before the answers went");
  };
  EXPECT_TRUE(eventually([&] { return static_cast<int>(refused()) + asked == 1000; }));
  EXPECT_GT(refused(), 500u);
}

TEST(NatsUrl, IsChecked) {
  for (const char* bad :
       {"", "127.0.0.1:4222", "http://a:1", "nats://", "nats://a:b:c", "nats://a:1,x"})
    EXPECT_FALSE(make_nats_transport({.url = bad}, "scene")) << bad;
  const auto secret = make_nats_transport({.url = "nats://u:pw@a:b:c"}, "scene");
  ASSERT_FALSE(secret);
  EXPECT_EQ(secret.error().message.find("pw"), std::string::npos);
}

}  // namespace
}  // namespace mr::net
