#pragma once

#include <arpa/inet.h>
#include <netdb.h>
#include <netinet/in.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstring>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "mr/net/outbox.h"
#include "mr/net/transport.h"
#include "support/free_port.h"

namespace mr::test {

using Clock = std::chrono::steady_clock;

inline net::Message message(std::size_t bytes, int fill = 1) {
  return std::make_shared<const std::vector<std::byte>>(bytes, static_cast<std::byte>(fill));
}

inline net::Message text_message(const std::string& text) {
  const auto bytes = std::as_bytes(std::span(text));
  return std::make_shared<const std::vector<std::byte>>(bytes.begin(), bytes.end());
}

inline std::string text_of(std::span<const std::byte> bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

/// Folds by keeping the newest.
inline net::Message newest(std::span<const net::Message> messages) { return messages.back(); }

/// Waits until a condition holds; false after the time.
template <typename F>
bool eventually(F condition, std::chrono::milliseconds within = std::chrono::seconds(8)) {
  const auto until = Clock::now() + within;
  while (!condition()) {
    if (Clock::now() > until) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  return true;
}

/// A plain blocking TCP socket; reads give up after some seconds.
class RawSocket {
 public:
  explicit RawSocket(int port, int receive_buffer = 0, const std::string& from = {}) {
    handle_ = ::socket(AF_INET, SOCK_STREAM, 0);
    if (!from.empty()) {
      sockaddr_in own = loopback(0);
      ::inet_pton(AF_INET, from.c_str(), &own.sin_addr);
      ::bind(handle_, reinterpret_cast<const sockaddr*>(&own), sizeof own);
    }
    if (receive_buffer > 0)
      ::setsockopt(handle_, SOL_SOCKET, SO_RCVBUF, &receive_buffer, sizeof receive_buffer);
    const timeval patience{8, 0};
    ::setsockopt(handle_, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    const sockaddr_in address = loopback(port);
    connected_ =
        ::connect(handle_, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
  }
  RawSocket(RawSocket&& other) noexcept
      : handle_(std::exchange(other.handle_, -1)), connected_(other.connected_) {}
  RawSocket& operator=(RawSocket&&) = delete;
  ~RawSocket() {
    if (handle_ >= 0) ::close(handle_);
  }

  static sockaddr_in loopback(int port) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(static_cast<std::uint16_t>(port));
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    return address;
  }

  bool connected() const { return connected_; }
  bool send(const std::string& bytes) {
    return ::send(handle_, bytes.data(), bytes.size(), MSG_NOSIGNAL) ==
           static_cast<::ssize_t>(bytes.size());
  }
  /// Some bytes; empty when the peer closed or sent nothing for seconds.
  std::string read_some(std::size_t most = 65536) {
    char buffer[65536];
    const ::ssize_t n = ::recv(handle_, buffer, std::min(most, sizeof buffer), 0);
    return n > 0 ? std::string(buffer, static_cast<std::size_t>(n)) : std::string();
  }
  std::string read_exactly(std::size_t n) {
    while (pending_.size() < n) {
      const std::string more = read_some();
      if (more.empty()) return {};
      pending_ += more;
    }
    std::string out = pending_.substr(0, n);
    pending_.erase(0, n);
    return out;
  }
  std::string read_until(const std::string& mark) {
    std::string out;
    while (!out.ends_with(mark)) {
      const std::string next = read_exactly(1);
      if (next.empty()) return out;
      out += next;
    }
    return out;
  }
  bool readable() {
    pollfd wait{handle_, POLLIN, 0};
    return ::poll(&wait, 1, 0) > 0;
  }
  /// Whether the peer closes within `within`; what it sends before is thrown away.
  bool closed_by_peer(std::chrono::milliseconds within = std::chrono::seconds(8)) {
    const auto until = Clock::now() + within;
    while (Clock::now() < until) {
      pollfd wait{handle_, POLLIN, 0};
      if (::poll(&wait, 1, 20) <= 0) continue;
      char buffer[65536];
      if (::recv(handle_, buffer, sizeof buffer, 0) > 0) continue;
      ::shutdown(handle_, SHUT_WR);  // as every client does then
      return true;
    }
    return false;
  }

 private:
  int handle_ = -1;
  bool connected_ = false;
  std::string pending_;
};

/// A scripted WebSocket client that can also violate the protocol.
class WebViewer {
 public:
  struct Frame {
    int opcode = -1;  ///< 0 continuation, 1 text, 2 binary, 8 close, 9 ping; -1: connection is over
    bool last = false;
    std::string payload;
  };

  struct Options {
    std::string path = "/stream";
    std::string host = {};    ///< empty: 127.0.0.1 and the port
    std::string origin = {};  ///< empty: none
    std::string headers = {};
    std::string from = {};  ///< its own address; empty: 127.0.0.1
    int receive_buffer = 0;
  };

  explicit WebViewer(int port) : WebViewer(port, Options()) {}
  WebViewer(int port, const Options& options)
      : socket_(port, options.receive_buffer, options.from) {
    const std::string host =
        options.host.empty() ? "127.0.0.1:" + std::to_string(port) : options.host;
    const std::string& origin = options.origin;
    socket_.send("GET " + options.path + " HTTP/1.1\r\nHost: " + host +
                 "\r\nConnection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\n"
                 "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n" +
                 options.headers + (origin.empty() ? "" : "Origin: " + origin + "\r\n") + "\r\n");
    const std::string answer = socket_.read_until("\r\n\r\n");
    status_ = answer.size() > 12 ? std::stoi(answer.substr(9, 3)) : 0;
  }

  int status() const { return status_; }
  RawSocket& socket() { return socket_; }

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
  RawSocket socket_;
  int status_ = 0;
};

/// Holds a port, listening; port() is free again once it is destroyed.
class HeldPort {
 public:
  HeldPort() : handle_(::socket(AF_INET, SOCK_STREAM, 0)) {
    sockaddr_in address = RawSocket::loopback(0);
    const int on = 1;
    ::setsockopt(handle_, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
    ::bind(handle_, reinterpret_cast<sockaddr*>(&address), sizeof address);
    ::listen(handle_, 1);
    socklen_t size = sizeof address;
    ::getsockname(handle_, reinterpret_cast<sockaddr*>(&address), &size);
    port_ = ntohs(address.sin_port);
  }
  HeldPort(const HeldPort&) = delete;
  HeldPort& operator=(const HeldPort&) = delete;
  ~HeldPort() { ::close(handle_); }
  int port() const { return port_; }
  int handle() const { return handle_; }

 private:
  int handle_;
  int port_ = 0;
};

/// A program that runs until the object goes; its first word is a path.
class Child {
 public:
  explicit Child(std::vector<std::string> words) {
    std::vector<char*> arguments;
    for (std::string& word : words) arguments.push_back(word.data());
    arguments.push_back(nullptr);
    if (::posix_spawn(&pid_, words[0].c_str(), nullptr, nullptr, arguments.data(), environ) != 0)
      pid_ = -1;
  }
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;
  ~Child() {
    if (pid_ <= 0) return;
    signal(SIGKILL);
    ::waitpid(pid_, nullptr, 0);
  }
  void signal(int number) const { ::kill(pid_, number); }

 private:
  ::pid_t pid_ = -1;
};

/// Lines from several threads.
class Lines {
 public:
  void add(const std::string& line) {
    const std::lock_guard lock(mutex_);
    lines_.push_back(line);
  }
  std::vector<std::string> all() const {
    const std::lock_guard lock(mutex_);
    return lines_;
  }
  int count(const std::string& part) const {
    int n = 0;
    for (const std::string& line : all()) n += line.find(part) != std::string::npos ? 1 : 0;
    return n;
  }

 private:
  mutable std::mutex mutex_;
  std::vector<std::string> lines_;
};

/// Sum of the drops whose name contains `part`.
template <typename T>
std::uint64_t dropped(const T& source, const std::string& part) {
  std::uint64_t n = 0;
  for (const auto& [name, times] : source.drops())
    if (name.find(part) != std::string::npos) n += times;
  return n;
}

/// What arrived, and how often.
struct Receiver {
  std::atomic<int> count = 0;
  std::atomic<std::size_t> last_bytes = 0;
  std::unique_ptr<net::Subscription> subscription;

  Receiver(net::Transport& transport, const std::string& node)
      : subscription(transport.subscribe(node, [this](const net::Message& m) {
          last_bytes = m->size();
          ++count;
        })) {}
};

/// Publishes until a condition holds: a new connection sees packets "from now on" only.
template <typename F>
bool publish_until(net::Transport& transport, const std::string& node, F condition) {
  return eventually([&] {
    transport.publish(node, text_message("x"));
    return condition();
  });
}

}  // namespace mr::test
