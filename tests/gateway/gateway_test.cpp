#include "mr/gateway/gateway.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <fstream>

#include "mr/codec/packet_codec.h"
#include "mr/gateway/access_policy.h"
#include "mr/net/transport.h"
#include "mr/net/web_server.h"
#include "mr/node/node_clock.h"
#include "mr/runtime/monitor.h"
#include "mr/runtime/task_threads.h"
#include "net/net_support.h"
#include "support/seal.h"
#include "support/sender.h"

namespace mr::gateway {
namespace {

using namespace std::chrono_literals;
using test::eventually;
using test::WebViewer;

double resident_mb() {
  std::ifstream statm("/proc/self/statm");
  double all = 0, resident = 0;
  statm >> all >> resident;
  return resident * static_cast<double>(::sysconf(_SC_PAGESIZE)) / 1e6;
}

#if defined(MR_SANITIZED)
constexpr int kSlower = 4;
#else
constexpr int kSlower = 1;
#endif

/// A gateway on threads of its own, with a web server and its pages, behind a root that is made up.
class GatewayTest : public testing::Test {
 protected:
  void start(GatewayConfig config = {}) {
    config.listen = "127.0.0.1:0";
    scene_.id = "test";
    scene_.sensors.resize(2);
    scene_.sensors[0].id = "cam-0", scene_.sensors[1].id = "cam-1";
    scene_.mergers.push_back({});
    scene_.mergers.back().id = "sender";
    service_ = serve("sender", sender_, targets_);
    slower_service_ = serve("sender~1", slower_, slower_targets_);
    auto policy = AccessPolicy::open(config, {});
    ASSERT_TRUE(policy) << policy.error().message;
    const node::NodeLog log{
        .write = [this](LogLevel, const std::string& text) { lines_.add(text); },
        .dropped = [this](const std::string& place,
                          const Error& error) { lines_.add(place + ": " + error.message); }};
    auto gateway = std::make_unique<Gateway>(scene_, log, Gateway::Options{policy->tokens});
    auto web = net::WebServer::listen(
        web_config(config, *policy, {}),
        [this, asked = gateway.get()](const std::string& path, const net::Visitor& visitor) {
          return monitor_.page(path, asked->may_read_figures(visitor, node::wall_time()));
        });
    ASSERT_TRUE(web) << web.error().message;
    web_ = *std::move(web);
    gateway->attach(*web_, node::wall_time);
    gateway_ = std::make_unique<runtime::TaskThreads>(
        std::move(gateway), *transport_, log,
        runtime::TaskThreads::Config{
            .makes_packets = false, .folds = false, .longest_wait = 100ms});
  }

  std::unique_ptr<net::Subscription> serve(const std::string& name, test::Sender& sender,
                                           std::vector<double>& targets) {
    return transport_->serve(name, [this, &sender, &targets](std::span<const std::byte> question) {
      const std::lock_guard lock(mutex_);
      const auto request = codec::decode_control(question);
      if (!request) return net::Message();
      if (request->target_mbps) targets.push_back(*request->target_mbps);
      auto answer = sender.answer(*request);
      return answer.empty() ? net::Message() : net::as_message(std::move(answer));
    });
  }

  void publish(const Packet& packet) { publish(codec::encode_packet(packet)); }
  void publish(std::vector<std::byte> bytes, const std::string& stream = "sender") {
    transport_->publish(stream, net::as_message(std::move(bytes)));
  }
  Packet next(bool key_frame = false) {
    const std::lock_guard lock(mutex_);
    return sender_.next(key_frame);
  }

