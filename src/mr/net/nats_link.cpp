#include "mr/net/nats_link.h"

#include <nats/nats.h>

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <limits>
#include <random>
#include <utility>
#include <vector>

#include "mr/core/secret_source.h"
#include "mr/net/fragments.h"
#include "mr/net/nats_failure.h"
#include "mr/net/registry.h"

namespace mr::net {
namespace {

using Clock = std::chrono::steady_clock;

constexpr int kConnectMs = 2000;
constexpr int kPingMs = 2000;
constexpr int kWriteMs = 2000;
constexpr int kPendingMessages = 1 << 16;
constexpr std::size_t kDenials = 100;
constexpr std::chrono::seconds kClosePatience{5};

int as_int(std::size_t n) {
  return static_cast<int>(std::min<std::size_t>(n, std::numeric_limits<int>::max()));
}

}  // namespace

/// Logs and counts a server's events, each once: disconnected, refused, back again. Outlives the
/// connections.
class NatsEvents {
 public:
  NatsEvents(std::string server, std::function<void(const std::string&)> log,
             std::shared_ptr<Drops> drops)
      : server_(std::move(server)), log_(std::move(log)), drops_(std::move(drops)) {}

  /// The connection failed or broke. Logs the first failure of each kind until on_connected().
  void on_disconnected(const NatsFailure& trouble) {
    const std::lock_guard lock(mutex_);
    if (logged_.insert(trouble.kind).second) log(trouble.text + "; trying on");
  }
  bool knows_unreachable() const {
    const std::lock_guard lock(mutex_);
    return logged_.contains(NatsFailure::Kind::unreachable);
  }
  void on_connected() {
    const std::lock_guard lock(mutex_);
    denied_.clear();
    if (!std::exchange(logged_, {}).empty()) log("is back");
  }
  void slow(const std::string& subject) {
    const std::lock_guard lock(mutex_);
    drops_->count("subject " + subject, "slow consumer, messages lost");
    const auto now = Clock::now();
    if (now - std::exchange(slow_logged_, now) > std::chrono::seconds(1))
      log("subject " + subject + ": this program does not keep up, messages were lost");
  }
  /// Logged once per subject and connection.
  void denied(const NatsDenial& denial) {
    const std::string what = denial.publishing ? "may not publish" : "may not subscribe";
    const std::lock_guard lock(mutex_);
    drops_->count("subject " + denial.subject, what);
    if (denied_.size() < kDenials && denied_.insert(what + denial.subject).second)
      log("subject " + denial.subject + ": this program " + what +
          " there; grant that in the server's configuration");
  }

 private:
  void log(const std::string& line) const {
    if (log_) log_("NATS server " + server_ + ": " + line);
  }

  const std::string server_;
  const std::function<void(const std::string&)> log_;
  const std::shared_ptr<Drops> drops_;
  mutable std::mutex mutex_;
  std::set<NatsFailure::Kind> logged_;
  std::set<std::string> denied_;
  Clock::time_point slow_logged_;
};

namespace {

/// The state of one connection that the library's callbacks use. Callbacks may come late, so it
/// outlives the connection.
struct NatsSession {
  std::shared_ptr<NatsEvents> events;
  NatsConfig config;
  std::mutex mutex;
  std::condition_variable changed;
  bool closed = false;  ///< by the library
  bool quiet = false;   ///< we are about to close it

