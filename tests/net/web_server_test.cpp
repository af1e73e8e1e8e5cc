#include "mr/net/web_server.h"

#include <gtest/gtest.h>

#include <atomic>
#include <set>

#include "core/temp_dir.h"
#include "net_support.h"

namespace mr::net {
namespace {

using namespace std::chrono_literals;
using test::eventually;

/// A WebSocket client that does what it is told, bad things included.
class Viewer {
 public:
  struct Frame {
    int opcode = -1;  ///< 0 continuation, 1 text, 2 binary, 8 close, 9 ping; -1: connection is over
    bool last = false;
    std::string payload;
  };

  explicit Viewer(int port, const std::string& path = "/stream", const std::string& origin = {},
                  int receive_buffer = 0)
      : socket_(port, receive_buffer) {
    const std::string host = "127.0.0.1:" + std::to_string(port);
    socket_.send("GET " + path + " HTTP/1.1\r\nHost: " + host +
                 "\r\nConnection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\n"
                 "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n" +
                 (origin.empty() ? "" : "Origin: " + origin + "\r\n") + "\r\n");
    const std::string answer = socket_.read_until("\r\n\r\n");
    status_ = answer.size() > 12 ? std::stoi(answer.substr(9, 3)) : 0;
  }

  int status() const { return status_; }
  test::RawSocket& socket() { return socket_; }

  bool send(int opcode, const std::string& payload) {
    std::string out(1, static_cast<char>(0x80 | opcode));
    const std::size_t n = payload.size();
    if (n < 126) {
      out += static_cast<char>(0x80 | n);
    } else {
      const bool wide = n > 0xFFFF;
      out += static_cast<char>(0x80 | (wide ? 127 : 126));
      for (int i = wide ? 7 : 1; i >= 0; --i)
        out += static_cast<char>((std::uint64_t{n} >> (8 * i)) & 0xFF);
    }
    return socket_.send(out + std::string(4, '\0') + payload);  // a mask of zeros
  }

  Frame next_frame() {
    const std::string head = socket_.read_exactly(2);
    if (head.empty()) return {};
    std::size_t size = static_cast<unsigned char>(head[1]) & 0x7F;
    const std::size_t more = size == 126 ? 2 : size == 127 ? 8 : 0;
    if (more > 0) size = 0;
    for (const char c : socket_.read_exactly(more))
      size = size << 8 | static_cast<unsigned char>(c);
    const auto first = static_cast<unsigned char>(head[0]);
    return {first & 0x0F, (first & 0x80) != 0, size > 0 ? socket_.read_exactly(size) : ""};
  }

  /// A whole message: its pieces joined.
  Frame next_message() {
    Frame whole = next_frame();
    while (whole.opcode >= 0 && !whole.last) {
      const Frame piece = next_frame();
      if (piece.opcode < 0) return {};
      whole.payload += piece.payload;
      whole.last = piece.last;
    }
    return whole;
  }

 private:
  test::RawSocket socket_;
  int status_ = 0;
};

/// A server that sends back what it gets, and knows who is there.
class Web : public testing::Test {
 protected:
  void start(WebConfig config = {}) {
    dir_.write("index.html", "<html>page</html>");
    dir_.write("assets/app-1.wasm", std::string(300000, 'w'));
    config.listen = "127.0.0.1:0";
    config.root = dir_.path();
    WebHandlers handlers;
    handlers.opened = [this](ClientId id) { set_present(id, true); };
    handlers.closed = [this](ClientId id) { set_present(id, false); };
    handlers.drained = [this](ClientId) { ++drained_; };
    handlers.received = [this](ClientId id, std::span<const std::byte> bytes, bool is_text) {
      if (is_text)
        server_->send_text(id, test::text_of(bytes));
      else
        server_->send(id, test::text_message(test::text_of(bytes)));
    };
    auto server = WebServer::start(config, handlers);
    ASSERT_TRUE(server) << server.error().message;
    server_ = std::move(*server);
    port_ = server_->port();
  }

  void set_present(ClientId id, bool present) {
    const std::lock_guard lock(mutex_);
    present ? static_cast<void>(present_.insert(id)) : static_cast<void>(present_.erase(id));
  }
  std::set<ClientId> present() {
    const std::lock_guard lock(mutex_);
    return present_;
  }