  /// The next text message of a kind, or the reason that it was closed with.
  static std::string text(WebViewer& viewer) {
    while (true) {
      const auto message = viewer.next_message();
      if (message.opcode == 1) return message.payload;
      if (message.opcode == 8 && message.payload.size() > 2) return message.payload.substr(2);
      if (message.opcode < 0 || message.opcode == 8) return "closed";
    }
  }
  /// The sequence of the next packet, which is acknowledged; nothing where none comes.
  static std::optional<std::uint64_t> packet(WebViewer& viewer) {
    while (true) {
      const auto message = viewer.next_message();
      if (message.opcode < 0 || message.opcode == 8) return std::nullopt;
      if (message.opcode != 2) continue;
      const auto bytes = std::as_bytes(std::span(message.payload));
      const auto packet = codec::decode_packet(bytes);
      if (!packet) continue;
      viewer.send(1, R"({"type":"shown","sequence":)" + std::to_string(packet->sequence) + "}");
      return packet->sequence;
    }
  }
  std::string get(const std::string& path, const std::string& headers = {}) {
    test::RawSocket socket(port());
    socket.send("GET " + path + " HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n" + headers +
                "\r\n");
    std::string answer;
    for (std::string some = socket.read_some(); !some.empty(); some = socket.read_some())
      answer += some;
    return answer;
  }

  int port() const { return web_->port(); }

