#include "child.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <utility>
#include <vector>

namespace mr::bench {
namespace {

using Clock = std::chrono::steady_clock;
using Bytes = std::vector<std::uint8_t>;

bool send_all(int socket, const void* data, std::size_t size) {
  const char* at = static_cast<const char*>(data);
  while (size > 0) {
    const ssize_t sent = ::send(socket, at, size, MSG_NOSIGNAL);
    if (sent < 0 && errno == EINTR) continue;
    if (sent <= 0) return false;
    at += sent, size -= static_cast<std::size_t>(sent);
  }
  return true;
}

bool send_message(int socket, const Message& message) {
  const Bytes bytes = Message::to_cbor(message);
  const std::uint64_t size = bytes.size();
  return send_all(socket, &size, sizeof size) && send_all(socket, bytes.data(), bytes.size());
}

enum class Received { all, ended, late };

Received receive_all(int socket, void* data, std::size_t size, Clock::time_point until) {
  char* at = static_cast<char*>(data);
  while (size > 0) {
    const auto left = std::chrono::ceil<std::chrono::milliseconds>(until - Clock::now()).count();
    if (left <= 0) return Received::late;
    pollfd ready{socket, POLLIN, 0};
    const int polled = ::poll(&ready, 1, static_cast<int>(left));
    if (polled == 0) return Received::late;
    const ssize_t got = polled < 0 ? -1 : ::recv(socket, at, size, 0);
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) return Received::ended;
    at += got, size -= static_cast<std::size_t>(got);
  }
  return Received::all;
}

/// Sets `message` only when all of it came.
Received receive_message(int socket, Message& message, Clock::time_point until) {
  std::uint64_t size = 0;
  if (const Received r = receive_all(socket, &size, sizeof size, until); r != Received::all)
    return r;
  Bytes bytes(size);
  const Received r = receive_all(socket, bytes.data(), bytes.size(), until);
  if (r == Received::all) message = Message::from_cbor(bytes);
  return r;
}

Message answer_or_error(const Answerer& answer, const Message& question) {
  try {
    return {{"answer", answer(question)}};
  } catch (const std::exception& thrown) {
    return {{"error", thrown.what()}};
  }
}

void redirect_output(bool quiet) {
  if (quiet)
    if (const int nowhere = ::open("/dev/null", O_WRONLY); nowhere >= 0)
      ::dup2(nowhere, STDERR_FILENO);
  ::dup2(STDERR_FILENO, STDOUT_FILENO);
}

/// The child's whole life.
[[noreturn]] void serve(int socket, const std::function<Answerer()>& make) {
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  const rlimit no_core{0, 0};
  ::setrlimit(RLIMIT_CORE, &no_core);
  Answerer answer;
  const auto forever = Clock::now() + std::chrono::hours(24);
  Message question;
  while (receive_message(socket, question, forever) == Received::all) {
    const Message reply = answer_or_error(
        [&](const Message& asked) {
          if (!answer) answer = make();
          return answer(asked);
        },
        question);
    if (!send_message(socket, reply)) break;
  }
  ::_exit(0);
}

}  // namespace

Result<Child> Child::start(const std::function<Answerer()>& make, bool quiet) {
  int sockets[2];
  if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, sockets) != 0)
    return Error{Error::Cause::io, std::string("no socket pair: ") + std::strerror(errno)};
  std::fflush(nullptr);
  const int process = ::fork();
  if (process == 0) {
    ::close(sockets[0]);
    redirect_output(quiet);
    serve(sockets[1], make);
  }
  ::close(sockets[1]);
  if (process > 0) return Child(process, sockets[0]);
  ::close(sockets[0]);
  return Error{Error::Cause::io, std::string("cannot fork: ") + std::strerror(errno)};
}

Child::Child(Child&& other) noexcept
    : process_(std::exchange(other.process_, -1)), socket_(std::exchange(other.socket_, -1)) {}

Child::~Child() {
  if (socket_ >= 0) ::close(socket_);
  if (process_ <= 0) return;
  ::kill(process_, SIGKILL);
  ::waitpid(process_, nullptr, 0);
}

Error Child::how_it_ended() {
  int status = 0;
  ::waitpid(std::exchange(process_, -1), &status, 0);
  if (WIFSIGNALED(status))
    return {Error::Cause::io, fmt::format("ended by signal {} ({})", WTERMSIG(status),
                                          ::strsignal(WTERMSIG(status)))};
  return {Error::Cause::io, fmt::format("ended with code {}", WEXITSTATUS(status))};
}

Result<Message> Child::ask(const Message& question, std::chrono::seconds patience) {
  if (process_ <= 0) return Error{Error::Cause::io, "ended before"};
  Message reply;
  const Received received = send_message(socket_, question)
                                ? receive_message(socket_, reply, Clock::now() + patience)
                                : Received::ended;
  if (received == Received::late) {
    ::kill(process_, SIGKILL);
    how_it_ended();
    return Error{Error::Cause::io, fmt::format("killed: no answer in {} s", patience.count())};
  }
  if (received == Received::ended) return how_it_ended();
  if (reply.contains("error"))
    return Error{Error::Cause::invalid, reply["error"].get<std::string>()};
  return std::move(reply["answer"]);
}

Result<Message> apart(const std::function<Message()>& work, std::chrono::seconds patience) {
  auto child = Child::start([&] { return Answerer([&](const Message&) { return work(); }); });
  if (!child) return child.error();
  return child->ask(nullptr, patience);
}

}  // namespace mr::bench
