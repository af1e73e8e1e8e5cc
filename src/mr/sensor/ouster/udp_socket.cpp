#include "mr/sensor/ouster/udp_socket.h"

#include <fmt/format.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <climits>
#include <cstring>
#include <utility>

namespace mr::sensor {
namespace {

constexpr std::size_t kMostPayloadBytes = 65536;

template <typename T>
bool set_socket_option(int socket, int level, int name, T value) {
  return ::setsockopt(socket, level, name, &value, sizeof value) == 0;
}

/// A system's address as ours; IPv4 within IPv6 (::ffff:a.b.c.d) becomes IPv4.
Endpoint endpoint_of(const sockaddr_storage& storage) {
  Endpoint out;
  if (storage.ss_family == AF_INET) {
    sockaddr_in v4{};
    std::memcpy(&v4, &storage, sizeof v4);
    std::memcpy(out.address.bytes.data(), &v4.sin_addr, 4);
    out.port = ntohs(v4.sin_port);
    return out;
  }
  sockaddr_in6 v6{};
  std::memcpy(&v6, &storage, sizeof v6);
  out.port = ntohs(v6.sin6_port);
  if (IN6_IS_ADDR_V4MAPPED(&v6.sin6_addr)) {
    std::memcpy(out.address.bytes.data(), v6.sin6_addr.s6_addr + 12, 4);
  } else {
    out.address.v6 = true;
    std::memcpy(out.address.bytes.data(), &v6.sin6_addr, 16);
  }
  return out;
}

/// Binds to an address; without one, to any of the socket's family.
bool bind_to(int socket, int family, const std::optional<IpAddress>& address, std::uint16_t port) {
  if (family == AF_INET) {
    sockaddr_in v4{};
    v4.sin_family = AF_INET;
    v4.sin_port = htons(port);
    if (address) std::memcpy(&v4.sin_addr, address->bytes.data(), 4);
    return ::bind(socket, reinterpret_cast<const sockaddr*>(&v4), sizeof v4) == 0;
  }
  sockaddr_in6 v6{};
  v6.sin6_family = AF_INET6;
  v6.sin6_port = htons(port);
  if (address) std::memcpy(&v6.sin6_addr, address->bytes.data(), 16);
  if (!address && !set_socket_option(socket, IPPROTO_IPV6, IPV6_V6ONLY, 0)) return false;
  return ::bind(socket, reinterpret_cast<const sockaddr*>(&v6), sizeof v6) == 0;
}

int open_socket(int family) {
  return ::socket(family, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, IPPROTO_UDP);
}

/// When the system received the datagram, and how many it had dropped by then.
void read_control(msghdr& message, Datagram& datagram, std::uint32_t& dropped) {
  for (cmsghdr* c = CMSG_FIRSTHDR(&message); c != nullptr; c = CMSG_NXTHDR(&message, c)) {
    if (c->cmsg_level != SOL_SOCKET) continue;
    if (c->cmsg_type == SCM_TIMESTAMPNS) {
      timespec time{};
      std::memcpy(&time, CMSG_DATA(c), sizeof time);
      datagram.captured_at =
          TimePoint(std::chrono::seconds(time.tv_sec) + std::chrono::nanoseconds(time.tv_nsec));
    }
    if (c->cmsg_type == SO_RXQ_OVFL) std::memcpy(&dropped, CMSG_DATA(c), sizeof dropped);
  }
}

Error socket_error(const std::string& what) {
  return {Error::Cause::io, "UDP " + what + ": " + std::strerror(errno)};
}

}  // namespace

UdpSocket::UdpSocket(int socket) : socket_(socket), payload_(kMostPayloadBytes) {}

UdpSocket::UdpSocket(UdpSocket&& other) noexcept
    : socket_(std::exchange(other.socket_, -1)),
      port_(other.port_),
      dropped_(other.dropped_),
      payload_(std::move(other.payload_)) {}

UdpSocket& UdpSocket::operator=(UdpSocket&& other) noexcept {
  std::swap(socket_, other.socket_);
  std::swap(port_, other.port_);
  std::swap(dropped_, other.dropped_);
  std::swap(payload_, other.payload_);
  return *this;
}

UdpSocket::~UdpSocket() {
  if (socket_ >= 0) ::close(socket_);
}

Result<UdpSocket> UdpSocket::bind(const Options& options) {
  std::optional<IpAddress> address;
  if (!options.address.empty()) {
    const auto parsed = parse_ip_address(options.address);
    if (!parsed) return Error{parsed.error().cause, "UDP address: " + parsed.error().message};
    address = *parsed;
  }
  int family = address && !address->v6 ? AF_INET : AF_INET6;
  int opened = open_socket(family);
  if (opened < 0 && !address) opened = open_socket(family = AF_INET);  // no IPv6 here
  if (opened < 0) return socket_error("socket");
  UdpSocket out(opened);
  set_socket_option(opened, SOL_SOCKET, SO_RCVBUF,
                    static_cast<int>(std::min<std::size_t>(options.buffer_bytes, INT_MAX / 2)));
  set_socket_option(opened, SOL_SOCKET, SO_TIMESTAMPNS, 1);
  set_socket_option(opened, SOL_SOCKET, SO_RXQ_OVFL, 1);
  if (!bind_to(opened, family, address, options.port))
    return socket_error(fmt::format("port {}", options.port));
  sockaddr_storage bound{};
  socklen_t size = sizeof bound;
  if (::getsockname(opened, reinterpret_cast<sockaddr*>(&bound), &size) != 0)
    return socket_error(fmt::format("port {}", options.port));
  out.port_ = endpoint_of(bound).port;
  return out;
}

std::size_t UdpSocket::buffer_bytes() const {
  int bytes = 0;
  socklen_t size = sizeof bytes;
  ::getsockopt(socket_, SOL_SOCKET, SO_RCVBUF, &bytes, &size);
  return static_cast<std::size_t>(std::max(bytes, 0));
}

Result<std::optional<Datagram>> UdpSocket::receive(Duration timeout) {
  pollfd wanted{socket_, POLLIN, 0};
  const auto wait_ms = std::clamp<std::int64_t>(
      std::chrono::ceil<std::chrono::milliseconds>(timeout).count(), 0, INT_MAX);
  const int ready = ::poll(&wanted, 1, static_cast<int>(wait_ms));
  if (ready < 0 && errno != EINTR) return socket_error(fmt::format("port {}", port_));
  if (ready <= 0) return std::optional<Datagram>();
  sockaddr_storage from{};
  iovec where{payload_.data(), payload_.size()};
  alignas(cmsghdr) std::array<std::byte, 256> control{};
  msghdr message{};
  message.msg_name = &from;
  message.msg_namelen = sizeof from;
  message.msg_iov = &where;
  message.msg_iovlen = 1;
  message.msg_control = control.data();
  message.msg_controllen = control.size();
  const ::ssize_t size = ::recvmsg(socket_, &message, 0);
  if (size < 0) {  // a datagram with a wrong checksum is gone by now; refusals are of no concern
    if (errno == EAGAIN || errno == EINTR || errno == ECONNREFUSED)
      return std::optional<Datagram>();
    return socket_error(fmt::format("port {}", port_));
  }
  Datagram datagram;
  datagram.captured_at = std::chrono::time_point_cast<Duration>(std::chrono::system_clock::now());
  datagram.from = endpoint_of(from);
  datagram.to.port = port_;
  datagram.payload = std::span(payload_).first(static_cast<std::size_t>(size));
  read_control(message, datagram, dropped_);
  return std::optional(datagram);
}

}  // namespace mr::sensor