  bool is_quiet() {
    const std::lock_guard lock(mutex);
    return quiet;
  }
  void silence() {
    const std::lock_guard lock(mutex);
    quiet = true;
  }
  void set_closed() {
    const std::lock_guard lock(mutex);
    closed = true;
    changed.notify_all();
  }
  void wait_closed() {
    std::unique_lock lock(mutex);
    changed.wait_for(lock, kClosePatience, [&] { return closed; });
  }
};

/// Closures of the library are pointers to a shared_ptr, freed by its last callback.
template <typename T>
std::shared_ptr<T>& shared(void* closure) {
  return *static_cast<std::shared_ptr<T>*>(closure);
}

void on_disconnected(natsConnection* connection, void* closure) {
  NatsSession& session = *shared<NatsSession>(closure);
  if (session.is_quiet()) return;
  const char* text = nullptr;
  natsStatus status = natsConnection_GetLastError(connection, &text);
  if (status != NATS_CONNECTION_AUTH_FAILED && status != NATS_SSL_ERROR)
    status = NATS_CONNECTION_CLOSED;  // the last error may be an unrelated one
  session.events->on_disconnected(nats_failure(status, text ? text : "", session.config));
}
void on_closed(natsConnection*, void* closure) {
  shared<NatsSession>(closure)->set_closed();
  delete &shared<NatsSession>(closure);
}
void on_error(natsConnection*, natsSubscription* subscription, natsStatus status, void* closure) {
  NatsSession& session = *shared<NatsSession>(closure);
  if (session.is_quiet()) return;
  if (status == NATS_NOT_PERMITTED) {
    natsStatus last = NATS_OK;  // thread-local: the library stores the error's text there
    const char* text = nats_GetLastError(&last);
    session.events->denied(nats_denial(text ? text : ""));
  } else if (status == NATS_SLOW_CONSUMER && subscription != nullptr) {
    const char* subject = natsSubscription_GetSubject(subscription);  // null once it has ended
    session.events->slow(subject ? subject : "that has ended");
  }
}

}  // namespace

/// A subscribed subject, independent of the current connection.
class NatsReceiver {
 public:
  NatsReceiver(std::string s, std::size_t message_bytes, std::size_t bytes,
               NatsLink::Handler handler, std::shared_ptr<Drops> drops)
      : subject(std::move(s)),
        handler_(std::move(handler)),
        drops_(std::move(drops)),
        reassembly_({.message_bytes = message_bytes, .bytes = bytes}) {}

  static void on_message(natsConnection*, natsSubscription*, natsMsg* message, void* closure) {
    shared<NatsReceiver>(closure)->arrived(message);
    natsMsg_Destroy(message);
  }
  static void on_complete(void* closure) { delete &shared<NatsReceiver>(closure); }

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
    const std::lock_guard lock(mutex_);  // a thread of a former connection may still be here
    const std::uint64_t lost = reassembly_.lost();
    Message message = reassembly_.accept(Clock::now(), bytes);
    drops_->count("subject " + subject, "broken messages", reassembly_.lost() - lost);
    return message;
  }

  CancellableCallback<void(const NatsArrival&)> handler_;
  const std::shared_ptr<Drops> drops_;
  std::mutex mutex_;
  Reassembly reassembly_;
};

struct NatsLink::Connection {
  std::shared_ptr<NatsSession> session = std::make_shared<NatsSession>();
  natsConnection* handle = nullptr;
  /// Ended, but kept: libnats 3.4 may still deliver to a subscription on its reading thread while
  /// we destroy it (its issue 637). That thread is gone once the connection is closed.
  std::vector<natsSubscription*> ended;

  ~Connection() {
    if (handle == nullptr) return;
    session->silence();
    natsConnection_Close(handle);
    session->wait_closed();
    for (natsSubscription* subscription : ended) natsSubscription_Destroy(subscription);
    natsConnection_Destroy(handle);
  }
};

