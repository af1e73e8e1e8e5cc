#include "mr/net/nats_link.h"

#include <nats/nats.h>

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <limits>
#include <random>
#include <utility>
#include <vector>

#include "mr/net/address.h"
#include "mr/net/fragments.h"
#include "mr/net/registry.h"

namespace mr::net {
namespace {

using Clock = std::chrono::steady_clock;

constexpr int kConnectMs = 2000;
constexpr int kReconnectMs = 100;
constexpr int kJitterMs = 20;
constexpr int kPingMs = 2000;
constexpr int kWriteMs = 2000;
constexpr int kPendingMessages = 1 << 16;
constexpr std::chrono::seconds kClosePatience{5};

int as_int(std::size_t n) {
  return static_cast<int>(std::min<std::size_t>(n, std::numeric_limits<int>::max()));
}

std::vector<std::string> split_urls(const std::string& urls) {
  std::vector<std::string> all;
  for (std::size_t from = 0; from <= urls.size();) {
    const std::size_t comma = std::min(urls.find(',', from), urls.size());
    all.push_back(urls.substr(from, comma - from));
    from = comma + 1;
  }
  return all;
}

/// A URL without user, password or token: what may be logged.
std::string without_secrets(const std::string& url) {
  const std::size_t scheme = url.find("://");
  const std::size_t at = url.rfind('@');
  if (at == std::string::npos) return url;
  return (scheme == std::string::npos ? "" : url.substr(0, scheme + 3)) + url.substr(at + 1);
}

std::string loggable(const std::string& urls) {
  std::string text;
  for (const std::string& url : split_urls(urls))
    text += (text.empty() ? "" : ",") + without_secrets(url);
  return text;
}

Status check_url(const std::string& url) {
  const std::string shown = without_secrets(url);
  for (const std::string scheme : {"nats://", "tls://"}) {
    if (!shown.starts_with(scheme)) continue;
    const std::string host = shown.substr(scheme.size());
    if (parse_address(host) || parse_address(host + ":4222")) return {};
  }
  return Error{Error::Cause::invalid,
               "\"" + shown + "\" is no NATS server: write nats://host:port"};
}

}  // namespace

/// What the library's callbacks need. They may come late, so it outlives the connection.
struct NatsEvents {
  std::string server;
  std::function<void(const std::string&)> log;
  std::shared_ptr<Drops> drops;
  std::mutex mutex;
  std::condition_variable changed;
  bool closed = false;  ///< by the library
  bool quiet = false;   ///< we are about to close it
  bool away = false;
  Clock::time_point told_slow;

  void set_away(bool now_away) {
    const std::lock_guard lock(mutex);
    if (std::exchange(away, now_away) == now_away || quiet) return;
    tell(now_away ? "cannot be reached; trying on" : "is back");
  }
  void on_slow(const std::string& subject) {
    const std::lock_guard lock(mutex);
    if (quiet) return;
    drops->count("subject " + subject, "slow consumer, messages lost");
    const auto now = Clock::now();
    if (now - std::exchange(told_slow, now) > std::chrono::seconds(1))
      tell("subject " + subject + ": this program does not keep up, messages were lost");
  }
  void on_closed() {
    const std::lock_guard lock(mutex);
    closed = true;
    changed.notify_all();
  }
  void silence() {
    const std::lock_guard lock(mutex);
    quiet = true;
  }
  void wait_closed() {
    std::unique_lock lock(mutex);
    changed.wait_for(lock, kClosePatience, [&] { return closed; });
  }

 private:
  void tell(const std::string& line) const {
    if (log) log("NATS server " + server + ": " + line);
  }
};

namespace {

/// Closures of the library are pointers to a shared_ptr, freed by its last callback.
template <typename T>
std::shared_ptr<T>& shared(void* closure) {
  return *static_cast<std::shared_ptr<T>*>(closure);
}

void on_disconnected(natsConnection*, void* closure) {
  shared<NatsEvents>(closure)->set_away(true);
}
void on_connected(natsConnection*, void* closure) { shared<NatsEvents>(closure)->set_away(false); }
void on_closed(natsConnection*, void* closure) {
  shared<NatsEvents>(closure)->on_closed();
  delete &shared<NatsEvents>(closure);
}
void on_error(natsConnection*, natsSubscription* subscription, natsStatus status, void* closure) {
  if (status != NATS_SLOW_CONSUMER || subscription == nullptr) return;
  const char* subject = natsSubscription_GetSubject(subscription);  // null once it has ended
  shared<NatsEvents>(closure)->on_slow(subject ? subject : "that has ended");
}

}  // namespace

/// One subject, whichever connection it is subscribed on.
class NatsInlet {
 public:
  NatsInlet(std::string s, std::size_t message_bytes, std::size_t bytes, NatsLink::Handler handler,
            std::shared_ptr<Drops> drops)
      : subject(std::move(s)),
        handler_(std::move(handler)),
        drops_(std::move(drops)),
        reassembly_({.message_bytes = message_bytes, .bytes = bytes}) {}

