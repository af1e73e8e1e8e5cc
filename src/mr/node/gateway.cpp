#include "mr/node/gateway.h"

#include <malloc.h>

#include <algorithm>
#include <chrono>
#include <nlohmann/json.hpp>

#include "mr/codec/packet_codec.h"
#include "mr/node/front_door.h"
#include "mr/node/monitor.h"
#include "mr/node/node_clock.h"

namespace mr::node {
namespace {

using Json = nlohmann::ordered_json;

constexpr const char* kName = "gateway";
constexpr Duration kSilence = std::chrono::milliseconds(1500);   // after it, viewers are told
constexpr Duration kLongestSilence = std::chrono::seconds(10);   // where packets are far apart
constexpr Duration kTokenPatience = std::chrono::seconds(10);    // for a viewer's token
constexpr int kConnectionsPerViewer = 4;                         // a page's files, and the stream
constexpr Duration kHeadEvery = std::chrono::milliseconds(500);  // whole ones are asked for
constexpr std::size_t kMaxText = 1024;                           // bytes of a viewer's text message
constexpr std::size_t kMaxSensorsNamed = 256;                    // in a hello
constexpr std::size_t kMaxMessage = 128u << 10;  // bytes; the longest request is a little shorter

Json json_of(const Vec3d& v) { return {v.x, v.y, v.z}; }

/// The scene's sensors in their order, so that a packet's sensor numbers have names.
Json sensor_names(const Scene& scene) {
  Json names = Json::array();
  for (const SensorConfig& sensor : scene.sensors)
    if (names.size() < kMaxSensorsNamed) names.push_back(sensor.id);
  return names;
}

}  // namespace

/// What arrived on other threads and waits for the gateway's.
struct Gateway::Inbox {
  Signal signal;
  net::Outbox packets{{}};  // one by one: each is recorded in the viewers' queues
  ViewerInbox viewers;
  std::mutex mutex;
  std::vector<net::Message> answers;
};

Gateway::Gateway(const LiveContext& context, std::optional<Tokens> tokens)
    : context_(context),
      root_(context.scene->mergers.back().id),
      tokens_(std::move(tokens)),
      inbox_(std::make_shared<Inbox>()),
      sensors_(context.scene->sensors.size()),
      heads_(context.scene->id, root_) {
  drops_.set_listener([this](const std::string& place, const Error& error) {
    context_.warn(kName, place + ": " + error.message);
  });
}

Gateway::~Gateway() = default;

Result<std::unique_ptr<Gateway>> Gateway::start(const LiveContext& context,
                                                const GatewayConfig& config,
                                                const std::filesystem::path& page) {
  auto door = FrontDoor::open(
      config, context.state_folder.empty() ? "" : context.state_folder / context.scene->id);
  if (!door) return door.error();
  for (const std::string& notice : door->notices) context.tell(kName, notice);
  std::unique_ptr<Gateway> gateway(new Gateway(context, std::move(door->tokens)));
  net::WebConfig web;
  web.listen = config.listen;
  web.root = page;
  web.hosts = door->hosts;
  web.certificate = std::move(door->certificate);
  web.clients = config.viewers;
  web.clients_per_address = config.viewers_per_address;
  web.connections = kConnectionsPerViewer * config.viewers;
  web.connections_per_address = kConnectionsPerViewer * config.viewers_per_address;
  web.message_bytes = kMaxMessage;
  auto server = net::WebServer::start(web, gateway->handlers());
  if (!server) return server.error();
  gateway->server_ = *std::move(server);
  gateway->listen_to_root();
  gateway->thread_ =
      std::jthread([g = gateway.get()](const std::stop_token& stop) { g->run(stop); });
  return gateway;
}

net::WebHandlers Gateway::handlers() {
  const auto inbox = inbox_;
  net::WebHandlers out;
  out.opened = [inbox](net::ClientId viewer, const net::WebVisitor& visitor) {
    inbox->viewers.opened(viewer, visitor);
    inbox->signal.notify();
  };
  out.received = [inbox](net::ClientId viewer, std::span<const std::byte> bytes, bool is_text) {
    const bool goes_on = inbox->viewers.received(viewer, bytes, is_text, wall_time());
    inbox->signal.notify();
    return goes_on;
  };
  out.written = [inbox](net::ClientId viewer) {
    inbox->viewers.written(viewer);
    inbox->signal.notify();
  };
  out.closed = [inbox](net::ClientId viewer) {
    inbox->viewers.closed(viewer);
    inbox->signal.notify();
  };
  const auto monitor = std::make_shared<Monitor>(context_.stats);
  out.page = [this, monitor](const std::string& path, const net::WebVisitor& visitor) {
    return monitor->page(path, may_look(visitor));
  };
  return out;
}

bool Gateway::may_look(const net::WebVisitor& visitor) const {
  return !tokens_ || tokens_->check(visitor.token, wall_time()).verdict == Tokens::Verdict::right;
}

void Gateway::listen_to_root() {
  subscription_ = context_.transport->subscribe(root_, [inbox = inbox_](net::Message packet) {
    inbox->packets.push(std::move(packet));
    inbox->signal.notify();
  });
}

void Gateway::run(const std::stop_token& stop) {
  while (!stop.stop_requested()) {
    inbox_->signal.wait(stop, std::chrono::milliseconds(100));
    const TimePoint now = wall_time();
    const std::lock_guard lock(mutex_);
    take_events(now);
    take_packets(now);
    take_answers();
    close_overdue(now);
    tell_refusals(now);
    give_memory_back(now);
    ask_root(now);
    acknowledge();
    watch_silence(now);
  }
}

void Gateway::take_packets(TimePoint now) {
  while (const net::Message bytes = inbox_->packets.try_pop()) {
    auto packet = heads_.read(*bytes, now);
    packet ? take_packet(bytes, *std::move(packet), now)
           : drops_.count(root_ + " → gateway", packet.error());
  }
}

void Gateway::take_packet(const net::Message& bytes, Packet packet, TimePoint now) {
  if (heads_.began_afresh()) {
    viewers_.begin_afresh();
    acknowledged_.reset();
    if (frames_ > 0) send_to_all(hello());
  }
  ++frames_;
  bytes_ += bytes->size();
  if (last_packet_) interval_ = now - *last_packet_;
  last_packet_ = now;
  stopped_ = false;
  for (const SourceInfo& source : packet.sources)
    if (source.sensor < context_.scene->sensors.size())
      sensors_.seen(source.sensor, source.captured_at, now);
  send(viewers_.packet(std::move(packet), bytes, heads_.base(), now));
}

void Gateway::take_answers() {
  std::vector<net::Message> answers;
  {
    const std::lock_guard lock(inbox_->mutex);
    answers.swap(inbox_->answers);
  }
  for (const net::Message& answer : answers) {
    auto chunks = codec::decode_chunks(*answer);
    chunks ? viewers_.take_chunks(*std::move(chunks))
           : drops_.count(root_ + " → gateway", chunks.error());
  }
}

void Gateway::take_events(TimePoint now) {
  for (const Event& event : inbox_->viewers.take()) on_event(event, now);
}

void Gateway::on_event(const Event& event, TimePoint now) {
  switch (event.kind) {
    case Event::Kind::opened:
      return on_opened(event.viewer, event.visitor, now);
    case Event::Kind::closed:
      guests_.erase(event.viewer);
      return viewers_.closed(event.viewer);
    case Event::Kind::written:
      return send(viewers_.written(event.viewer, event.messages, now));
    case Event::Kind::binary:
      return on_request(event.viewer, event.bytes, now);
    case Event::Kind::text:
      return on_text(event.viewer,
                     {reinterpret_cast<const char*>(event.bytes.data()), event.bytes.size()}, now);
  }
}

/// Without tokens everybody is let in; else whoever's cookie holds one, or who says one next.
void Gateway::on_opened(net::ClientId viewer, const net::WebVisitor& visitor, TimePoint now) {
  guests_[viewer] = {visitor.address, now, false, false, {}};
  if (!tokens_) return admit(viewer);
  if (!visitor.token.empty()) return on_token(viewer, visitor.token, now);
  server_->send_text(viewer, Json{{"type", "locked"}}.dump());
}

void Gateway::on_token(net::ClientId viewer, const std::string& token, TimePoint now) {
  const Tokens::Answer answer = tokens_->check(token, now);
  if (answer.verdict == Tokens::Verdict::wrong) return refuse(viewer, "wrong token");
  if (answer.verdict == Tokens::Verdict::expired) return refuse(viewer, "the token has expired");
  guests_[viewer].until = answer.until;
  admit(viewer);
}

void Gateway::admit(net::ClientId viewer) {
  guests_[viewer].is_admitted = true;
  viewers_.opened(viewer);
  server_->send_text(viewer, hello());
}

/// One line for both sides.
void Gateway::refuse(net::ClientId viewer, const std::string& why) {
  const auto guest = guests_.find(viewer);
  if (guest == guests_.end()) return;
  drops_.count("viewer → gateway",
               {Error::Cause::invalid, "from " + guest->second.address + ": " + why});
  viewers_.closed(viewer);
  guests_.erase(guest);
  server_->close(viewer, why);
}

void Gateway::on_request(net::ClientId viewer, std::span<const std::byte> bytes, TimePoint now) {
  const auto guest = guests_.find(viewer);
  if (guest == guests_.end()) return;
  if (!guest->second.is_admitted) return refuse(viewer, "no token");
  const auto request = codec::decode_request(bytes);
  if (!request) return refuse(viewer, "not a request");
  if (const auto answer = viewers_.asked(viewer, *request, now)) server_->send(viewer, *answer);
}

void Gateway::on_text(net::ClientId viewer, const std::string& text, TimePoint now) {
  const auto guest = guests_.find(viewer);
  if (guest == guests_.end()) return;
  const Json message =
      text.size() > kMaxText ? Json() : Json::parse(text, nullptr, /*allow_exceptions=*/false);
  const auto word = [&](const char* key) {
    return message.is_object() && message.contains(key) && message[key].is_string()
               ? message[key].get<std::string>()
               : "";
  };
  const auto integer = [&](const char* key) {
    return message.contains(key) && message[key].is_number_unsigned()
               ? std::optional(message[key].get<std::uint64_t>())
               : std::nullopt;
  };
  const std::string type = word("type");
  if (!guest->second.is_admitted)
    return type == "token" ? on_token(viewer, word("token"), now) : refuse(viewer, "no token");
  if (type == "shown" && integer("sequence")) {
    send(viewers_.shown(viewer, *integer("sequence"), now));
    if (viewers_.has_shown(viewer) && !std::exchange(guest->second.is_kept, true))
      server_->keep(viewer);
    return;
  }
  if (type == "ping" && integer("id")) {
    const double ms = static_cast<double>(now.time_since_epoch().count()) / 1e6;
    return server_->send_text(
        viewer, Json{{"type", "pong"}, {"id", *integer("id")}, {"server_ms", ms}}.dump());
  }
  if (type == "token") return;  // it has shown one already
  refuse(viewer, "not a message of this protocol");
}

/// Those that use a place and do nothing with it.
void Gateway::close_overdue(TimePoint now) {
  for (const auto& [viewer, why, reads] : viewers_.overdue(now)) {
    refuse(viewer, why);
    if (!reads) server_->cut(viewer);
  }
  std::vector<std::pair<net::ClientId, std::string>> out;
  for (const auto& [viewer, guest] : guests_) {
    if (!guest.is_admitted && now - guest.came > kTokenPatience)
      out.emplace_back(viewer, "no token in time");
    if (guest.until && now >= *guest.until) out.emplace_back(viewer, "the token has expired");
  }
  for (const auto& [viewer, why] : out) refuse(viewer, why);
}

/// Whom the web server did not let in, or cut off: who was refused knows, and so does the log.
void Gateway::tell_refusals(TimePoint now) {
  if (!is_time(refusals_told_, std::chrono::seconds(1), now)) return;
  refusals_told_ = now;
  auto all = server_->drops();
  for (const auto& [cause, times] : all)
    if (const auto more = times - refusals_[cause]; more > 0)
      context_.warn(kName, cause + " (" + std::to_string(more) + ")");
  refusals_ = std::move(all);
}

/// What slow viewers made the process take, once they are gone: the allocator would keep it.
void Gateway::give_memory_back(TimePoint now) {
  constexpr std::size_t kWorthIt = 8u << 20;
  constexpr Duration kLater = std::chrono::seconds(1);  // when sockets have let go of it, too
  const std::size_t unread = viewers_.unread_bytes();
  most_unread_ = std::max(most_unread_, unread);
  if (most_unread_ >= kWorthIt && unread <= most_unread_ / 2) {
    most_unread_ = unread;
    give_back_at_ = now + kLater;
  }
  if (!give_back_at_ || now < *give_back_at_) return;
  give_back_at_.reset();
  ::malloc_trim(0);
}

/// For what viewers lack, and for a whole head.
void Gateway::ask_root(TimePoint now) {
  codec::Request request = viewers_.wanted(now);
  if (heads_.lacks_base() && is_time(head_asked_, kHeadEvery, now)) {
    request.whole_head = true;
    head_asked_ = now;
  }
  if (!request.empty()) send_request(request);
}

void Gateway::send_request(const codec::Request& request) {
  auto bytes = std::make_shared<const std::vector<std::byte>>(codec::encode_request(request));
  if (request.chunks.empty()) return context_.transport->request(root_, std::move(bytes));
  context_.transport->request(root_, std::move(bytes), [inbox = inbox_](net::Message answer) {
    constexpr std::size_t kMaxAnswers = 64;
    {
      const std::lock_guard lock(inbox->mutex);
      if (inbox->answers.size() < kMaxAnswers) inbox->answers.push_back(std::move(answer));
    }
    inbox->signal.notify();
  });
}

/// Lets the root go on as fast as the fastest viewer follows.
void Gateway::acknowledge() {
  const auto taken = viewers_.taken();
  if (!taken || taken == acknowledged_) return;
  acknowledged_ = taken;
  send_request({.key_frames = {}, .chunks = {}, .taken = taken});
}

void Gateway::watch_silence(TimePoint now) {
  constexpr Duration kStart = std::chrono::seconds(5);
  if (!last_packet_ && context_.frames_ahead > 1 && now - started_ > kStart && !stopped_) {
    stopped_ = true;
    context_.warn(kName, "nothing has come from '" + root_ + "' yet");
  }
  if (stopped_ || !last_packet_) return;
  if (now - *last_packet_ < std::clamp<Duration>(interval_ * 3, kSilence, kLongestSilence)) return;
  stopped_ = true;
  const auto ms = std::chrono::duration_cast<std::chrono::milliseconds>(now - *last_packet_);
  Json stopped{{"type", "stopped"}, {"after_ms", ms.count()}};
  if (*context_.ended >= context_.scene->sensors.size()) stopped["ended"] = true;
  send_to_all(stopped.dump());
  context_.warn(kName, "nothing comes from '" + root_ + "'");
}

void Gateway::send(std::vector<Viewers::Send> messages) {
  for (auto& [viewer, message] : messages) server_->send(viewer, std::move(message));
}

void Gateway::send_to_all(const std::string& text) {
  for (const auto& [viewer, guest] : guests_)
    if (guest.is_admitted) server_->send_text(viewer, text);
}

std::string Gateway::hello() const {
  const Scene& scene = *context_.scene;
  Json hello{
      {"type", "hello"},
      {"scene", scene.id},
      {"up", json_of(scene.up)},
      {"fps", scene.fps},
      {"lattice",
       {{"low_corner", json_of(scene.lattice.low_corner())}, {"step", scene.lattice.step_m()}}},
      {"sensors", sensor_names(scene)}};
  if (scene.gateway && scene.gateway->start)
    hello["start"] = {{"eye", json_of(scene.gateway->start->eye)},
                      {"look_at", json_of(scene.gateway->start->look_at)}};
  return hello.dump();
}

LiveStats Gateway::stats() const {
  LiveStats out{kName, frames_, drops_.by_cause(), {}, bytes_};
  const TimePoint now = wall_time();
  const std::lock_guard lock(mutex_);
  for (const auto& more : {viewers_.drops(), server_->drops()})
    for (const auto& [cause, n] : more) out.drops[cause] += n;
  if (const auto lost = inbox_->packets.counts().lost)
    out.drops[root_ + " → gateway: lost, gateway is slow"] = lost;
  out.is_silent = stopped_ || !last_packet_;
  const auto& sensors = context_.scene->sensors;
  for (std::size_t i = 0; i < sensors.size(); ++i)
    out.inputs[sensors[i].id] = !out.is_silent && !sensors_.is_missing(i, now);
  out.viewers = {viewers_.size(), server_->sent_bytes(), viewers_.unread_bytes()};
  return out;
}

}  // namespace mr::node