namespace {

struct OptionsDeleter {
  void operator()(natsOptions* options) const { natsOptions_Destroy(options); }
};
using Options = std::unique_ptr<natsOptions, OptionsDeleter>;

/// The first failure in a sequence of calls.
struct FirstFailure {
  natsStatus status = NATS_OK;
  FirstFailure& operator<<(natsStatus next) {
    if (status == NATS_OK) status = next;
    return *this;
  }
};

Status library_error(natsStatus status, const std::string& what) {
  if (status == NATS_OK) return {};
  natsStatus last = NATS_OK;
  const char* text = nats_GetLastError(&last);
  return Error{Error::Cause::invalid,
               what + ": " + nats_text(text && *text ? text : natsStatus_GetText(status))};
}

/// Checks that a secret's file is readable: libnats reads it itself and would not report that it
/// cannot.
Status check_secret(const std::filesystem::path& file) {
  const auto secret = read_secret({{}, file});
  return secret ? Status() : Status(secret.error());
}

Status set_certificates(natsOptions* o, const NatsConfig& config) {
  if (config.url.find("tls://") == std::string::npos) return {};
  if (auto ok = library_error(natsOptions_SetSecure(o, true), "NATS: TLS"); !ok) return ok;
  if (!config.ca.empty())
    if (auto ok = library_error(natsOptions_LoadCATrustedCertificates(o, config.ca.c_str()),
                                "nats.ca: no certificates in " + config.ca.string());
        !ok)
      return ok;
  if (config.certificate.empty()) return {};
  return library_error(
      natsOptions_LoadCertificatesChain(o, config.certificate.c_str(), config.key.c_str()),
      "nats.cert and nats.key: no pair in " + config.certificate.string() + " and " +
          config.key.string());
}

Status set_identity(natsOptions* o, const NatsConfig& config) {
  if (!config.nkey.empty()) {
    if (auto ok = check_secret(config.nkey_seed); !ok) return ok;
    return library_error(
        natsOptions_SetNKeyFromSeed(o, config.nkey.c_str(), config.nkey_seed.c_str()), "nats.nkey");
  }
  if (config.credentials.empty()) return {};
  if (auto ok = check_secret(config.credentials); !ok) return ok;
  return library_error(
      natsOptions_SetUserCredentialsFromFiles(o, config.credentials.c_str(), nullptr),
      "nats.credentials");
}

/// Disables the library's own reconnection, as it does not report why it fails.
Result<Options> make_options(const NatsConfig& config, void* closure) {
  natsOptions* o = nullptr;
  if (natsOptions_Create(&o) != NATS_OK) return Error{Error::Cause::io, "NATS: out of memory"};
  Options options(o);
  const auto urls = nats_servers(config.url);
  if (!urls) return urls.error();
  std::vector<const char*> servers;
  for (const std::string& url : *urls) servers.push_back(url.c_str());
  FirstFailure failed;
  failed << natsOptions_SetServers(o, servers.data(), as_int(servers.size()))
         << natsOptions_SetTimeout(o, kConnectMs) << natsOptions_SetAllowReconnect(o, false)
         << natsOptions_SetPingInterval(o, kPingMs) << natsOptions_SetMaxPingsOut(o, 2)
         << natsOptions_SetWriteDeadline(o, kWriteMs) << natsOptions_SetSendAsap(o, true)
         << natsOptions_DisableNoResponders(o, true)
         << natsOptions_SetDisconnectedCB(o, on_disconnected, closure)
         << natsOptions_SetClosedCB(o, on_closed, closure)
         << natsOptions_SetErrorHandler(o, on_error, closure);
  if (failed.status != NATS_OK)
    return Error{Error::Cause::invalid, std::string("NATS: ") + natsStatus_GetText(failed.status)};
  if (auto ok = set_certificates(o, config); !ok) return ok.error();
  if (auto ok = set_identity(o, config); !ok) return ok.error();
  return options;
}

}  // namespace

NatsLink::NatsLink(NatsConfig config, const TransportLimits& limits, std::shared_ptr<Drops> drops)
    : config_(std::move(config)),
      limits_(limits),
      drops_(std::move(drops)),
      events_(std::make_shared<NatsEvents>(loggable(config_.url), limits_.log, drops_)) {
  std::random_device random;
  last_message_ = (std::uint64_t{random()} << 32) | random();
}

NatsLink::~NatsLink() { close(); }

void NatsLink::close() {
  std::set<std::shared_ptr<NatsReceiver>> receivers;
  std::unique_ptr<Connection> connection;
  {
    const std::lock_guard lock(mutex_);
    unsubscribe_all();
    receivers.swap(receivers_);
    connection.swap(connection_);
  }
  for (const auto& receiver : receivers) receiver->end();
}

Result<std::shared_ptr<NatsLink>> NatsLink::open(const NatsConfig& config,
                                                 const TransportLimits& limits,
                                                 std::shared_ptr<Drops> drops) {
  if (auto usable = make_options(config, nullptr); !usable) return usable.error();
  std::shared_ptr<NatsLink> link(new NatsLink(config, limits, std::move(drops)));
  link->reconnect();
  return link;
}

