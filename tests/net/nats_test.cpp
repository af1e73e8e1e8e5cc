#include <gtest/gtest.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <filesystem>

#include "mr/net/requests.h"
#include "mr/net/transport.h"
#include "net_support.h"

extern char** environ;

namespace mr::net {
namespace {

using namespace std::chrono_literals;
using test::eventually;
using test::publish_until;
using test::Receiver;
using test::text_message;

std::string server_program() {
  for (const char* path :
       {"/usr/sbin/nats-server", "/usr/bin/nats-server", "/usr/local/bin/nats-server"})
    if (std::filesystem::exists(path)) return path;
  return {};
}

/// A nats-server process on 127.0.0.1.
class Server {
 public:
  explicit Server(int port, std::vector<std::string> more = {}) : port_(port) {
    std::vector<std::string> words = {server_program(),     "-a", "127.0.0.1", "-p",
                                      std::to_string(port), "-l", "/dev/null"};
    words.insert(words.end(), more.begin(), more.end());
    std::vector<char*> arguments;
    for (std::string& word : words) arguments.push_back(word.data());
    arguments.push_back(nullptr);
    if (::posix_spawn(&pid_, words[0].c_str(), nullptr, nullptr, arguments.data(), environ) != 0)
      pid_ = -1;
    EXPECT_TRUE(eventually([&] { return test::RawSocket(port_).connected(); }));
  }
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;
  ~Server() {
    if (pid_ <= 0) return;
    signal(SIGKILL);
    ::waitpid(pid_, nullptr, 0);
  }
  void signal(int number) const { ::kill(pid_, number); }

 private:
  int port_;
  ::pid_t pid_ = -1;
};

class Nats : public testing::Test {
 protected:
  void SetUp() override {
    if (server_program().empty()) GTEST_SKIP() << "nats-server is not installed";
  }

  std::string url() const { return "nats://127.0.0.1:" + std::to_string(port_); }

  std::unique_ptr<Transport> transport(TransportLimits limits = {}, const std::string& at = {}) {
    limits.log = [this](const std::string& line) { lines_.add(line); };
    auto made =
        make_nats_transport({.url = at.empty() ? url() : at}, "scene", limits, test::newest);
    EXPECT_TRUE(made) << (made ? "" : made.error().message);
    return std::move(*made);
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

  const auto served = producer->serve("n", [](std::span<const std::byte> question) {
    return question.size() == 3 ? test::message(3 << 20) : test::message(question.size());
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
  EXPECT_TRUE(ask(kQuestionBytes, kQuestionBytes));
  a->request("n", test::message(kQuestionBytes + 1), [](const Message&) { ADD_FAILURE(); });
  EXPECT_EQ(test::dropped(*a, "question too large"), 1u);
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
  std::this_thread::sleep_for(Requests::kPatience + 1s);
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
