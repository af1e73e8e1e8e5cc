#pragma once

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

namespace mr::test {

/// Whether a TCP port of the loopback address is free right now.
inline bool is_free(int port) {
  const int fd = ::socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  address.sin_port = htons(static_cast<in_port_t>(port));
  const bool bound = ::bind(fd, reinterpret_cast<sockaddr*>(&address), sizeof address) == 0;
  ::close(fd);
  return bound;
}

/// A free TCP port of the loopback address, never returned twice by one program,
/// and below those that the system gives to connections: a connection that is tried before its
/// server listens would take the server's port at times.
inline int free_port() {
  constexpr int kFirst = 12000, kPorts = 20000;
  static int next = static_cast<int>(::getpid() * 97L % kPorts);  // programs start far apart
  do next = (next + 1) % kPorts;
  while (!is_free(kFirst + next));
  return kFirst + next;
}

}  // namespace mr::test