  /// The answer to one request, on a connection of its own.
  std::string ask(const std::string& method, const std::string& target,
                  const std::string& more = {}) {
    test::RawSocket socket(port_);
    socket.send(method + " " + target + " HTTP/1.1\r\nHost: x\r\nConnection: close\r\n" + more +
                "\r\n");
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
  std::set<ClientId> present_;
  std::atomic<int> drained_ = 0;
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
  EXPECT_TRUE(eventually([&] { return drained_ == 9; }));
  ASSERT_TRUE(viewer.send(8, ""));
  EXPECT_EQ(viewer.next_message().opcode, 8);
  EXPECT_TRUE(viewer.socket().closed_by_peer());
  EXPECT_TRUE(eventually([&] { return present().empty(); }));
}

TEST_F(Web, ClosesWithAReason) {
  start();
  Viewer viewer(port_);
  ASSERT_TRUE(eventually([&] { return present().size() == 1; }));
  const ClientId id = *present().begin();
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

TEST_F(Web, OnlyTheStreamAndOnlyOurOwnPages) {
  start();
  const std::string host = "127.0.0.1:" + std::to_string(port_);
  EXPECT_EQ(Viewer(port_, "/stream", "http://" + host).status(), 101);
  EXPECT_EQ(Viewer(port_, "/stream?scene=a").status(), 101);
  EXPECT_EQ(Viewer(port_, "/").status(), 404);
  EXPECT_EQ(Viewer(port_, "/stream/x").status(), 404);
  EXPECT_EQ(Viewer(port_, "/stream", "http://evil.example").status(), 403);
  EXPECT_EQ(Viewer(port_, "/stream", "http://" + host + ".evil.example").status(), 403);
  EXPECT_EQ(Viewer(port_, "/stream", "null").status(), 403);
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
  const ClientId good_id = *present().begin();
  Viewer stuck(port_, "/stream", "", 65536);
  ASSERT_TRUE(eventually([&] { return present().size() == 2; }));
  const ClientId stuck_id = *present().rbegin();
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
  Viewer stuck(port_, "/stream", "", 65536);
  ASSERT_TRUE(eventually([&] { return present().size() == 1; }));
  for (int i = 0; i < 60; ++i) server_->send(1, test::message(1000000));
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
    EXPECT_TRUE(eventually([&] { return test::dropped(*server_, "too many connections") >= 900; }));
    EXPECT_TRUE(echoes(viewer));
  }
  EXPECT_TRUE(eventually([&] { return ask("GET", "/").starts_with("HTTP/1.1 200"); }));
  EXPECT_EQ(Viewer(port_).status(), 101);
  EXPECT_TRUE(echoes(viewer));
}

TEST_F(Web, StopsPromptlyWithViewersAndQueues) {
  start();
  Viewer idle(port_), stuck(port_, "/stream", "", 65536);
  ASSERT_TRUE(eventually([&] { return present().size() == 2; }));
  for (const ClientId id : present())
    for (int i = 0; i < 20; ++i) server_->send(id, test::message(1000000));
  const auto started = test::Clock::now();
  server_.reset();
  EXPECT_LT(test::Clock::now() - started, 500ms);
  EXPECT_TRUE(idle.socket().closed_by_peer());
}

TEST(WebServer, SaysWhatToDoAboutItsAddress) {
  const test::HeldPort held;
  const std::string address = "127.0.0.1:" + std::to_string(held.port());
  const auto taken = WebServer::start({.listen = address}, {});
  ASSERT_FALSE(taken);
  EXPECT_EQ(taken.error().cause, Error::Cause::io);
  EXPECT_NE(taken.error().message.find(address), std::string::npos);
  EXPECT_NE(taken.error().message.find("choose another"), std::string::npos);
  EXPECT_EQ(WebServer::start({.listen = "nonsense"}, {}).error().cause, Error::Cause::invalid);
  EXPECT_EQ(WebServer::start({.listen = "no.such.host.invalid:80"}, {}).error().cause,
            Error::Cause::io);
  const auto v6 = WebServer::start({.listen = "[::1]:0"}, {});
  EXPECT_TRUE(v6) << v6.error().message;
}

}  // namespace
}  // namespace mr::net
