#include "mr/net/web_server.h"

#include <gtest/gtest.h>
#include <openssl/bio.h>
#include <openssl/ssl.h>

#include <atomic>
#include <map>
#include <optional>
#include <set>

#include "core/temp_dir.h"
#include "net_support.h"

namespace mr::net {
namespace {

using namespace std::chrono_literals;
using test::eventually;
using Viewer = test::WebViewer;

/// A server that sends back what it gets, and knows who is there.
class Web : public testing::Test {
 protected:
  void start(WebConfig config = {}) {
    dir_.write("index.html", "<html>page</html>");
    dir_.write("assets/app-1.wasm", std::string(300000, 'w'));
    config.listen = "127.0.0.1:0";
    config.root = dir_.path();
    ViewerEvents events;
    events.opened = [this](ViewerId id, const Visitor& visitor) {
      set_present(id, true);
      const std::lock_guard lock(mutex_);
      visitors_[id] = visitor;
    };
    events.closed = [this](ViewerId id) { set_present(id, false); };
    events.writable = [this](ViewerId) { ++written_; };
    events.received = [this](ViewerId id, std::span<const std::byte> bytes, bool is_text) {
      if (++received_ > most_received_) return false;
      if (is_text)
        server_->send_text(id, test::text_of(bytes));
      else
        server_->send(id, test::text_message(test::text_of(bytes)));
      return true;
    };
    auto server = WebServer::listen(config, [](const std::string& path, const Visitor& visitor) {
      return path == "/who" ? std::optional(WebPage{200, "text/plain", visitor.token})
                            : std::nullopt;
    });
    ASSERT_TRUE(server) << server.error().message;
    server_ = std::move(*server);
    server_->run(events);
    port_ = server_->port();
  }

  void set_present(ViewerId id, bool present) {
    const std::lock_guard lock(mutex_);
    present ? static_cast<void>(present_.insert(id)) : static_cast<void>(present_.erase(id));
  }
  std::set<ViewerId> present() {
    const std::lock_guard lock(mutex_);
    return present_;
  }

  /// The answer to one request, on a connection of its own.
  std::string ask(const std::string& method, const std::string& target,
                  const std::string& more = {}) {
    test::RawSocket socket(port_);
    socket.send(method + " " + target + " HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n" +
                more + "\r\n");
    std::string answer;
    for (std::string some = socket.read_some(); !some.empty(); some = socket.read_some())
      answer += some;
    return answer;
  }
  bool echoes(Viewer& viewer) {
    return viewer.send(1, "still there?") && viewer.next_message().payload == "still there?";
  }