  static void on_message(natsConnection*, natsSubscription*, natsMsg* message, void* closure) {
    shared<NatsInlet>(closure)->arrived(message);
    natsMsg_Destroy(message);
  }
  static void on_complete(void* closure) { delete &shared<NatsInlet>(closure); }

  void end() { handler_.end(); }

  const std::string subject;
  natsSubscription* subscription = nullptr;  ///< by the link's mutex

 private:
  void arrived(natsMsg* message) {
    const auto bytes = std::as_bytes(std::span(
        natsMsg_GetData(message), static_cast<std::size_t>(natsMsg_GetDataLength(message))));
    const char* reply = natsMsg_GetReply(message);
    NatsArrival arrival{natsMsg_GetSubject(message), reply ? reply : "", put_together(bytes)};
    if (arrival.message) handler_(arrival);
  }

  Message put_together(std::span<const std::byte> bytes) {
    const std::lock_guard lock(mutex_);  // the thread of a former connection may still be here
    const std::uint64_t lost = reassembly_.lost();
    Message message = reassembly_.accept(Clock::now(), bytes);
    drops_->count("subject " + subject, "broken messages", reassembly_.lost() - lost);
    return message;
  }

  Guarded<void(const NatsArrival&)> handler_;
  const std::shared_ptr<Drops> drops_;
  std::mutex mutex_;
  Reassembly reassembly_;
};

struct NatsLink::Connection {
  std::shared_ptr<NatsEvents> events = std::make_shared<NatsEvents>();
  natsConnection* handle = nullptr;
  /// Ended, but kept: libnats 3.4 may still deliver to a subscription on its reading thread while
  /// we destroy it (its issue 637). That thread is gone once the connection is closed.
  std::vector<natsSubscription*> ended;