  Scene scene_;
  std::unique_ptr<net::Transport> transport_ = net::make_in_process_transport();
  std::mutex mutex_;
  test::Sender sender_, slower_;
  std::vector<double> targets_, slower_targets_;  ///< that the root and its rung were told
  test::Lines lines_;
  std::unique_ptr<net::Subscription> service_, slower_service_;
  runtime::Monitor monitor_{[this] { return std::vector<node::NodeStats>{gateway_->stats()}; }};
  std::unique_ptr<net::WebServer> web_;            // outlives the gateway, which sends by it
  std::unique_ptr<runtime::TaskThreads> gateway_;  // last: it uses the rest
};

TEST_F(GatewayTest, ADamagedOrForgedPacketSilencesNobody) {
  start();
  WebViewer viewer(port());
  EXPECT_NE(text(viewer).find("hello"), std::string::npos);
  publish(next(true));
  ASSERT_TRUE(packet(viewer));
  std::uint64_t last = 0;
  const auto goes_on = [&] {
    const Packet more = next();
    publish(more);
    last = more.sequence;
    return packet(viewer) == more.sequence;
  };
  for (const int bit : {0, 7, 1000, 3333}) {
    auto bytes = codec::encode_packet(next());
    bytes[static_cast<std::size_t>(bit / 8)] ^= std::byte{1};
    publish(bytes);
    EXPECT_TRUE(goes_on()) << bit;
  }
  Packet poisoned = next();
  poisoned.sequence = UINT64_MAX;
  publish(poisoned);
  EXPECT_TRUE(goes_on());
  EXPECT_GE(lines_.count("too far ahead"), 1);
}

TEST_F(GatewayTest, ReplayedPacketsDoNotReachViewers) {
  start();
  WebViewer viewer(port());
  EXPECT_NE(text(viewer).find("hello"), std::string::npos);
  const Packet first = next(true);
  publish(first);
  ASSERT_EQ(packet(viewer), first.sequence);
  for (int i = 0; i < 20; ++i) {
    publish(first);  // again
    const Packet more = next();
    publish(more);
    EXPECT_EQ(packet(viewer), more.sequence);
  }
}

/// A forged packet with a higher sequence is accepted; the real stream is accepted again soon
/// after.
TEST_F(GatewayTest, AForgedPacketWithinReachIsOvercomeWithinTwoSeconds) {
  start();
  WebViewer viewer(port());
  EXPECT_NE(text(viewer).find("hello"), std::string::npos);
  publish(next(true));
  ASSERT_TRUE(packet(viewer));
  Packet forged = next(true);
  forged.sequence += 1000;
  publish(forged);
  EXPECT_EQ(packet(viewer), forged.sequence);
  const auto started = test::Clock::now();
  std::atomic<bool> stop = false;
  std::thread root([&] {
    for (int i = 0; !stop; ++i, std::this_thread::sleep_for(20ms)) publish(next(i % 10 == 0));
  });
  const auto again = packet(viewer);
  EXPECT_LT(test::Clock::now() - started, 2s * kSlower);
  EXPECT_TRUE(again && *again < forged.sequence);
  stop = true;
  root.join();
}

TEST_F(GatewayTest, NothingIsToldWithoutAToken) {
  ::setenv("MR_GATEWAY_TEST", "right-token-0123456789, over-token-0123456789 until=2020-01-01", 1);
  GatewayConfig config;
  config.tokens.env = "MR_GATEWAY_TEST";
  start(config);
  const auto say = [](WebViewer& viewer, const std::string& token) {
    viewer.send(1, R"({"type":"token","token":")" + token + "\"}");
    return text(viewer);
  };
  const std::string locked = R"({"type":"locked"})";
  WebViewer right(port()), wrong(port()), over(port()), other(port());
  for (WebViewer* viewer : {&right, &wrong, &over, &other}) EXPECT_EQ(text(*viewer), locked);
  EXPECT_NE(say(right, "right-token-0123456789").find("hello"), std::string::npos);
  EXPECT_EQ(say(wrong, "wrong-token-0123456789"), "wrong token");
  EXPECT_EQ(say(over, "over-token-0123456789"), "the token has expired");
  other.send(1, R"({"type":"ping","id":1})");
  EXPECT_EQ(text(other), "no token");
  WebViewer by_cookie(port(), {.headers = "Cookie: meshreduce_token=right-token-0123456789\r\n"});
  EXPECT_NE(text(by_cookie).find("hello"), std::string::npos);
  WebViewer by_wrong_cookie(port(), {.headers = "Cookie: meshreduce_token=wrong\r\n"});
  EXPECT_EQ(text(by_wrong_cookie), "wrong token");
  publish(next(true));
  EXPECT_TRUE(packet(right));
  EXPECT_TRUE(packet(by_cookie));
  EXPECT_EQ(lines_.count("wrong token"), 2);
  EXPECT_EQ(lines_.count("the token has expired"), 1);
  for (const std::string& line : lines_.all())
    EXPECT_EQ(line.find("0123456789"), std::string::npos) << line;
}

TEST_F(GatewayTest, TellsTheRootWhatViewersWant) {
  scene_.rate.model = RateConfig::Model::ours;
  scene_.rate.target_mbps = 25;
  start();
  WebViewer viewer(port());
  EXPECT_NE(text(viewer).find(R"("rate":{"target_mbps":25.0})"), std::string::npos);
  publish(next(true));
  ASSERT_TRUE(packet(viewer));
  const auto is_told = [&](double mbps) {
    return eventually([&] {
      const std::lock_guard lock(mutex_);
      return std::ranges::find(targets_, mbps) != targets_.end();
    });
  };
  EXPECT_TRUE(is_told(25)) << "nobody has asked for less";
  viewer.send(1, R"({"type":"target","mbps":4.5})");
  EXPECT_TRUE(is_told(4.5));
  for (const char* bad : {"0", "-1", "\"5\"", "null"}) {
    viewer.send(1, std::string(R"({"type":"target","mbps":)") + bad + "}");
    EXPECT_EQ(text(viewer), R"({"type":"error","message":"a target must be a number above 0"})");
  }
  viewer.send(1, R"({"type":"target","mbps":2})");
  EXPECT_TRUE(is_told(2)) << "it is still listened to";
}

TEST_F(GatewayTest, WhoWantsLessThanOthersMovesToARungOnceThatIsThere) {
  scene_.rate.model = RateConfig::Model::ours;
  scene_.rate.target_mbps = 25;
  start();
  WebViewer whole(port()), thrifty(port());
  for (WebViewer* viewer : {&whole, &thrifty}) {
    EXPECT_NE(text(*viewer).find("hello"), std::string::npos);
  }
  const Packet first = next(true);
  const std::uint64_t at = first.sequence;
  publish(first);
  ASSERT_EQ(packet(whole), at);
  ASSERT_EQ(packet(thrifty), at);
  thrifty.send(1, R"({"type":"target","mbps":3})");
  EXPECT_TRUE(eventually([&] {
    const std::lock_guard lock(mutex_);
    return std::ranges::find(slower_targets_, 3) != slower_targets_.end();
  }));
  publish(next());
  ASSERT_EQ(packet(thrifty), at + 1) << "nothing comes from the rung yet";
  for (int i = 0; i < 50; ++i) slower_.next();  // its numbers are others than the root's
  ASSERT_EQ(packet(whole), at + 1);
  const auto publish_slower = [&](bool key_frame) {
    Packet packet = [&] {
      const std::lock_guard lock(mutex_);
      return slower_.next(key_frame);
    }();
    packet.node = "sender~1";
    publish(codec::encode_packet(packet), "sender~1");
    return packet.sequence;
  };
  publish_slower(true);
  EXPECT_NE(text(thrifty).find("hello"), std::string::npos) << "it starts afresh";
  std::uint64_t of_rung = publish_slower(false);
  ASSERT_EQ(packet(thrifty), of_rung);
  publish(next());
  of_rung = publish_slower(false);
  ASSERT_EQ(packet(thrifty), of_rung) << "of the rung alone";
  ASSERT_EQ(packet(whole), at + 2);
  {
    const std::lock_guard lock(mutex_);
    EXPECT_EQ(targets_.back(), 25);
  }
}

TEST_F(GatewayTest, WhereTheRateIsFixedNoTargetIsPassedOn) {
  start();
  WebViewer viewer(port());
  EXPECT_EQ(text(viewer).find("rate"), std::string::npos);
  publish(next(true));
  ASSERT_TRUE(packet(viewer));
  viewer.send(1, R"({"type":"target","mbps":4})");
  viewer.send(1, R"({"type":"ping","id":1})");
  EXPECT_NE(text(viewer).find("pong"), std::string::npos);
  publish(next());
  ASSERT_TRUE(packet(viewer));
  const std::lock_guard lock(mutex_);
  EXPECT_TRUE(targets_.empty());
}

TEST_F(GatewayTest, WhoIsRefusedIsNotListenedToAnyMore) {
  start();
  WebViewer viewer(port());
  EXPECT_NE(text(viewer).find("hello"), std::string::npos);
  viewer.send(1, "nonsense");
  const std::string frame = std::string("\x81\x81\0\0\0\0x", 7);
  std::string burst;
  for (int i = 0; i < 20'000; ++i) burst += frame;
  const auto started = test::Clock::now();
  int bursts = 0;
  while (bursts < 1000 && viewer.socket().send(burst)) ++bursts;
  EXPECT_LT(bursts, 1000);
  EXPECT_LT(test::Clock::now() - started, 3s * kSlower);
}

TEST_F(GatewayTest, ControlOfAnotherVersionIsAnsweredAndTheStreamGoesOn) {
  start();
  WebViewer viewer(port());
  EXPECT_NE(text(viewer).find("hello"), std::string::npos);
  auto bytes = codec::encode_control({{}, {}, {}, true});
  bytes[4] = std::byte{9};
  bytes = test::resealed(std::move(bytes));
  viewer.send(2, {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
  EXPECT_EQ(text(viewer),
            R"({"type":"error","message":"control: a message of version 9; this program reads )"
            R"(version 1"})");
  const Packet first = next(true);
  publish(first);
  EXPECT_EQ(packet(viewer), first.sequence);
  EXPECT_EQ(lines_.count("version 9"), 1);
}

TEST_F(GatewayTest, AViewerMakesNoPlans) {
  start();
  WebViewer viewer(port());
  EXPECT_NE(text(viewer).find("hello"), std::string::npos);
  codec::Control control;
  control.plan.emplace();
  const auto bytes = codec::encode_control(control);
  viewer.send(2, {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
  EXPECT_EQ(text(viewer), "a viewer makes no plans");
}

TEST_F(GatewayTest, WhomTheWebServerRefusesIsInTheLog) {
  start();
  EXPECT_EQ(WebViewer(port(), {.host = "evil.example"}).status(), 421);
  EXPECT_TRUE(eventually([&] { return lines_.count("another host's name (1)") == 1; }));
}

TEST_F(GatewayTest, FiguresNeedATokenHealthDoesNot) {
  ::setenv("MR_GATEWAY_TEST", "right-token-0123456789", 1);
  GatewayConfig config;
  config.tokens.env = "MR_GATEWAY_TEST";
  start(config);
  const std::string bearer = "Authorization: Bearer right-token-0123456789\r\n";
  EXPECT_TRUE(get("/metrics").starts_with("HTTP/1.1 401"));
  EXPECT_NE(get("/metrics", bearer).find("meshreduce_viewers 0"), std::string::npos);
  EXPECT_TRUE(get("/healthz").ends_with("\r\n\r\n{\"status\":\"down\"}\n"));
  EXPECT_NE(get("/healthz", bearer).find("\"missing\""), std::string::npos);
}

TEST_F(GatewayTest, ADeadSensorIsToldWithinTwoSeconds) {
  start();
  const auto publish_two = [&](bool second) {
    Packet both = next(true);
    both.captured_at = node::wall_time();
    both.sources[0].captured_at = both.captured_at;
    if (second) both.sources.push_back(both.sources[0]), both.sources[1].sensor = SensorId{1};
    publish(both);
    std::this_thread::sleep_for(30ms);
  };
  for (int i = 0; i < 20; ++i) publish_two(true);
  EXPECT_NE(get("/healthz").find(R"({"status":"ok","missing":[])"), std::string::npos);
  const auto died = test::Clock::now();
  while (get("/healthz").find(R"({"status":"degraded","missing":["cam-1"])") == std::string::npos) {
    publish_two(false);
    ASSERT_LT(test::Clock::now() - died, 2s * kSlower);
  }
  EXPECT_NE(get("/metrics").find(R"(meshreduce_input_up{node="gateway",input="cam-1"} 0)"),
            std::string::npos);
  publish_two(true);
  EXPECT_TRUE(eventually([&] { return get("/healthz").find("\"ok\"") != std::string::npos; }));
}

TEST_F(GatewayTest, SilenceIsToldWithinTwoSeconds) {
  start();
  WebViewer viewer(port());
  EXPECT_NE(text(viewer).find("hello"), std::string::npos);
  publish(next(true));
  const auto last = test::Clock::now();
  EXPECT_NE(text(viewer).find("stopped"), std::string::npos);
  EXPECT_LT(test::Clock::now() - last, 2s * kSlower);
  EXPECT_TRUE(get("/healthz").starts_with("HTTP/1.1 503"));
}

/// Chunks of a large room: a whole one is 9 MB.
Packet large(Packet packet, std::uint32_t version) {
  packet.chunks.clear();
  for (ChunkKey& key : packet.manifest) {
    key.version = version;
    packet.chunks.push_back({key, 0, 1, {}, {}, std::vector<std::byte>(1'500'000, std::byte{7})});
  }
  return packet;
}

TEST_F(GatewayTest, SixtyGreedyReadersMakeItGrowByLittle) {
  start();
  WebViewer good(port());
  EXPECT_NE(text(good).find("hello"), std::string::npos);
  Packet packet_now = large(next(true), 1);
  publish(packet_now);
  ASSERT_EQ(packet(good), packet_now.sequence);
  [[maybe_unused]] const double before = resident_mb();
  const auto request = codec::encode_control({{}, packet_now.manifest, {}, true});
  const std::string words(reinterpret_cast<const char*>(request.data()), request.size());
  double most = 0;
  int seen = 0, sent = 0;
  const auto more_and_see = [&] {
    Packet more = next(sent % 10 == 0);
    for (std::size_t i = 0; i < more.manifest.size(); ++i)
      more.manifest[i] = packet_now.manifest[i];
    more.chunks.clear();
    publish(more);
    packet_now.sequence = more.sequence;
    ++sent;
    if (packet(good) == more.sequence) ++seen;
    most = std::max(most, resident_mb());
    std::this_thread::sleep_for(30ms);
  };
  {
    std::vector<WebViewer> greedy;
    for (int i = 0; i < 60; ++i) {
      greedy.emplace_back(port(), WebViewer::Options{.from = "127.0.3." + std::to_string(i + 1),
                                                     .receive_buffer = 4096});
      EXPECT_EQ(greedy.back().status(), 101);
    }
    for (int round = 0; round < 60; ++round) {
      for (WebViewer& viewer : greedy)
        viewer.send(2, words), viewer.send(1, R"({"type":"shown","sequence":)" +
                                                  std::to_string(packet_now.sequence) + "}");
      more_and_see();
    }
  }
  EXPECT_GE(seen, sent * 9 / 10);
#if !defined(MR_SANITIZED)  // which keeps what is freed
  EXPECT_LT(most - before, 100);
  EXPECT_TRUE(eventually([&] { return resident_mb() - before < 20; })) << resident_mb() - before;
#endif
}

}  // namespace
}  // namespace mr::gateway