  test::TempDir dir_;
  std::mutex mutex_;
  std::set<ViewerId> present_;
  std::map<ViewerId, Visitor> visitors_;
  std::atomic<int> written_ = 0, received_ = 0, most_received_ = 1'000'000;
  int port_ = 0;
  std::unique_ptr<WebServer> server_;  // last: its handlers use the rest
};

TEST_F(Web, ServesThePageWithItsHeaders) {
  start();
  const std::string page = ask("GET", "/");
  EXPECT_TRUE(page.starts_with("HTTP/1.1 200 OK\r\n")) << page;
  EXPECT_TRUE(page.ends_with("\r\n\r\n<html>page</html>"));
  for (const char* header :
       {"Content-Type: text/html; charset=utf-8\r\n", "Cache-Control: no-cache\r\n",
        "X-Content-Type-Options: nosniff\r\n", "'wasm-unsafe-eval'", "Content-Length: 17\r\n"})
    EXPECT_NE(page.find(header), std::string::npos) << header;
  const std::string wasm = ask("GET", "/assets/app-1.wasm?v=1");
  EXPECT_NE(wasm.find("Content-Type: application/wasm\r\n"), std::string::npos);
  EXPECT_NE(wasm.find("immutable"), std::string::npos);
  EXPECT_GT(wasm.size(), 300000u);
  const std::string head = ask("HEAD", "/assets/app-1.wasm");
  EXPECT_NE(head.find("Content-Length: 300000\r\n"), std::string::npos);
  EXPECT_TRUE(head.ends_with("\r\n\r\n"));
  const std::size_t tag = page.find("ETag: ") + 6;
  const std::string etag = page.substr(tag, page.find("\r\n", tag) - tag);
  EXPECT_TRUE(ask("GET", "/", "If-None-Match: " + etag + "\r\n").starts_with("HTTP/1.1 304"));
}

TEST_F(Web, RefusesWhatItDoesNotServe) {
  start();
  const auto status = [&](const std::string& method, const std::string& target,
                          const std::string& more = {}) {
    const std::string answer = ask(method, target, more);
    return answer.size() > 12 ? answer.substr(9, 3) : "none";
  };
  EXPECT_EQ(status("GET", "/nowhere"), "404");
  EXPECT_EQ(status("HEAD", "/nowhere"), "404");
  EXPECT_EQ(status("GET", "/../../etc/passwd"), "404");
  EXPECT_EQ(status("GET", "/%2e%2e/%2e%2e/etc/passwd"), "404");
  EXPECT_EQ(status("GET", "/%00"), "400");
  EXPECT_EQ(status("GET", "http://x/"), "400");
  EXPECT_EQ(status("POST", "/"), "405");
  EXPECT_EQ(status("GET", "/stream"), "426");
  EXPECT_EQ(status("POST", "/", "Content-Length: 10\r\n"), "431");
  EXPECT_EQ(status("GET", "/", "X: " + std::string(9000, 'x') + "\r\n"), "431");
  test::RawSocket garbage(port_);
  garbage.send(std::string(50, '\xFE') + "\r\n\r\n");
  EXPECT_TRUE(garbage.closed_by_peer());
  EXPECT_EQ(status("GET", "/"), "200");
}

TEST_F(Web, EchoesMessagesOfAnySize) {
  start();
  Viewer viewer(port_);
  ASSERT_EQ(viewer.status(), 101);
  ASSERT_TRUE(eventually([&] { return present().size() == 1; }));
  for (const std::size_t bytes : {0, 1, 125, 126, 65535, 65536, 65537, 1 << 20}) {
    ASSERT_TRUE(viewer.send(2, std::string(bytes, 'b')));
    const auto message = viewer.next_message();
    EXPECT_EQ(message.opcode, 2);
    EXPECT_EQ(message.payload.size(), bytes);
  }
  ASSERT_TRUE(viewer.send(1, "text"));
  EXPECT_EQ(viewer.next_message().opcode, 1);
  EXPECT_TRUE(eventually([&] { return written_ == 8; }));
  ASSERT_TRUE(viewer.send(8, ""));
  EXPECT_EQ(viewer.next_message().opcode, 8);
  EXPECT_TRUE(viewer.socket().closed_by_peer());
  EXPECT_TRUE(eventually([&] { return present().empty(); }));
}

TEST_F(Web, ClosesWithAReason) {
  start();
  Viewer viewer(port_);
  ASSERT_TRUE(eventually([&] { return present().size() == 1; }));
  const ViewerId id = *present().begin();
  server_->send(id, test::message(200000));
  server_->close(id, "the scene ended");
  EXPECT_EQ(viewer.next_message().payload.size(), 200000u);
  const auto close = viewer.next_message();
  EXPECT_EQ(close.opcode, 8);
  EXPECT_EQ(close.payload.substr(2), "the scene ended");
  viewer.send(8, close.payload);
  EXPECT_TRUE(viewer.socket().closed_by_peer());
  EXPECT_TRUE(eventually([&] { return present().empty(); }));
  server_->send(id, test::message(1));  // gone: nothing happens
  server_->close(12345, "");
}

TEST_F(Web, WhoIsClosedIsGoneSoonWhateverWaitsForIt) {
  start();
  Viewer slow(port_, {.receive_buffer = 4096});
  ASSERT_TRUE(eventually([&] { return present().size() == 1; }));
  const ViewerId id = *present().begin();
  for (int i = 0; i < 20; ++i) server_->send(id, test::message(1'000'000));
  server_->close(id, "too slow");
  const auto started = test::Clock::now();
  while (!present().empty() && test::Clock::now() - started < 8s) {
    slow.socket().read_some(1000);
    std::this_thread::sleep_for(50ms);
  }
  EXPECT_LT(test::Clock::now() - started, 4s);
}

TEST_F(Web, OnlyTheStreamAndOnlyOurOwnPages) {
  start();
  const std::string host = "127.0.0.1:" + std::to_string(port_);
  EXPECT_EQ(Viewer(port_, {.origin = "http://" + host}).status(), 101);
  EXPECT_EQ(Viewer(port_, {.path = "/stream?scene=a"}).status(), 101);
  EXPECT_EQ(Viewer(port_, {.path = "/"}).status(), 404);
  EXPECT_EQ(Viewer(port_, {.path = "/stream/x"}).status(), 404);
  EXPECT_EQ(Viewer(port_, {.origin = "http://evil.example"}).status(), 403);
  EXPECT_EQ(Viewer(port_, {.origin = "http://" + host + ".evil.example"}).status(), 403);
  EXPECT_EQ(Viewer(port_, {.origin = "null"}).status(), 403);
  EXPECT_EQ(test::dropped(*server_, "page of another site"), 3u);
}

TEST_F(Web, LargeMessagesAndBrokenFramesEndTheirSenderOnly) {
  start({.message_bytes = 1000});
  Viewer good(port_), large(port_), broken(port_);
  ASSERT_TRUE(eventually([&] { return present().size() == 3; }));
  large.send(2, std::string(1001, 'x'));
  broken.socket().send(std::string(20, '\xFF'));
  EXPECT_TRUE(large.socket().closed_by_peer());
  EXPECT_TRUE(broken.socket().closed_by_peer());
  EXPECT_TRUE(eventually([&] { return present().size() == 1; }));
  EXPECT_EQ(test::dropped(*server_, "message too large"), 1u);
  EXPECT_TRUE(echoes(good));
}

TEST_F(Web, AViewerThatNeverReadsIsCutOff) {
  start({.stalled = 1s});
  Viewer good(port_);
  ASSERT_TRUE(eventually([&] { return present().size() == 1; }));
  const ViewerId good_id = *present().begin();
  Viewer stuck(port_, {.receive_buffer = 65536});
  ASSERT_TRUE(eventually([&] { return present().size() == 2; }));
  const ViewerId stuck_id = *present().rbegin();
  for (int i = 0; i < 60; ++i) server_->send(stuck_id, test::message(1000000));
  int rounds = 0;
  while (present().contains(stuck_id) && rounds < 2000) {
    server_->send(good_id, test::message(100000));
    ASSERT_EQ(good.next_message().payload.size(), 100000u);
    std::this_thread::sleep_for(5ms);
    ++rounds;
  }
  EXPECT_EQ(test::dropped(*server_, "client: takes nothing"), 1u);
  EXPECT_TRUE(echoes(good));
}

TEST_F(Web, TooMuchInOneQueueEndsIt) {
  start({.queue_bytes = 5000000});
  Viewer stuck(port_, {.receive_buffer = 65536});
  ASSERT_TRUE(eventually([&] { return present().size() == 1; }));
  for (int i = 0; i < 60; ++i) server_->send(*present().begin(), test::message(1000000));
  EXPECT_TRUE(eventually([&] { return present().empty(); }));
  EXPECT_EQ(test::dropped(*server_, "too much waits"), 1u);
}

TEST_F(Web, TooManySmallOnesInAQueueEndItToo) {
  start();
  Viewer stuck(port_, {.receive_buffer = 4096});
  ASSERT_TRUE(eventually([&] { return present().size() == 1; }));
  server_->send(*present().begin(), test::message(20'000'000));
  for (int i = 0; i < 300; ++i) server_->send_text(*present().begin(), "pong");
  EXPECT_TRUE(eventually([&] { return present().empty(); }));
  EXPECT_EQ(test::dropped(*server_, "too much waits"), 1u);
}

TEST_F(Web, SlowRequestsAreCutOff) {
  start({.patience = 1s});
  Viewer viewer(port_);
  test::RawSocket silent(port_), half(port_);
  half.send("GET / HTTP/1.1\r\nHost:");
  EXPECT_TRUE(silent.closed_by_peer(5s));
  EXPECT_TRUE(half.closed_by_peer(5s));
  EXPECT_TRUE(echoes(viewer));  // WebSockets may be silent for longer
}

TEST_F(Web, TooManyViewersAreTold) {
  start({.clients = 2});
  Viewer a(port_), b(port_);
  ASSERT_TRUE(eventually([&] { return present().size() == 2; }));
  for (const ViewerId id : present()) server_->pin(id);
  EXPECT_EQ(Viewer(port_).status(), 503);
  a.send(8, "");
  EXPECT_TRUE(a.socket().closed_by_peer());
  EXPECT_TRUE(eventually([&] { return present().size() == 1; }));
  EXPECT_EQ(Viewer(port_).status(), 101);
}

TEST_F(Web, AThousandConnectionsLeaveTheOthersHealthy) {
  start({.connections = 100});
  Viewer viewer(port_);
  {
    std::vector<test::RawSocket> crowd;
    for (int i = 0; i < 1000; ++i) crowd.emplace_back(port_);
    EXPECT_TRUE(eventually([&] { return test::dropped(*server_, "its place was needed") >= 900; }));
    EXPECT_TRUE(echoes(viewer));
  }
  EXPECT_TRUE(eventually([&] { return ask("GET", "/").starts_with("HTTP/1.1 200"); }));
  EXPECT_EQ(Viewer(port_).status(), 101);
  EXPECT_TRUE(echoes(viewer));
}

TEST_F(Web, AnswersForItsOwnNamesOnly) {
  start();
  const auto status = [&](const std::string& host, const std::string& first = "GET / HTTP/1.1") {
    test::RawSocket socket(port_);
    socket.send(first + "\r\n" + (host.empty() ? "" : "Host: " + host + "\r\n") +
                "Connection: close\r\n\r\n");
    const std::string answer = socket.read_until("\r\n\r\n");
    return answer.size() > 12 ? answer.substr(9, 3) : "none";
  };
  for (const char* ours :
       {"localhost", "LocalHost:1234", "127.0.0.1", "127.0.0.1:80", "[::1]:8080"})
    EXPECT_EQ(status(ours), "200") << ours;
  for (const char* others :
       {"evil.example", "localhost.evil.example", "192.168.1.5", "", "[::2]"}) {
    EXPECT_EQ(status(others), "421") << others;
    EXPECT_EQ(status(others, "GET /nowhere HTTP/1.1"), "421") << others;
    EXPECT_EQ(status(others, "POST /stream HTTP/1.1"), "421") << others;
    EXPECT_EQ(status(others, "GET /%00 HTTP/1.1"), "421") << others;
  }
  Viewer rebound(port_, {.host = "evil.example", .origin = "http://evil.example"});
  EXPECT_EQ(rebound.status(), 421) << "its page and the stream are of one origin, and not ours";
}

TEST_F(Web, AnswersForTheNamesItIsGiven) {
  start({.hosts = {"room.example.org"}});
  EXPECT_EQ(Viewer(port_, {.host = "Room.Example.Org:443"}).status(), 101);
  EXPECT_EQ(Viewer(port_, {.host = "localhost"}).status(), 421);
}

TEST_F(Web, OneAddressDoesNotTakeAllPlaces) {
  start({.clients = 8, .clients_per_address = 3});
  std::vector<Viewer> crowd;
  for (int i = 0; i < 3; ++i) crowd.emplace_back(port_, Viewer::Options{.from = "127.0.0.2"});
  ASSERT_TRUE(eventually([&] { return present().size() == 3; }));
  for (const ViewerId id : present()) server_->pin(id);
  EXPECT_EQ(Viewer(port_, {.from = "127.0.0.2"}).status(), 503);
  EXPECT_EQ(Viewer(port_, {.from = "127.0.0.3"}).status(), 101);
}

TEST_F(Web, ViewersThatShowNothingGiveTheirPlacesUp) {
  start({.clients = 4});
  std::vector<Viewer> idle;
  for (int i = 0; i < 4; ++i)
    idle.emplace_back(port_, Viewer::Options{.from = "127.0.1." + std::to_string(i)});
  ASSERT_TRUE(eventually([&] { return present().size() == 4; }));
  Viewer newcomer(port_);
  EXPECT_EQ(newcomer.status(), 101);
  EXPECT_TRUE(idle[0].socket().closed_by_peer()) << "who came first";
  EXPECT_TRUE(echoes(newcomer));
  for (const ViewerId id : present()) server_->pin(id);
  EXPECT_EQ(Viewer(port_).status(), 503) << "all are kept";
}

TEST_F(Web, ANewcomerGetsInBesideAThousandIdleConnectionsOfOneAddress) {
  start();
  std::vector<test::RawSocket> crowd;
  for (int i = 0; i < 1000; ++i) {
    crowd.emplace_back(port_, 0, "127.0.0.2");
  }
  std::atomic<bool> stop = false;
  std::thread trickle([&] {
    for (std::size_t at = 0; !stop; ++at, std::this_thread::sleep_for(50ms))
      for (std::size_t i = 0; i < crowd.size(); i += 2)
        crowd[i].send(std::string("GET / HTTP/1.1\r\nHost: loc").substr(at % 24, 1));
  });
  for (int round = 0; round < 5; ++round) {
    const auto started = test::Clock::now();
    EXPECT_EQ(Viewer(port_, {.from = "127.0.0.3"}).status(), 101);
    EXPECT_TRUE(ask("GET", "/").starts_with("HTTP/1.1 200"));
    EXPECT_LT(test::Clock::now() - started, 2s);
    std::this_thread::sleep_for(100ms);
  }
  stop = true;
  trickle.join();
}

TEST_F(Web, ANewcomerGetsInBesideIdleConnectionsOfManyAddresses) {
  start({.connections = 60});
  std::vector<test::RawSocket> crowd;
  for (int i = 0; i < 300; ++i)
    crowd.emplace_back(port_, 0, "127.0.2." + std::to_string(i % 200 + 1));
  const auto started = test::Clock::now();
  EXPECT_EQ(Viewer(port_, {.from = "127.0.0.3"}).status(), 101);
  EXPECT_LT(test::Clock::now() - started, 2s);
}

TEST_F(Web, ASlowTrickleOfHeaderBytesIsCutOff) {
  start({.patience = 1s});
  test::RawSocket trickle(port_);
  const auto started = test::Clock::now();
  const std::string head = "GET / HTTP/1.1\r\nHost: localhost\r\nX: " + std::string(1000, 'x');
  std::size_t sent = 0;
  while (sent < head.size() && !trickle.closed_by_peer(100ms)) trickle.send(head.substr(sent++, 1));
  EXPECT_LT(test::Clock::now() - started, 3s);
  EXPECT_LT(sent, 100u);
}

TEST_F(Web, AFlooderIsClosedAtOnce) {
  start();
  most_received_ = 100;
  Viewer flooder(port_);
  Viewer good(port_);
  const std::string frame = std::string("\x81\x81\0\0\0\0x", 7);
  std::string burst;
  for (int i = 0; i < 5000; ++i) burst += frame;
  for (int i = 0; i < 200 && flooder.socket().send(burst); ++i) continue;
  EXPECT_TRUE(flooder.socket().closed_by_peer());
  EXPECT_LT(received_, 110) << "of up to a million";
  most_received_ = 1'000'000;
  EXPECT_TRUE(echoes(good));
  EXPECT_EQ(test::dropped(*server_, "too many messages at once"), 1u);
}

TEST_F(Web, AFloodOfPingsIsClosed) {
  start();
  Viewer flooder(port_);
  for (int i = 0; i < 100'000 && flooder.send(9, ""); ++i) continue;
  EXPECT_TRUE(flooder.socket().closed_by_peer());
  EXPECT_EQ(test::dropped(*server_, "too many pings"), 1u);
}

TEST_F(Web, TellsWhatTokenSomebodyShows) {
  start();
  EXPECT_TRUE(ask("GET", "/who", "Cookie: a=b; meshreduce_token=Secret+1; c=d\r\n")
                  .ends_with("\r\n\r\nSecret+1"));
  EXPECT_TRUE(ask("GET", "/who", "Authorization: Bearer Secret+2\r\n").ends_with("Secret+2"));
  EXPECT_TRUE(ask("GET", "/who", "Cookie: xmeshreduce_token=no\r\n").ends_with("\r\n\r\n"));
  Viewer viewer(port_, {.headers = "Cookie: meshreduce_token=Secret+3\r\n"});
  ASSERT_TRUE(eventually([&] { return present().size() == 1; }));
  const std::lock_guard lock(mutex_);
  EXPECT_EQ(visitors_.begin()->second.token, "Secret+3");
  EXPECT_EQ(visitors_.begin()->second.address, "127.0.0.1");
}

/// What a TLS client that trusts anybody reads in answer to one request, of an upgraded connection
/// the head; empty where TLS fails.
std::string ask_by_tls(int port, const std::string& request) {
  SSL_CTX* context = SSL_CTX_new(TLS_client_method());
  BIO* bio = BIO_new_ssl_connect(context);
  std::string address = "127.0.0.1:" + std::to_string(port);
  BIO_ctrl(bio, BIO_C_SET_CONNECT, 0, address.data());
  std::string out;
  char buffer[4096];
  if (BIO_write(bio, request.data(), static_cast<int>(request.size())) > 0)
    for (int n = 0;
         !out.starts_with("HTTP/1.1 101") && (n = BIO_read(bio, buffer, sizeof buffer)) > 0;)
      out.append(buffer, static_cast<std::size_t>(n));
  BIO_free_all(bio);
  SSL_CTX_free(context);
  return out;
}

TEST_F(Web, SpeaksTlsWithACertificate) {
  start({.certificate = *make_certificate({"localhost"})});
  const std::string page =
      ask_by_tls(port_, "GET / HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n");
  EXPECT_TRUE(page.starts_with("HTTP/1.1 200")) << page;
  const std::string upgraded = ask_by_tls(
      port_,
      "GET /stream HTTP/1.1\r\nHost: localhost\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n"
      "Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n"
      "Origin: https://localhost\r\n\r\n");
  EXPECT_TRUE(upgraded.starts_with("HTTP/1.1 101")) << upgraded;
  const std::string plain = ask("GET", "/a?b");
  EXPECT_TRUE(plain.starts_with("HTTP/1.1 308")) << plain;
  EXPECT_NE(plain.find("Location: https://localhost/a?b\r\n"), std::string::npos) << plain;
  EXPECT_EQ(Viewer(port_).status(), 308) << "nothing in the clear";
}

TEST_F(Web, StopsPromptlyWithViewersAndQueues) {
  start();
  Viewer idle(port_), stuck(port_, {.receive_buffer = 65536});
  ASSERT_TRUE(eventually([&] { return present().size() == 2; }));
  for (const ViewerId id : present())
    for (int i = 0; i < 20; ++i) server_->send(id, test::message(1000000));
  const auto started = test::Clock::now();
  server_.reset();
  EXPECT_LT(test::Clock::now() - started, 500ms);
  EXPECT_TRUE(idle.socket().closed_by_peer());
}

TEST(WebServer, SaysWhatToDoAboutItsAddress) {
  const test::HeldPort held;
  const std::string address = "127.0.0.1:" + std::to_string(held.port());
  const auto taken = WebServer::listen({.listen = address});
  ASSERT_FALSE(taken);
  EXPECT_EQ(taken.error().cause, Error::Cause::io);
  EXPECT_NE(taken.error().message.find(address), std::string::npos);
  EXPECT_NE(taken.error().message.find("choose another"), std::string::npos);
  EXPECT_EQ(WebServer::listen({.listen = "nonsense"}).error().cause, Error::Cause::invalid);
  EXPECT_EQ(WebServer::listen({.listen = "no.such.host.invalid:80"}).error().cause,
            Error::Cause::io);
  const auto v6 = WebServer::listen({.listen = "[::1]:0"});
  EXPECT_TRUE(v6) << v6.error().message;
}

}  // namespace
}  // namespace mr::net