  ~Connection() {
    if (handle == nullptr) return;
    events->silence();
    natsConnection_Close(handle);
    events->wait_closed();
    for (natsSubscription* subscription : ended) natsSubscription_Destroy(subscription);
    natsConnection_Destroy(handle);
  }
};

namespace {

struct OptionsDeleter {
  void operator()(natsOptions* options) const { natsOptions_Destroy(options); }
};
using Options = std::unique_ptr<natsOptions, OptionsDeleter>;

/// First failure of a row of calls.
struct Row {
  natsStatus status = NATS_OK;
  Row& operator<<(natsStatus next) {
    if (status == NATS_OK) status = next;
    return *this;
  }
};

Result<Options> make_options(const std::string& urls, void* closure) {
  natsOptions* o = nullptr;
  if (natsOptions_Create(&o) != NATS_OK) return Error{Error::Cause::io, "NATS: out of memory"};
  Options options(o);
  const std::vector<std::string> all = split_urls(urls);
  std::vector<const char*> servers;
  for (const std::string& url : all) servers.push_back(url.c_str());
  Row row;
  row << natsOptions_SetServers(o, servers.data(), as_int(servers.size()))
      << natsOptions_SetTimeout(o, kConnectMs) << natsOptions_SetMaxReconnect(o, -1)
      << natsOptions_SetReconnectWait(o, kReconnectMs)
      << natsOptions_SetReconnectJitter(o, kJitterMs, kJitterMs)
      << natsOptions_SetReconnectBufSize(o, 1)  // what waited for the server would be stale
      << natsOptions_SetPingInterval(o, kPingMs) << natsOptions_SetMaxPingsOut(o, 2)
      << natsOptions_SetWriteDeadline(o, kWriteMs) << natsOptions_SetSendAsap(o, true)
      << natsOptions_DisableNoResponders(o, true)
      << natsOptions_SetRetryOnFailedConnect(o, true, on_connected, closure)
      << natsOptions_SetReconnectedCB(o, on_connected, closure)
      << natsOptions_SetDisconnectedCB(o, on_disconnected, closure)
      << natsOptions_SetClosedCB(o, on_closed, closure)
      << natsOptions_SetErrorHandler(o, on_error, closure);
  if (urls.find("tls://") != std::string::npos) row << natsOptions_SetSecure(o, true);
  if (row.status != NATS_OK)
    return Error{Error::Cause::invalid, std::string("NATS: ") + natsStatus_GetText(row.status)};
  return options;
}

}  // namespace

NatsLink::NatsLink(std::string urls, const TransportLimits& limits, std::shared_ptr<Drops> drops)
    : urls_(std::move(urls)), limits_(limits), drops_(std::move(drops)) {
  std::random_device random;
  last_message_ = (std::uint64_t{random()} << 32) | random();
}

NatsLink::~NatsLink() { close(); }

void NatsLink::close() {
  std::set<std::shared_ptr<NatsInlet>> inlets;
  std::unique_ptr<Connection> connection;
  {
    const std::lock_guard lock(mutex_);
    unsubscribe_all();
    inlets.swap(inlets_);
    connection.swap(connection_);
  }
  for (const auto& inlet : inlets) inlet->end();
}

Result<std::shared_ptr<NatsLink>> NatsLink::open(const std::string& urls,
                                                 const TransportLimits& limits,
                                                 std::shared_ptr<Drops> drops) {
  for (const std::string& url : split_urls(urls))
    if (auto ok = check_url(url); !ok) return ok.error();
  std::shared_ptr<NatsLink> link(new NatsLink(urls, limits, std::move(drops)));
  if (auto ok = link->connect(); !ok) return ok.error();
  return link;
}

Status NatsLink::connect() {
  auto connection = std::make_unique<Connection>();
  NatsEvents& events = *connection->events;
  events.server = loggable(urls_);
  events.log = limits_.log;
  events.drops = drops_;
  events.away = connection_ != nullptr;  // told already
  auto closure = std::make_unique<std::shared_ptr<NatsEvents>>(connection->events);
  auto options = make_options(urls_, closure.get());
  if (!options) return options.error();
  const natsStatus status = natsConnection_Connect(&connection->handle, options->get());
  if (connection->handle != nullptr) closure.release();  // on_closed frees it
  events.set_away(status != NATS_OK);
  connection_ = std::move(connection);
  for (const auto& inlet : inlets_) subscribe(inlet);
  return {};
}

void NatsLink::unsubscribe(NatsInlet& inlet) {
  natsSubscription* subscription = std::exchange(inlet.subscription, nullptr);
  if (subscription == nullptr) return;
  natsSubscription_Unsubscribe(subscription);
  connection_->ended.push_back(subscription);
}

void NatsLink::unsubscribe_all() {
  for (const auto& inlet : inlets_) unsubscribe(*inlet);
}

void NatsLink::revive() {
  const std::lock_guard lock(mutex_);
  if (connection_->handle != nullptr && !natsConnection_IsClosed(connection_->handle)) {
    for (const auto& inlet : inlets_)
      if (inlet->subscription == nullptr) subscribe(inlet);
    return;
  }
  unsubscribe_all();
  static_cast<void>(connect());  // else again at the next call
}

void NatsLink::subscribe(const std::shared_ptr<NatsInlet>& inlet) {
  if (connection_->handle == nullptr) return;
  auto closure = std::make_unique<std::shared_ptr<NatsInlet>>(inlet);
  natsSubscription*& subscription = inlet->subscription;
  if (natsConnection_Subscribe(&subscription, connection_->handle, inlet->subject.c_str(),
                               NatsInlet::on_message, closure.get()) != NATS_OK)
    return;  // revive() does it
  natsSubscription_SetPendingLimits(subscription, kPendingMessages, as_int(limits_.queue_bytes));
  natsSubscription_SetOnCompleteCB(subscription, NatsInlet::on_complete, closure.release());
}

std::shared_ptr<NatsInlet> NatsLink::receive(const std::string& subject, std::size_t message_bytes,
                                             Handler handler) {
  auto inlet = std::make_shared<NatsInlet>(subject, message_bytes, limits_.queue_bytes,
                                           std::move(handler), drops_);
  const std::lock_guard lock(mutex_);
  inlets_.insert(inlet);
  subscribe(inlet);
  return inlet;
}

void NatsLink::forget(const std::shared_ptr<NatsInlet>& inlet) {
  {
    const std::lock_guard lock(mutex_);
    if (inlets_.erase(inlet) > 0) unsubscribe(*inlet);
  }
  inlet->end();
}

Status NatsLink::send(const std::string& subject, const std::string& reply,
                      const Message& message) {
  natsConnection* handle = connection_->handle;  // only this thread replaces it
  if (handle == nullptr || natsConnection_Status(handle) != NATS_CONN_STATUS_CONNECTED)
    return Error{Error::Cause::io, "no server"};
  const auto max_payload = static_cast<std::size_t>(natsConnection_GetMaxPayload(handle));
  const auto parts = fragment_count(message->size(), max_payload);
  if (!parts) return parts.error();
  const std::uint64_t id = ++last_message_;
  for (std::uint16_t part = 0; part < *parts; ++part) {
    const auto bytes = fragment(*message, id, part, *parts, max_payload);
    const natsStatus status =
        reply.empty()
            ? natsConnection_Publish(handle, subject.c_str(), bytes.data(), as_int(bytes.size()))
            : natsConnection_PublishRequest(handle, subject.c_str(), reply.c_str(), bytes.data(),
                                            as_int(bytes.size()));
    if (status != NATS_OK) return Error{Error::Cause::io, natsStatus_GetText(status)};
  }
  return {};
}

}  // namespace mr::net
