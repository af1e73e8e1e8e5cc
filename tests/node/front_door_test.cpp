#include "mr/node/front_door.h"

#include <gtest/gtest.h>

#include <cstdlib>

#include "core/temp_dir.h"
#include "mr/node/monitor.h"

namespace mr::node {
namespace {

constexpr TimePoint kNow{std::chrono::seconds(1'764'000'000)};  // 2025-11-24

TEST(Tokens, RightWrongAndExpired) {
  const auto tokens = Tokens::parse(
      "# who may watch\n"
      "0123456789abcdef, second-token-of-this-line\n"
      "over-since-long-ago until=2025-11-01  # Ann\n"
      "good-to-the-last-day until=2025-11-24\n\n");
  ASSERT_TRUE(tokens) << tokens.error().message;
  using Verdict = Tokens::Verdict;
  EXPECT_EQ(tokens->check("0123456789abcdef", kNow).verdict, Verdict::right);
  EXPECT_EQ(tokens->check("second-token-of-this-line", kNow).verdict, Verdict::right);
  EXPECT_EQ(tokens->check("over-since-long-ago", kNow).verdict, Verdict::expired);
  const auto last = tokens->check("good-to-the-last-day", kNow);
  EXPECT_EQ(last.verdict, Verdict::right);
  EXPECT_EQ(tokens->check("good-to-the-last-day", *last.until).verdict, Verdict::expired);
  for (const char* wrong : {"", "0123456789abcdeF", "0123456789abcde", "# who may watch"})
    EXPECT_EQ(tokens->check(wrong, kNow).verdict, Verdict::wrong) << wrong;
}

TEST(Tokens, WhatIsNoneIsRefusedWithoutBeingShown) {
  for (const char* text : {"", "# nothing", "short", "0123456789abcdef until=tomorrow",
                           "0123456789abcdef until=2025-02-30", "0123456789abcdef secret",
                           "0123456789abcdef\nwith a space in it"}) {
    const auto tokens = Tokens::parse(text);
    ASSERT_FALSE(tokens) << text;
    EXPECT_EQ(tokens.error().message.find("0123"), std::string::npos) << tokens.error().message;
    EXPECT_EQ(tokens.error().message.find("secret"), std::string::npos);
    EXPECT_EQ(tokens.error().message.find('\n'), std::string::npos);
  }
}

TEST(Certificate, SpeaksForItsNamesAndIsKept) {
  test::TempDir folder;
  const std::vector<std::string> names = {"localhost", "127.0.0.1", "::1"};
  const auto first = net::own_certificate(folder.path(), names);
  ASSERT_TRUE(first) << first.error().message;
  const auto again = net::own_certificate(folder.path(), names);
  ASSERT_TRUE(again);
  EXPECT_EQ(*net::fingerprint(*first), *net::fingerprint(*again)) << "trusted once, known again";
  EXPECT_EQ(net::fingerprint(*first)->size(), 32u * 3 - 1);
  EXPECT_EQ(net::complaint(*first), "");
  const auto moved = net::own_certificate(folder.path(), {"localhost", "192.168.1.7"});
  EXPECT_EQ(*net::fingerprint(*first), *net::fingerprint(*moved)) << "the machine got an address";
  EXPECT_TRUE(net::own_certificate({}, names)) << "nowhere to keep it";
  const auto mode = std::filesystem::status(folder / "gateway.key").permissions();
  EXPECT_EQ(mode & std::filesystem::perms(077), std::filesystem::perms::none);
  const auto other =
      net::own_certificate(folder.path(), {"room.example.org"}, {"room.example.org"});
  ASSERT_TRUE(other);
  EXPECT_NE(*net::fingerprint(*first), *net::fingerprint(*other)) << "another name";
}

TEST(Certificate, AnExpiredOneIsSaidToBe) {
  const auto made = net::make_certificate({"localhost"}, -1);
  ASSERT_TRUE(made);
  EXPECT_NE(net::complaint(*made).find("has expired"), std::string::npos);
  const auto soon = net::make_certificate({"localhost"}, 3);
  EXPECT_NE(net::complaint(*soon).find("expires in"), std::string::npos);
}

TEST(Certificate, WhatDoesNotFitIsRefused) {
  test::TempDir folder;
  const auto a = net::make_certificate({"a"}), b = net::make_certificate({"b"});
  folder.write("a.crt", a->chain_pem), folder.write("b.key", b->key_pem), folder.write("none", "x");
  const auto message = [&](const char* cert, const char* key) {
    const auto loaded = net::load_certificate(folder / cert, folder / key);
    return loaded ? "" : loaded.error().message;
  };
  EXPECT_NE(message("a.crt", "b.key").find("is not that of the certificate"), std::string::npos);
  EXPECT_NE(message("none", "b.key").find("holds no certificate"), std::string::npos);
  EXPECT_NE(message("a.crt", "none").find("holds no private key"), std::string::npos);
  EXPECT_NE(message("missing", "b.key"), "");
}

TEST(FrontDoor, BeyondThisMachineItNeedsTlsAndTokensUnlessOpen) {
  test::TempDir folder;
  folder.write("tokens", "0123456789abcdef");
  std::filesystem::permissions(folder / "tokens", std::filesystem::perms(0600));
  GatewayConfig config;
  const auto message = [&] {
    const auto door = FrontDoor::open(config, folder.path());
    return door ? "" : door.error().message;
  };
  for (const char* loopback : {"127.0.0.1:8080", "[::1]:8080", "localhost:0", "127.0.0.9:1"}) {
    config.listen = loopback;
    EXPECT_EQ(message(), "") << loopback;
  }
  for (const char* beyond :
       {"0.0.0.0:8080", "[::]:8080", "192.168.1.5:8080", "room.example.org:1"}) {
    config = {};
    config.listen = beyond;
    EXPECT_NE(message().find("'open: true'"), std::string::npos) << beyond;
    config.tls = TlsConfig{};
    EXPECT_NE(message(), "") << "tokens, too";
    config.tokens.file = folder / "tokens";
    EXPECT_EQ(message(), "");
    config.tls.reset();
    EXPECT_NE(message(), "") << "TLS, too";
    config.tokens = {};
    config.open = true;
    EXPECT_EQ(message(), "");
  }
}

TEST(FrontDoor, SaysWhatIsWrongWithTokensAndCertificates) {
  test::TempDir folder;
  GatewayConfig config;
  config.tokens.env = "MR_NO_SUCH_TOKENS";
  auto door = FrontDoor::open(config, folder.path());
  ASSERT_FALSE(door);
  EXPECT_TRUE(door.error().message.starts_with("gateway.tokens: ")) << door.error().message;
  ::setenv("MR_TEST_TOKENS", "short", 1);
  config.tokens.env = "MR_TEST_TOKENS";
  door = FrontDoor::open(config, folder.path());
  ASSERT_FALSE(door);
  EXPECT_NE(door.error().message.find("MR_TEST_TOKENS"), std::string::npos);
  EXPECT_EQ(door.error().message.find("short"), std::string::npos);
  config.tokens = {};
  config.tls = TlsConfig{folder / "no.crt", folder / "no.key"};
  door = FrontDoor::open(config, folder.path());
  ASSERT_FALSE(door);
  EXPECT_TRUE(door.error().message.starts_with("gateway.tls: ")) << door.error().message;
}

TEST(FrontDoor, PrintsAnAddressThatOthersCanOpen) {
  GatewayConfig config;
  EXPECT_EQ(urls_of(config, 8080).front(), "http://127.0.0.1:8080");
  config.listen = "[::1]:0";
  EXPECT_EQ(urls_of(config, 99).front(), "http://[::1]:99");
  config.listen = "0.0.0.0:8080";
  config.tls = TlsConfig{};
  EXPECT_EQ(urls_of(config, 8080).front().find("0.0.0.0"), std::string::npos)
      << urls_of(config, 8080).front();
  config.hosts = {"room.example.org"};
  EXPECT_EQ(urls_of(config, 443).front(), "https://room.example.org:443");
}

std::vector<LiveStats> room() {
  LiveStats cam{
      "cam-0", 100, {{"cam-0: raw frames that it had no time for", 3}}, {{"fuse", {10, 20}}}, 5000};
  LiveStats root{"root", 90, {}, {}, 9000};
  root.inputs = {{"cam-0", true}, {"cam-1", false}};
  root.clock_offsets_s = {{"cam-0", -1.0}};
  LiveStats gateway{"gateway", 90, {}, {}, 9000};
  gateway.inputs = {{"cam-0", true}, {"cam-1", false}};
  gateway.viewers = {2, 12345, 17};
  return {cam, root, gateway};
}

TEST(Monitor, HealthNamesWhoIsMissing) {
  EXPECT_EQ(health_of(room()).missing, std::vector<std::string>{"cam-1"});
  EXPECT_EQ(health_of(room()).status, Health::Status::degraded);
  EXPECT_TRUE(
      health_json(room(), true).starts_with("{\"status\":\"degraded\",\"missing\":[\"cam-1\"]"));
  EXPECT_EQ(health_json(room(), false), "{\"status\":\"degraded\"}\n");
  auto nodes = room();
  nodes[2].is_silent = true;
  EXPECT_EQ(health_of(nodes).status, Health::Status::down);
  int made = 0;
  Monitor monitor([&] { return ++made, nodes; });
  EXPECT_EQ(monitor.page("/healthz", false)->status, 503);
  EXPECT_EQ(monitor.page("/metrics", false)->status, 401);
  EXPECT_FALSE(monitor.page("/", true));
  for (int i = 0; i < 100; ++i) monitor.page("/metrics", true);
  EXPECT_LE(made, 3) << "made anew now and then, however often somebody asks";
  LiveStats cam;
  cam.id = "cam-1";
  cam.is_silent = true;
  EXPECT_EQ(health_of({cam}).status, Health::Status::down) << "a process of one sensor";
  EXPECT_EQ(health_of({cam}).missing, std::vector<std::string>{"cam-1"});
}

TEST(Monitor, MetricsAreInPrometheusText) {
  const std::string text = metrics_text(room());
  for (const char* line :
       {"# TYPE meshreduce_packets_total counter", "meshreduce_packets_total{node=\"cam-0\"} 100",
        "meshreduce_packet_bytes_total{node=\"root\"} 9000",
        "meshreduce_stage_seconds{node=\"cam-0\",stage=\"fuse\",percentile=\"50\"} 0.015",
        "meshreduce_drops_total{node=\"cam-0\",cause=\"cam-0: raw frames that it had no time "
        "for\"} 3",
        "meshreduce_input_up{node=\"gateway\",input=\"cam-1\"} 0",
        "meshreduce_clock_offset_seconds{node=\"root\",input=\"cam-0\"} -1", "meshreduce_viewers 2",
        "meshreduce_viewer_sent_bytes_total 12345", "meshreduce_resident_bytes "})
    EXPECT_NE(text.find(line), std::string::npos) << line << "\n" << text;
}

}  // namespace
}  // namespace mr::node
