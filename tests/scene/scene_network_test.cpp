#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "scene/scene_file.h"

namespace mr {
namespace {

using test::scene_of;
using test::SceneFile;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

TEST_F(SceneFile, NatsKeysFitTogether) {
  const std::string nkey = "U" + std::string(55, 'A');
  const SceneResult result = load(scene_of(
      {"a"}, "nats: {url: 'tls://x', ca: ca.pem, cert: a.pem, key: a.key, nkey: {public: " + nkey +
                 ", seed: a.nk}}\n"));
  EXPECT_THAT(shorten(result.problems), IsEmpty());
  const NatsConfig& nats = result.scene.network.nats;
  EXPECT_EQ(
      nats,
      (NatsConfig{
          "tls://x", dir_ / "ca.pem", dir_ / "a.pem", dir_ / "a.key", nkey, dir_ / "a.nk", {}}));
  const auto refused = [&](const std::string& keys) { return problem_of("nats: {" + keys + "}"); };
  EXPECT_THAT(refused("ca: ca.pem"), HasSubstr("4: nats lacks the key 'url'"));
  EXPECT_THAT(refused("url: 'tls://x', cert: a.pem"), HasSubstr("4: nats: cert and key only"));
  EXPECT_THAT(refused("url: 'tls://x', key: a.key"), HasSubstr("4: nats: cert and key only"));
  EXPECT_THAT(refused("url: 'nats://x', ca: ca.pem"), HasSubstr("4: nats: ca needs tls://"));
  EXPECT_THAT(refused("url: 'nats://x', cert: a, key: b"), HasSubstr("4: nats: cert needs tls://"));
  EXPECT_THAT(refused("url: 'nats://x', nkey: {public: SUA, seed: a}"),
              HasSubstr("4: public must be the public NKey of a user"));
  EXPECT_THAT(refused("url: 'nats://x', credentials: c, nkey: {public: " + nkey + ", seed: a}"),
              HasSubstr("4: nats: either nkey or credentials, not both"));
}

TEST_F(SceneFile, SecretsStandElsewhere) {
  const auto secret_of = [&](const std::string& source) {
    const SceneResult result = load(scene_of({"a"}, "tcp: {secret: " + source + "}\n"));
    EXPECT_THAT(shorten(result.problems), IsEmpty());
    return result.scene.network.tcp_secret;
  };
  EXPECT_EQ(secret_of("{env: MR_SECRET}"), (SecretSource{"MR_SECRET", {}}));
  EXPECT_EQ(secret_of("{file: keys/tcp}"), (SecretSource{{}, dir_ / "keys/tcp"}))
      << "whether it is there is another node's business";
  const auto refused = [&](const std::string& source) {
    return problem_of("tcp: {secret: " + source + "}");
  };
  const std::string in_file = refused("sesame-open-thyself");
  EXPECT_THAT(in_file,
              HasSubstr("4: secret must not stand in the scene file; write {env: NAME} or"));
  EXPECT_EQ(in_file.find("sesame"), std::string::npos);
  EXPECT_THAT(refused("{}"), HasSubstr("4: secret needs either env or file"));
  EXPECT_THAT(refused("{env: A, file: b}"), HasSubstr("4: secret needs either env or file"));
  EXPECT_THAT(refused("{env: 7x}"), HasSubstr("4: secret.env is not the name of an environment"));
  EXPECT_THAT(refused("{file: ''}"), HasSubstr("4: secret.file must name a file"));
  const auto named = problems(scene_of({"secret"}, "tcp: {secret: {env: A}}\n"));
  EXPECT_THAT(named, ElementsAre(HasSubstr("4: tcp: no node of the scene may be named 'secret'")));
}

TEST_F(SceneFile, GatewayTellsWhereAViewerStarts) {
  const SceneResult result =
      load(scene_of({"a"}, "gateway: {start: {eye: [2, -1.5, 1.6], look_at: [0, 0.25, 1]}}\n"));
  EXPECT_THAT(shorten(result.problems), IsEmpty());
  ASSERT_TRUE(result.scene.gateway && result.scene.gateway->start);
  EXPECT_EQ(result.scene.gateway->start->eye, (Vec3d{2, -1.5, 1.6}));
  EXPECT_EQ(result.scene.gateway->start->look_at, (Vec3d{0, 0.25, 1}));
  EXPECT_EQ(result.scene.gateway->listen, GatewayConfig{}.listen);
  EXPECT_FALSE(load(scene_of({"a"}, "gateway: {}\n")).scene.gateway->start);
}

TEST_F(SceneFile, AStartThatIsNoPlaceIsAProblem) {
  const auto with = [&](const std::string& start) {
    return problem_of("gateway: {start: {" + start + "}}");
  };
  EXPECT_THAT(with("eye: [1, 2, 3]"), HasSubstr("look_at"));
  EXPECT_THAT(with("eye: [1, 2], look_at: [0, 0, 0]"), HasSubstr("eye"));
  EXPECT_THAT(with("eye: [1, 2, 3], look_at: [1, 2, 3]"), HasSubstr("another place"));
  EXPECT_THAT(with("eye: [1, 2, .inf], look_at: [1, 2, 3]"), HasSubstr("eye"));
  EXPECT_THAT(with("eye: [1, 2, 3], look_at: [0, 0, 0], fov: 60"), HasSubstr("fov"));
}

TEST_F(SceneFile, TheGatewaysDoorsAreRead) {
  const auto result = load(scene_of(
      {"a"},
      "gateway: {tls: {cert: c.pem, key: k.pem}, tokens: {env: TOKENS}, hosts: [Room.Example.Org, "
      "\"fe80::1\"], open: true, viewers: 5, viewers_per_address: 2}\n"));
  ASSERT_TRUE(result.problems.empty()) << testing::PrintToString(shorten(result.problems));
  const GatewayConfig& gateway = *result.scene.gateway;
  EXPECT_EQ(gateway.tls->cert, dir_ / "c.pem");
  EXPECT_EQ(gateway.tokens.env, "TOKENS");
  EXPECT_EQ(gateway.hosts, (std::vector<std::string>{"room.example.org", "fe80::1"}));
  EXPECT_TRUE(gateway.open);
  EXPECT_EQ(gateway.viewers, 5);
  const auto own = load(scene_of({"a"}, "gateway: {tls: auto}\n"));
  ASSERT_TRUE(own.scene.gateway->tls);
  EXPECT_TRUE(own.scene.gateway->tls->cert.empty()) << "one of its own";
}

TEST_F(SceneFile, WrongDoorsAreProblems) {
  EXPECT_NE(problem_of("gateway: {tls: yes}").find("auto"), std::string::npos);
  EXPECT_NE(problem_of("gateway: {tls: {cert: c.pem}}").find("key"), std::string::npos);
  EXPECT_NE(problem_of("gateway: {tokens: 0123456789abcdef}").find("must not stand in the scene"),
            std::string::npos);
  EXPECT_NE(problem_of("gateway: {hosts: [\"localhost:8080\"]}").find("without port"),
            std::string::npos);
  EXPECT_NE(problem_of("gateway: {hosts: room}").find("list of names"), std::string::npos);
}

}  // namespace
}  // namespace mr
