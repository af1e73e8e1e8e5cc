#include "mr/gateway/access_policy.h"

#include <gtest/gtest.h>

#include <cstdlib>

#include "core/temp_dir.h"

namespace mr::gateway {
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
  const auto first = net::load_or_make_certificate(folder.path(), names);
  ASSERT_TRUE(first) << first.error().message;
  const auto again = net::load_or_make_certificate(folder.path(), names);
  ASSERT_TRUE(again);
  EXPECT_EQ(*net::fingerprint(*first), *net::fingerprint(*again)) << "trusted once, known again";
  EXPECT_EQ(net::fingerprint(*first)->size(), 32u * 3 - 1);
  EXPECT_EQ(net::expiry_warning(*first), "");
  const auto moved = net::load_or_make_certificate(folder.path(), {"localhost", "192.168.1.7"});
  EXPECT_EQ(*net::fingerprint(*first), *net::fingerprint(*moved)) << "the machine got an address";
  EXPECT_TRUE(net::load_or_make_certificate({}, names)) << "nowhere to keep it";
  const auto mode = std::filesystem::status(folder / "gateway.key").permissions();
  EXPECT_EQ(mode & std::filesystem::perms(077), std::filesystem::perms::none);
  const auto other =
      net::load_or_make_certificate(folder.path(), {"room.example.org"}, {"room.example.org"});
  ASSERT_TRUE(other);
  EXPECT_NE(*net::fingerprint(*first), *net::fingerprint(*other)) << "another name";
}

TEST(Certificate, AnExpiredOneIsSaidToBe) {
  const auto made = net::make_certificate({"localhost"}, -1);
  ASSERT_TRUE(made);
  EXPECT_NE(net::expiry_warning(*made).find("has expired"), std::string::npos);
  const auto soon = net::make_certificate({"localhost"}, 3);
  EXPECT_NE(net::expiry_warning(*soon).find("expires in"), std::string::npos);
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

TEST(AccessPolicy, BeyondThisMachineItNeedsTlsAndTokensUnlessOpen) {
  test::TempDir folder;
  folder.write("tokens", "0123456789abcdef");
  std::filesystem::permissions(folder / "tokens", std::filesystem::perms(0600));
  GatewayConfig config;
  const auto message = [&] {
    const auto policy = AccessPolicy::open(config, folder.path());
    return policy ? "" : policy.error().message;
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

TEST(AccessPolicy, SaysWhatIsWrongWithTokensAndCertificates) {
  test::TempDir folder;
  GatewayConfig config;
  config.tokens.env = "MR_NO_SUCH_TOKENS";
  auto policy = AccessPolicy::open(config, folder.path());
  ASSERT_FALSE(policy);
  EXPECT_TRUE(policy.error().message.starts_with("gateway.tokens: ")) << policy.error().message;
  ::setenv("MR_TEST_TOKENS", "short", 1);
  config.tokens.env = "MR_TEST_TOKENS";
  policy = AccessPolicy::open(config, folder.path());
  ASSERT_FALSE(policy);
  EXPECT_NE(policy.error().message.find("MR_TEST_TOKENS"), std::string::npos);
  EXPECT_EQ(policy.error().message.find("short"), std::string::npos);
  config.tokens = {};
  config.tls = TlsConfig{folder / "no.crt", folder / "no.key"};
  policy = AccessPolicy::open(config, folder.path());
  ASSERT_FALSE(policy);
  EXPECT_TRUE(policy.error().message.starts_with("gateway.tls: ")) << policy.error().message;
}

TEST(AccessPolicy, PrintsAnAddressThatOthersCanOpen) {
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

}  // namespace
}  // namespace mr::gateway
