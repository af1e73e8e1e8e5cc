#include "mr/node/gateway.h"

#include <algorithm>
#include <chrono>
#include <nlohmann/json.hpp>

#include "mr/codec/packet_codec.h"
#include "mr/node/node_clock.h"

namespace mr::node {
namespace {

using Json = nlohmann::ordered_json;

constexpr Duration kSilence = std::chrono::seconds(2);           // after it, viewers are told
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

Gateway::Gateway(const LiveContext& context)
    : context_(context),
      root_(context.scene->mergers.back().id),
      inbox_(std::make_shared<Inbox>()),
      heads_(context.scene->id, root_) {
  drops_.set_listener([this](const std::string& place, const Error& error) {
    context_.log(place + ": " + error.message);
  });
}

Gateway::~Gateway() = default;

Result<std::unique_ptr<Gateway>> Gateway::start(const LiveContext& context,
                                                const GatewayConfig& config,
                                                const std::filesystem::path& page) {
  std::unique_ptr<Gateway> gateway(new Gateway(context));
  const auto inbox = gateway->inbox_;
  const auto event = [inbox](Event::Kind kind, net::ClientId viewer,
                             std::span<const std::byte> bytes = {}) {
    inbox->viewers.add(kind, viewer, bytes);
    inbox->signal.notify();
  };
  net::WebConfig web;
  web.listen = config.listen;
  web.root = page;
  web.message_bytes = kMaxMessage;
  auto server = net::WebServer::start(
      web, {.opened = [event](net::ClientId id) { event(Event::Kind::opened, id); },
            .received =
                [event](net::ClientId id, std::span<const std::byte> bytes, bool is_text) {
                  event(is_text ? Event::Kind::text : Event::Kind::binary, id, bytes);
                },
            .drained = [](net::ClientId) {},
            .closed = [event](net::ClientId id) { event(Event::Kind::closed, id); }});
  if (!server) return server.error();
  gateway->server_ = *std::move(server);
  gateway->listen_to_root();
  gateway->thread_ =
      std::jthread([g = gateway.get()](const std::stop_token& stop) { g->run(stop); });
  return gateway;
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
    take_events();
    take_packets(now);
    ask_root(now);
    acknowledge();
    watch_silence(now);
  }
}

void Gateway::take_packets(TimePoint now) {
  while (const net::Message bytes = inbox_->packets.try_pop()) {
    auto packet = heads_.read(*bytes);
    if (!packet) {
      drops_.count(root_ + " → gateway", packet.error());
      continue;
    }
    if (packet->epoch != epoch_ && frames_ > 0)
      for (const net::ClientId id : clients_) server_->send_text(id, hello());
    epoch_ = packet->epoch;
    ++frames_;
    last_packet_ = now;
    stopped_ = false;
    send(viewers_.packet(*std::move(packet), bytes, heads_.base()));
  }
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

void Gateway::take_events() {
  for (const Event& event : inbox_->viewers.take()) on_event(event);
}

void Gateway::on_event(const Event& event) {
  switch (event.kind) {
    case Event::Kind::opened:
      clients_.push_back(event.viewer);
      viewers_.opened(event.viewer);
      return server_->send_text(event.viewer, hello());
    case Event::Kind::closed:
      std::erase(clients_, event.viewer);
      return viewers_.closed(event.viewer);
    case Event::Kind::binary:
      return on_request(event.viewer, event.bytes);
    case Event::Kind::text:
      return on_text(event.viewer,
                     {reinterpret_cast<const char*>(event.bytes.data()), event.bytes.size()});
    case Event::Kind::flood:
      drops_.count("viewer → gateway", {Error::Cause::too_large, "too many messages at once"});
      return server_->close(event.viewer, "too many messages at once");
  }
}

void Gateway::on_request(net::ClientId viewer, std::span<const std::byte> bytes) {
  const auto request = codec::decode_request(bytes);
  if (!request) {
    drops_.count("viewer → gateway", request.error());
    return server_->close(viewer, "not a request");
  }
  if (const auto answer = viewers_.asked(viewer, *request, wall_time()))
    server_->send(viewer, *answer);
}

void Gateway::on_text(net::ClientId viewer, const std::string& text) {
  const Json message =
      text.size() > kMaxText ? Json() : Json::parse(text, nullptr, /*allow_exceptions=*/false);
  const auto integer = [&](const char* key) {
    const auto value = message.find(key);
    return value != message.end() && value->is_number_unsigned()
               ? std::optional(value->get<std::uint64_t>())
               : std::nullopt;
  };
  const std::string type =
      message.is_object() && message.contains("type") && message["type"].is_string()
          ? message["type"].get<std::string>()
          : "";
  if (type == "shown" && integer("sequence"))
    return send(viewers_.shown(viewer, *integer("sequence")));
  if (type == "ping" && integer("id")) {
    const double ms = static_cast<double>(wall_time().time_since_epoch().count()) / 1e6;
    return server_->send_text(
        viewer, Json{{"type", "pong"}, {"id", *integer("id")}, {"server_ms", ms}}.dump());
  }
  drops_.count("viewer → gateway", {Error::Cause::corrupt, "a text message that is none of ours"});
  server_->close(viewer, "not a message of this protocol");
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
  if (stopped_ || !last_packet_ || now - *last_packet_ < kSilence) return;
  stopped_ = true;
  const auto ms = std::chrono::duration_cast<std::chrono::milliseconds>(now - *last_packet_);
  const std::string text = Json{{"type", "stopped"}, {"after_ms", ms.count()}}.dump();
  for (const net::ClientId id : clients_) server_->send_text(id, text);
  context_.log("gateway: nothing came from '" + root_ + "' for 2 s");
}

void Gateway::send(std::vector<Viewers::Send> messages) {
  for (auto& [viewer, message] : messages) server_->send(viewer, std::move(message));
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
  LiveStats out{"gateway", frames_, drops_.by_cause(), {}};
  const std::lock_guard lock(mutex_);
  for (const auto& more : {viewers_.drops(), server_->drops()})
    for (const auto& [cause, n] : more) out.drops[cause] += n;
  if (const auto lost = inbox_->packets.counts().lost)
    out.drops[root_ + " → gateway: lost, gateway is slow"] = lost;
  return out;
}

}  // namespace mr::node