std::unique_ptr<NatsLink::Connection> NatsLink::connect() {
  auto connection = std::make_unique<Connection>();
  connection->session->events = events_;
  connection->session->config = config_;
  auto closure = std::make_unique<std::shared_ptr<NatsSession>>(connection->session);
  auto options = make_options(config_, closure.get());
  if (!options) {  // a file was removed meanwhile
    events_->on_disconnected({NatsFailure::Kind::other, options.error().message});
    return nullptr;
  }
  const natsStatus status = natsConnection_Connect(&connection->handle, options->get());
  if (connection->handle != nullptr) {
    closure.release();  // on_closed frees it
    events_->on_connected();
    return connection;
  }
  const bool known =
      (status == NATS_NO_SERVER || status == NATS_IO_ERROR) && events_->knows_unreachable();
  natsStatus last = NATS_OK;
  const char* text = nats_GetLastError(&last);
  if (!known) events_->on_disconnected(nats_failure(status, text ? text : "", config_));
  return nullptr;
}

void NatsLink::unsubscribe(NatsReceiver& receiver) {
  natsSubscription* subscription = std::exchange(receiver.subscription, nullptr);
  if (subscription == nullptr) return;
  natsSubscription_Unsubscribe(subscription);
  connection_->ended.push_back(subscription);
}

void NatsLink::unsubscribe_all() {
  for (const auto& receiver : receivers_) unsubscribe(*receiver);
}

void NatsLink::reconnect() {
  std::unique_ptr<Connection> broken;
  {
    const std::lock_guard lock(mutex_);
    if (connection_ && !natsConnection_IsClosed(connection_->handle)) {
      for (const auto& receiver : receivers_)
        if (receiver->subscription == nullptr) subscribe(receiver);
      return;
    }
    unsubscribe_all();
    broken.swap(connection_);
  }
  broken.reset();          // outside the lock: waits for its callbacks
  auto fresh = connect();  // takes seconds if the server does not answer
  if (!fresh) return;      // retried at the next call
  const std::lock_guard lock(mutex_);
  connection_ = std::move(fresh);
  for (const auto& receiver : receivers_) subscribe(receiver);
}

void NatsLink::subscribe(const std::shared_ptr<NatsReceiver>& receiver) {
  if (!connection_) return;
  auto closure = std::make_unique<std::shared_ptr<NatsReceiver>>(receiver);
  natsSubscription*& subscription = receiver->subscription;
  if (natsConnection_Subscribe(&subscription, connection_->handle, receiver->subject.c_str(),
                               NatsReceiver::on_message, closure.get()) != NATS_OK)
    return;  // reconnect() does it
  natsSubscription_SetPendingLimits(subscription, kPendingMessages, as_int(limits_.queue_bytes));
  natsSubscription_SetOnCompleteCB(subscription, NatsReceiver::on_complete, closure.release());
}

std::shared_ptr<NatsReceiver> NatsLink::receive(const std::string& subject,
                                                std::size_t message_bytes, Handler handler) {
  auto receiver = std::make_shared<NatsReceiver>(subject, message_bytes, limits_.queue_bytes,
                                                 std::move(handler), drops_);
  const std::lock_guard lock(mutex_);
  receivers_.insert(receiver);
  subscribe(receiver);
  return receiver;
}

void NatsLink::forget(const std::shared_ptr<NatsReceiver>& receiver) {
  {
    const std::lock_guard lock(mutex_);
    if (receivers_.erase(receiver) > 0) unsubscribe(*receiver);
  }
  receiver->end();
}

Status NatsLink::send(const std::string& subject, const std::string& reply,
                      const Message& message) {
  if (!connection_ ||  // only this thread replaces the connection
      natsConnection_Status(connection_->handle) != NATS_CONN_STATUS_CONNECTED)
    return Error{Error::Cause::io, "no server"};
  natsConnection* handle = connection_->handle;
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
