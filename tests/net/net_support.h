#pragma once

#include <arpa/inet.h>
#include <netdb.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

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
  explicit RawSocket(int port, int receive_buffer = 0) {
    handle_ = ::socket(AF_INET, SOCK_STREAM, 0);
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
  std::string read_some() {
    char buffer[65536];
    const ::ssize_t n = ::recv(handle_, buffer, sizeof buffer, 0);
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

inline int free_port() { return HeldPort().port(); }

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
